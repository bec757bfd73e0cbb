"""Each kind of lie against its formula, computed here with numpy over the whole flight at once."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ftcc.airside.attacks.arrays import Attacks, add_attack, end_attacks, new_attacks
from ftcc.airside.attacks.attack import Attack, touched
from ftcc.airside.attacks.lies import tell
from ftcc.airside.attacks.recording import drain_lies, lie_columns
from ftcc.airside.compiled_stages import placeholder
from ftcc.airside.schemes import find
from ftcc.link.exchange import new_exchange
from ftcc.link.timing import Timing

Array = NDArray[np.float64]

PERIOD = 0.05
TIMING = Timing(10_000, 50_000, 50_000, 1_000, 1000, 1, 7)
T = np.arange(200) * PERIOD
"""s, of the records."""
X = 100.0 + 3.0 * np.sin(0.7 * T)
V = 2.1 * np.cos(0.7 * T)
"""A value and its rate."""


def attacked(*attacks: Attack, scheme: str = "containment") -> Attacks:
    """The arrays of one follower with these attacks."""
    spec = dataclasses.replace(placeholder(scheme), attacks=attacks)
    return new_attacks([spec], find(scheme).shared_width, TIMING)


def told(attacks: Attacks, values: Array) -> Array:
    """What the follower tells of ``values`` (n, m), record by record."""
    exchange = new_exchange([1], [[]], 1, attacks.told.shape[1])
    found = []
    for n, row in enumerate(values):
        true = np.zeros(attacks.told.shape[1])
        true[: len(row)] = row
        tell(attacks, exchange, true, 0, n, n * TIMING.exchange_us)
        found.append(attacks.told[0, : len(row)].copy())
    return np.array(found)


def motion(attack: Attack) -> tuple[Array, Array]:
    """Told altitude and rate of a follower of chapter 5."""
    rows = told(attacked(attack), np.column_stack((X, V)))
    return rows[:, 0], rows[:, 1]


def lie(kind: str, size: float = 0.0, rate: float = 0.0, **more: Any) -> Attack:
    fields: dict[str, Any] = {"at_us": 2_000_000, "size": {"zhat": size}, "rate": {"zhat": rate}}
    return Attack(kind, **(fields | more))


S = T - 2.0
"""Time since the beginning, s."""
FROM = T >= 2.0


def until_then(false: Array, true: Array) -> Array:
    return np.where(FROM, false, true)


START = 40
"""Number of the first false record."""

CLOSED_FORMS: dict[str, tuple[Attack, Array, Array]] = {
    "offset": (lie("offset", 5.0), X + 5.0, V),
    "drift": (lie("drift", rate=0.4), X + 0.4 * S, V + 0.4),
    "drift with a limit": (
        lie("drift", 1.0, -0.4),
        X - np.minimum(0.4 * S, 1.0),
        V - np.where(0.4 * S < 1.0, 0.4, 0.0),
    ),
    "freeze": (lie("freeze"), np.full_like(X, X[START]), np.zeros_like(V)),
    "replay": (lie("replay", delay=1.5), np.roll(X, 30), np.roll(V, 30)),
    "replay of a window": (
        lie("replay", delay=1.5, period=0.5),
        X[START - 30 + np.arange(-START, 160) % 10],
        V[START - 30 + np.arange(-START, 160) % 10],
    ),
    "oscillate": (
        lie("oscillate", 3.0, period=1.3),
        X + 3.0 * np.sin(2.0 * np.pi / 1.3 * S),
        V + 3.0 * (2.0 * np.pi / 1.3) * np.cos(2.0 * np.pi / 1.3 * S),
    ),
    "opposite": (lie("opposite"), 2.0 * X[START] - X, -V),
    "collude": (lie("collude", 120.0, -0.3), 120.0 - 0.3 * S, np.full_like(V, -0.3)),
}


@pytest.mark.parametrize("name", CLOSED_FORMS)
def test_what_is_told_follows_the_formula_of_its_kind(name: str) -> None:
    attack, value, rate = CLOSED_FORMS[name]
    value_told, rate_told = motion(attack)
    assert value_told == pytest.approx(until_then(value, X), abs=1e-12)
    assert rate_told == pytest.approx(until_then(rate, V), abs=1e-12)
    assert np.array_equal(value_told[:START], X[:START])
    assert not np.allclose(value_told[START + 1 :], X[START + 1 :])


def test_those_who_collude_come_to_their_target_within_the_onset() -> None:
    """And their rate is the derivative of what they tell."""
    value, rate = motion(lie("collude", 120.0, 0.2, onset=4.0))
    share = np.clip(S / 4.0, 0.0, 1.0)
    assert value == pytest.approx((1.0 - share) * X + share * (120.0 + 0.2 * S), abs=1e-12)
    slopes = np.gradient(value, T)
    inside = np.r_[START + 2 : START + 78, START + 83 : 198]
    assert rate[inside] == pytest.approx(slopes[inside], abs=5e-3)


def test_a_replay_without_a_past_tells_the_oldest_that_it_has() -> None:
    value, _ = motion(lie("replay", delay=5.0, at_us=1_000_000))
    begun = T >= 1.0
    assert np.array_equal(value, np.where(begun, X[np.maximum(np.arange(200) - 100, 0)], X))


def test_noise_is_white_and_of_the_size_that_is_asked_for() -> None:
    series = np.column_stack((np.zeros(3000), np.zeros(3000)))
    rows = told(attacked(lie("noise", 2.0, at_us=0)), series)
    errors = rows[:, 0]
    assert errors.std() == pytest.approx(2.0, rel=0.05)
    assert abs(errors.mean()) < 0.12
    assert abs(np.corrcoef(errors[1:], errors[:-1])[0, 1]) < 0.05
    assert not rows[:, 1].any()
    again = told(attacked(lie("noise", 2.0, at_us=0)), series)
    assert np.array_equal(rows, again)
    other = told(attacked(lie("noise", 2.0, at_us=0, number=1)), series)
    assert abs(np.corrcoef(errors, other[:, 0])[0, 1]) < 0.05


def test_it_ends_when_it_is_to_end() -> None:
    value, rate = motion(lie("offset", 5.0, until_us=4_000_000))
    assert np.array_equal(value, np.where((T >= 2.0) & (T < 4.0), X + 5.0, X))
    assert np.array_equal(rate, V)


def test_an_inconsistent_lie_leaves_the_rate_true() -> None:
    _, rate = motion(lie("drift", rate=0.4, consistent=False))
    assert np.array_equal(rate, V)


def test_a_rate_alone_may_be_false() -> None:
    value, rate = motion(Attack("offset", 0, signals=("v",), size={"v": 1.0}))
    assert np.array_equal(value, X)
    assert np.array_equal(rate, V + 1.0)


def test_of_several_lies_each_takes_for_true_what_the_one_before_tells() -> None:
    rows = told(attacked(lie("offset", 5.0, at_us=0), lie("freeze"), lie("drift", rate=1.0)), np.column_stack((X, V)))
    assert rows[:, 0] == pytest.approx(np.where(FROM, X[START] + 5.0 + S, X + 5.0), abs=1e-12)
    assert rows[:, 1] == pytest.approx(np.where(FROM, 1.0, V), abs=1e-12)


def test_an_error_is_mirrored_about_zero() -> None:
    """Attitude errors: all three axes, and their rates."""
    errors = np.column_stack([np.sin(0.3 * T + n) for n in range(6)])
    rows = told(attacked(Attack("opposite", 2_000_000), scheme="directed_attitude"), errors)
    assert np.array_equal(rows, np.where(FROM[:, None], -errors, errors))


def test_a_lie_about_a_position_is_carried_into_velocity_and_acceleration() -> None:
    """Chapter 6: errors of position with two derivatives, told of one axis alone."""
    values = np.column_stack([np.cos(0.2 * T + n) for n in range(9)])
    attack = Attack("oscillate", 0, signals=("Pt_y",), size={"Pt_y": 2.0}, period=5.0)
    rows = told(attacked(attack, scheme="fire_monitoring"), values) - values
    w = 2.0 * np.pi / 5.0
    expected = np.zeros_like(values)
    expected[:, 1] = 2.0 * np.sin(w * T)
    expected[:, 4] = 2.0 * w * np.cos(w * T)
    expected[:, 7] = -2.0 * w * w * np.sin(w * T)
    assert rows == pytest.approx(expected, abs=1e-12)


def test_health_is_no_part_of_a_lie() -> None:
    """What records carry behind the scheme's values, where diagnosis is on."""
    spec = dataclasses.replace(placeholder("containment"), attacks=(lie("offset", 5.0, at_us=0),))
    wide = find("containment").shared_width + 4
    attacks = new_attacks([spec], wide, TIMING)
    values = np.arange(3.0 * wide).reshape(3, wide)
    rows = told(attacks, values)
    assert np.array_equal(rows[:, 0], values[:, 0] + 5.0)
    assert np.array_equal(rows[:, 1:], values[:, 1:])


def test_what_was_true_and_told_is_kept_for_the_recording() -> None:
    attacks = attacked(lie("offset", 5.0))
    told(attacks, np.column_stack((X, V)))
    scheme = find("containment")
    rows = drain_lies(attacks, scheme)
    names = [column.name for column in lie_columns(scheme)]
    by_name = dict(zip(names, rows.T, strict=True))
    assert by_name["t"] == pytest.approx(T[START:])
    assert set(by_name["uav"]) == {1.0}
    assert set(by_name["receiver"]) == {0.0}
    assert np.array_equal(by_name["true_zhat"], X[START:])
    assert np.array_equal(by_name["told_zhat"], X[START:] + 5.0)
    assert np.isnan(by_name["true_V"]).all()
    assert len(drain_lies(attacks, scheme)) == 0


def test_a_signal_that_nobody_shares_is_named() -> None:
    with pytest.raises(LookupError, match="it shares no altitude; it shares zhat, v"):
        touched(find("containment").shared["follower"], ["altitude"])


def test_attacks_from_the_ground_end_and_make_room() -> None:
    spec = placeholder("containment")
    attacks = attacked()

    def added(at_us: int) -> bool:
        return add_attack(attacks, 0, spec, lie("offset", 1.0, at_us=at_us), find("containment"), now_us=at_us)

    count = sum(added(0) for _ in range(1000))
    assert 0 < count < 1000
    assert end_attacks(attacks, 0, -1, 1_000_000) == count
    assert not added(500_000)
    assert added(1_000_000)
    rows = told(attacks, np.column_stack((X, V)))
    assert rows[:20, 0] == pytest.approx(X[:20] + count - 1, abs=1e-9)
    assert np.array_equal(rows[20:, 0], X[20:] + 1.0)
