"""The stage `defend` against an independent one with sorted lists, and what it promises of any set of liars."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ftcc.airside.compiled_stages import placeholder
from ftcc.airside.defence.arrays import GIVEN, TRUST, columns_of, new_defence
from ftcc.airside.defence.credibility import credit_left, is_lie, surprise
from ftcc.airside.defence.events import trust_text
from ftcc.airside.defence.gains import defence_gains
from ftcc.airside.defence.stage import defend
from ftcc.airside.schemes import find
from ftcc.airside.spec import DefenceSpec, Neighbour
from ftcc.link.events import drain_events, new_events

DT = 0.02


class Swarm:
    """One UAV that hears ``n`` neighbours, with ids from 2 on; those in ``leaders`` are leaders."""

    def __init__(self, scheme: str, n: int, leaders=(), trusted=(), width: int = 0, **gains: float) -> None:
        self.scheme = find(scheme)
        self.n = n
        self.m = width or self.scheme.shared_width
        spec = DefenceSpec(True, tuple(defence_gains(gains)), tuple(trusted), tuple(leaders))
        neighbours = tuple(Neighbour(uav, 1.0) for uav in range(2, n + 2))
        self.spec = dataclasses.replace(placeholder(scheme), neighbours=neighbours, defence=spec)
        self.defence = new_defence([self.spec], self.scheme, max(n, 1), self.m)
        self.events = new_events()
        self.t = 0.0

    def hear(self, values, shared, t: float = 1.0, age=None, valid=None):
        """Trust (n, m) and values (n, m) after a tick at which these were the newest records."""
        values = np.asarray(values, float).reshape(self.n, -1 if self.n else self.m)
        values = np.hstack([values, np.zeros((self.n, self.m - values.shape[1]))])
        age = np.zeros(self.n) if age is None else np.asarray(age, float)
        valid = np.ones(self.n) if valid is None else np.asarray(valid, float)
        stamp = np.where(valid > 0, np.round((t - age) * 1e6), -1).astype(np.int64)
        own = np.hstack([np.asarray(shared, float), np.zeros(self.m - len(shared))])
        d = self.defence
        d.shared_at[0] = t
        defend(d, 0, self.n, values, age, valid, stamp, own, self.events, t, DT)
        return d.heard[TRUST, 0, : self.n].copy(), d.heard[GIVEN, 0, : self.n].copy()

    def told_events(self):
        senders = [neighbour.uav for neighbour in self.spec.neighbours]
        return [(row[0] / 1e6, *trust_text(row[2], row[3], senders)) for row in drain_events(self.events)]


def reduced(present, own: float, F: int):
    """W-MSR as LeBlanc et al. write it, on sorted lists: who stays."""
    kept = np.ones(len(present), bool)
    above = sorted((j for j in range(len(present)) if present[j] > own), key=lambda j: (-present[j], j))
    below = sorted((j for j in range(len(present)) if present[j] < own), key=lambda j: (present[j], j))
    kept[above[:F]] = False
    kept[below[:F]] = False
    return kept


values_of = st.lists(st.one_of(st.integers(-4, 4).map(float), st.floats(-50, 50)), min_size=0, max_size=9)


@settings(max_examples=80, deadline=None)
@given(values_of, st.floats(-20, 20), st.integers(0, 4))
def test_w_msr_leaves_out_what_the_sorted_lists_say(present, own, F):
    swarm = Swarm("containment", len(present), F=F)
    trust, values = swarm.hear([[value, 0.5] for value in present], [own, 0.5])
    expected = reduced(np.array(present) - own, 0.0, F)
    assert np.array_equal(trust[:, 0] == 1.0, expected)
    assert np.array_equal(trust[:, 1], trust[:, 0])  # the rate goes with its value
    assert np.array_equal(values[:, 0], present)


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_what_w_msr_leaves_is_vouched_for_by_somebody_honest(data):
    """Whatever F liars tell, all that stays lies within the hull of honest values and the own one."""
    F = data.draw(st.integers(1, 3))
    honest = data.draw(st.lists(st.floats(-10, 10), min_size=0, max_size=7))
    lies = data.draw(st.lists(st.floats(-1e6, 1e6), min_size=F, max_size=F))
    own = data.draw(st.floats(-10, 10))
    told = data.draw(st.permutations(honest + lies))
    trust, _ = Swarm("containment", len(told), F=F).hear([[value, 0.0] for value in told], [own, 0.0])
    for value, left in zip(told, trust[:, 0], strict=True):
        # A distance from the own value is rounded; so is what is left out by it.
        assert left == 0.0 or min([*honest, own]) - 1e-9 <= value <= max([*honest, own]) + 1e-9
    _, clipped = Swarm("containment", len(told), hull=F).hear([[value, 0.0] for value in told], [own, 0.0])
    assert clipped[:, 0].min() >= min([*honest, own]) - 1e-9
    assert clipped[:, 0].max() <= max([*honest, own]) + 1e-9


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-40, 40), min_size=1, max_size=8), st.floats(-20, 20), st.integers(1, 3))
def test_the_hull_reaches_from_the_next_after_the_f_smallest_to_that_before_the_f_largest(present, own, F):
    _, values = Swarm("containment", len(present), hull=F).hear([[value, 0.0] for value in present], [own, 0.0])
    ordered = sorted(present)
    low = min([own, *([ordered[F]] if len(ordered) > F else [])])
    high = max([own, *([ordered[-1 - F]] if len(ordered) > F else [])])
    assert values[:, 0] == pytest.approx(np.clip(present, low, high), abs=1e-9)


def test_values_are_compared_at_present_as_the_law_carries_them():
    """At 5 m/s a record of 0.4 s ago is 2 m behind."""
    swarm = Swarm("containment", 3, F=1)
    trust, _ = swarm.hear([[99.0, 5.0], [100.5, 0.0], [100.2, 0.0]], [100.0, 0.0], age=[0.4, 0.0, 0.0])
    assert trust[:, 0].tolist() == [0.0, 1.0, 1.0]
    trust, _ = Swarm("containment", 3, F=1, horizon=0.1).hear(
        [[99.0, 5.0], [100.5, 0.0], [100.2, 0.0]], [100.0, 0.0], age=[0.4, 0.0, 0.0]
    )
    assert trust[:, 0].tolist() == [0.0, 0.0, 1.0]  # 99.5 m, the only one below, and 100.5 m


def test_a_law_that_holds_values_has_them_compared_as_they_were_told():
    rows = [[1.0] * 3 + [50.0] * 3 + [0.0] * 3, [2.0] * 3 + [0.0] * 6, [-1.0] * 3 + [0.0] * 6]
    trust, _ = Swarm("fire_monitoring", 3, F=1).hear(rows, [0.0] * 9, age=[0.5] * 3)
    assert trust[:, 0].tolist() == [1.0, 0.0, 0.0]


def test_components_are_left_out_one_by_one_with_their_rates():
    rows = [[9.0, 0, 0, 1, 1, 1, 2, 2, 2], [1.0, 5, 0, 1, 1, 1, 2, 2, 2], [2.0, 1, 0, 1, 1, 1, 2, 2, 2]]
    trust, _ = Swarm("fire_monitoring", 3, F=1).hear(rows, [0.0] * 9)
    assert trust[0].tolist() == [0, 1, 1] * 3
    assert trust[1].tolist() == [1, 0, 1] * 3
    assert trust[2].tolist() == [1] * 9


def test_angles_are_compared_the_shorter_way_around():
    """3.1 rad is above -3.1 rad by 0.08 rad, not below the own value by 6.2 rad."""
    near = [[-3.1, 0, 0, 0, 0, 0], [3.0, 0, 0, 0, 0, 0], [3.05, 0, 0, 0, 0, 0]]
    trust, _ = Swarm("attitude_synchronization", 3, F=1).hear(near, [3.1, 0, 0, 0, 0, 0])
    assert trust[:, 0].tolist() == [0.0, 0.0, 1.0]  # the only one above; the lowest below


def test_who_has_not_been_heard_is_neither_counted_nor_doubted():
    trust, _ = Swarm("containment", 3, F=1).hear([[0, 0], [5, 0], [6, 0]], [1.0, 0.0], valid=[0, 1, 1])
    assert trust[:, 0].tolist() == [1.0, 1.0, 0.0]


def test_trusted_neighbours_are_never_left_out_and_do_not_use_up_f():
    swarm = Swarm("containment", 3, leaders=[2], trusted=[2], F=1)
    trust, _ = swarm.hear([[900.0, 0, 30, 0], [50, 0, 0, 0], [40, 0, 0, 0]], [0.0, 0.0])
    assert trust[:, 0].tolist() == [1.0, 0.0, 1.0]
    _, values = Swarm("containment", 2, leaders=[2], trusted=[2], hull=1).hear([[9.0, 0, 0, 0], [50, 0, 0, 0]], [0, 0])
    assert values[:, 0].tolist() == [9.0, 9.0]  # up to what the trusted one vouches for


def test_a_leaders_speed_stands_in_no_followers_record_and_is_left_alone():
    swarm = Swarm("containment", 2, leaders=[2], F=1)
    trust, _ = swarm.hear([[5.0, 0, 99.0, 0], [4.0, 0, 0, 0]], [0.0, 0.0])
    assert trust[0].tolist() == [0.0, 0.0, 1.0, 1.0]


def test_a_clipped_rate_does_not_carry_the_value_out_of_the_hull_again():
    swarm = Swarm("containment", 3, hull=1)
    _, values = swarm.hear([[0.0, 40.0], [0.1, 1.0], [0.2, 0.0]], [0.0, 0.0], age=[0.5] * 3)
    present = values[:, 0] + values[:, 1] * 0.5
    assert values[:, 1].tolist() == [1.0, 1.0, 0.0]
    assert present == pytest.approx([0.6, 0.6, 0.2])


def test_a_record_must_explain_its_change_by_its_rates():
    assert not is_lie(1.0, 11.0, 9.0, 0.1, 0.5, 0.0, 1)
    assert is_lie(1.6, 11.0, 9.0, 0.1, 0.5, 0.0, 1)  # 1 m and (1 + 0.1) 0.5 m
    assert is_lie(0.0, 31.0, 31.0, 0.1, 0.0, 30.0, 1)  # faster than an aircraft is
    assert not is_lie(3.4, 0.0, 0.0, 0.1, 0.4, 30.0, 0)  # without a rate: up to the fastest
    assert is_lie(3.5, 0.0, 0.0, 0.1, 0.4, 30.0, 0)
    assert not is_lie(1e9, 1e9, 0.0, 0.1, 0.0, 0.0, 1)  # all off


def test_credit_falls_with_surprise_and_recovers():
    assert surprise(2.0, 10.0, 0.1, 0.5, 0.5, 0.0) == pytest.approx(2.0)
    assert surprise(2.0, 10.0, 0.1, -6.0, 0.5, 2.0) == pytest.approx(3.0)
    assert surprise(2.0, 10.0, 0.1, 9.0, 0.0, 0.0) == 0.0
    assert credit_left(1.0, 0.99, 0.1, 20.0) == 1.0
    assert credit_left(0.5, 0.0, 2.0, 20.0) == pytest.approx(0.55)
    assert credit_left(0.5, 4.0, 2.0, 20.0) == pytest.approx(0.1375)


def fly(swarm: Swarm, told, seconds: float, own=lambda t: (0.0, 0.0)):
    """Records at 10 Hz from each function of time in ``told``; trust in the first column at the end of each record."""
    history = []
    for n in range(round(seconds / DT)):
        t = n * DT
        at = math.floor(t / 0.1 + 1e-9) * 0.1
        trust, _ = swarm.hear([one(at) for one in told], own(t), t=t, age=[t - at] * len(told))
        history.append((t, *trust[:, 0]))
    return np.array(history)


def test_a_neighbour_whose_values_jump_has_no_say_for_a_while_and_this_is_an_event():
    swarm = Swarm("containment", 2, jump=1.0, ban=3.0, memory=0.5)
    history = fly(swarm, [lambda t: (t * 2.0, 2.0), lambda t: (50.0 * (t >= 1.0), 0.0)], 8.0)
    assert (history[:, 1] == 1.0).all()
    silenced = history[history[:, 2] == 0.0, 0]
    assert (silenced[0], silenced[-1]) == pytest.approx((1.0, 4.0 - DT))
    (begun, severity, text), (ended, calm, again) = swarm.told_events()
    assert (severity, text) == ("warning", "distrusts UAV 3: it contradicts itself, or what an aircraft can do")
    assert (calm, again) == ("info", "trusts UAV 3 again")
    # The standing falls to 0.2 after 0.5 s ln 5, and rises from nearly 0 to 0.6 after 0.5 s ln 2.5.
    assert (begun, ended) == pytest.approx((1.0 + 0.5 * math.log(5.0), 4.0 + 0.5 * math.log(2.5)), abs=0.05)


def test_a_neighbour_off_the_crowd_loses_its_credit_and_gets_it_back_slowly():
    told = [lambda t: (0.0, 0.0), lambda t: (1.0, 0.0), lambda t: (9.0 * (2.0 <= t < 4.0), 0.0)]
    history = fly(Swarm("containment", 3, crowd=3.0, recovery=5.0), told, 12.0)
    at = {round(t, 2): trust for t, *trust in history.tolist()}
    assert at[1.9] == [1.0, 1.0, 1.0]
    assert at[3.9] == [1.0, 1.0, 0.0]
    # A surprise of about 3 a record leaves it its least credit, 0.01, and from there it recovers.
    assert at[8.98][2] == pytest.approx(1.0 - 0.99 * (1.0 - 0.1 / 5.0) ** 50, abs=0.02)


def test_a_ban_needs_new_records_and_an_old_one_is_left_out_by_its_age():
    swarm = Swarm("containment", 2, oldest=0.5)
    assert swarm.hear([[1.0, 0.0], [2.0, 0.0]], [0, 0], age=[0.4, 0.6])[0][:, 0].tolist() == [1.0, 0.0]


def test_an_old_neighbour_does_not_use_up_f():
    swarm = Swarm("containment", 3, F=1, oldest=0.5)
    trust, _ = swarm.hear([[9.0, 0.0], [8.0, 0.0], [7.0, 0.0]], [0, 0], age=[0.6, 0.1, 0.1])
    assert trust[:, 0].tolist() == [0.0, 0.0, 1.0]


def test_before_it_has_an_own_value_nothing_is_compared():
    swarm = Swarm("containment", 2, F=1)
    d = swarm.defence
    values, stamp = np.array([[9.0, 0, 0, 0], [8, 0, 0, 0]]), np.zeros(2, np.int64)
    defend(d, 0, 2, values, np.zeros(2), np.ones(2), stamp, np.zeros(4), swarm.events, 0.0, DT)
    assert (d.heard[TRUST] == 1.0).all()


def test_columns_say_which_values_have_rates():
    table = columns_of(find("fire_monitoring"), 9)
    assert table[0, :, 1].tolist() == [3, 4, 5, 6, 7, 8, -1, -1, -1]
    assert table[0, :, 2].tolist() == [-1, -1, -1, 0, 1, 2, 3, 4, 5]
    assert (table[1, :, 2] == -2).all()


@pytest.mark.parametrize(
    ("given_gains", "text"),
    [({"F": 1.5}, "F = 1.5: must be a whole number"), ({"f": 1}, "no setting f"), ({"ban": 0.0}, "ban = 0")],
)
def test_settings_out_of_range_are_refused(given_gains, text):
    with pytest.raises(ValueError, match=text):
        defence_gains(given_gains)
