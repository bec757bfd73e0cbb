"""A UAV's own attitude reference: commands in time through the filter (7.65)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ftcc.airside.flight_path import Own
from ftcc.airside.references.attitude import Command, Filter, Reference, command_from_ground, refer
from ftcc.link.mavlink import dialect
from ftcc.link.rotation import body_attitude

STEP_US = 500


def flown(commands: list[Command], seconds: float, damping: float = 0.3, period_us: int = 5000) -> np.ndarray:
    """Rows of the reference at every tick, (n, 6)."""
    row = np.array([*commands[0][1:], 0.0, 0.0, 0.0])
    parameters, table = np.array(Filter(0.9, damping, STEP_US)), np.array(commands)
    rows = []
    for tick in range(round(seconds * 1e6 / period_us) + 1):
        refer(parameters, table, row, tick * period_us, period_us)
        rows.append(row.copy())
    return np.array(rows)


STEP = [Command(0.0, 0.0, 0.03, 0.0), Command(2.0, 0.17, 0.14, -0.1)]


def test_the_filter_answers_a_step_as_the_exact_second_order_system() -> None:
    t = np.arange(0.0, 8.0 + 1e-9, 0.005)
    w, damping = 0.9, 0.3
    since = np.maximum(t - 2.0, 0.0)
    damped = w * math.sqrt(1.0 - damping**2)
    decay = np.exp(-damping * w * since)
    answer = 1.0 - decay * (np.cos(damped * since) + damping * w / damped * np.sin(damped * since))
    rate = decay * w * w / damped * np.sin(damped * since)
    rows = flown(STEP, 8.0)
    for axis in range(3):
        start, end = STEP[0][1 + axis], STEP[1][1 + axis]
        # Semi-implicit Euler: an error of first order in the step of 0.5 ms.
        np.testing.assert_allclose(rows[:, axis], start + (end - start) * answer, atol=5e-4 * abs(end - start) + 1e-12)
        np.testing.assert_allclose(rows[:, 3 + axis], (end - start) * rate, atol=5e-4 * abs(end - start) + 1e-12)


def test_references_overshoot_as_tabulated() -> None:
    """Reference: the commands of UAV 1 in chapter 7 give peaks of 13.72 deg (bank) and 10.23 deg (alpha) at 5.66 s."""
    rows = np.degrees(
        flown([Command(0.0, 0.0, math.radians(2), 0.0), Command(2.0, math.radians(10), math.radians(8), 0.0)], 10.0)
    )
    assert abs(rows[:, 0].max() - 13.72) < 0.005
    assert abs(rows[:, 1].max() - 10.23) < 0.005
    assert abs(rows[:, 0].argmax() * 0.005 - 5.66) < 0.01


def test_the_control_period_does_not_change_the_reference() -> None:
    np.testing.assert_array_equal(flown(STEP, 4.0)[::4], flown(STEP, 4.0, period_us=20_000))


def test_a_command_within_a_tick_acts_from_its_own_plant_step_on() -> None:
    late = [STEP[0], Command(0.0125, 0.17, 0.14, -0.1)]
    np.testing.assert_array_equal(flown(late, 0.02)[3], flown(late, 0.02, period_us=STEP_US)[30])


def test_a_row_at_the_end_overrules_the_mission_once_its_time_has_come() -> None:
    free = Command(math.inf, 0.0, 0.0, 0.0)
    np.testing.assert_array_equal(flown([*STEP, free], 4.0), flown(STEP, 4.0))
    ground = Command(1.0, -0.1, 0.05, 0.0)
    overruled = flown([*STEP, ground], 20.0)
    assert abs(overruled[-1, 0] + 0.1) < 2e-3
    assert Reference(*overruled[-1]).beta == 0.0


IGNORE = dialect.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE


def asked(q: tuple[float, ...], mask: int = 0b111, gamma: float = 0.2, chi: float = -2.0) -> tuple[Command | None, str]:
    """What a UAV on a path makes of a SET_ATTITUDE_TARGET."""
    own = np.array(Own(**dict.fromkeys(Own._fields, 0.0) | {"V": 30.0, "gamma": gamma, "chi": chi}))
    message = dialect.MAVLink_set_attitude_target_message(0, 1, 1, mask, list(q), 0.0, 0.0, 0.0, 0.0)
    return command_from_ground(message, own, 2_500_000)


@pytest.mark.parametrize("wanted", [(0.0, 0.05, 0.0), (0.5, 0.1, -0.1), (-1.0, -0.1, 0.2)])
def test_a_target_from_the_ground_is_taken_apart_along_the_present_path(wanted: tuple[float, float, float]) -> None:
    row, why = asked(body_attitude(-2.0, 0.2, *wanted))
    assert why == ""
    assert row == pytest.approx((2.5, *wanted))


@pytest.mark.parametrize(
    ("q", "mask", "because"),
    [
        (body_attitude(-2.0, 0.2, 0.0, 0.35, 0.0), 0b111, "0, 20, 0 deg: outside the envelope"),
        (body_attitude(-2.0, 0.2, 1.2, 0.05, 0.0), 0b111, "69, 3, 0 deg: outside the envelope"),
        ((0.9, 0.0, 0.0, 0.0), 0b111, "no unit quaternion"),
        ((math.nan, 0.0, 0.0, 0.0), 0b111, "no unit quaternion"),
        ((0.0, 0.0, 0.0, 0.0), 0b111, "no unit quaternion"),
        ((1.0, 0.0, 0.0, 0.0), 0b111 | IGNORE, "without an attitude"),
    ],
)
def test_targets_that_cannot_be_flown_are_refused(q: tuple[float, ...], mask: int, because: str) -> None:
    row, why = asked(q, mask)
    assert row is None
    assert because in why
