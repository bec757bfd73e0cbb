"""The leaders' profiles against their closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from ftcc.airside.references.profiles import (
    CLAMPED,
    Command,
    Cosine,
    Profile,
    SpeedWave,
    Trigger,
    armed,
    climb_range,
    new_profile_state,
    profile_arrays,
    refer,
    sampled,
    trigger_rows,
)
from ftcc.airside.scheme import Reference
from tests.support.swarm import profile

X, V, V_DOT, Z, Z_DOT, Z_DDOT, X_DOT = (
    Reference._fields.index(name) for name in ("x", "V", "V_dot", "z", "z_dot", "z_ddot", "x_dot")
)


def motion(of: Profile, duration: float, period: float = 0.01) -> tuple[np.ndarray, np.ndarray]:
    """Times and `Reference` rows of a profile."""
    rows = sampled({7: of}, duration, period)[7]
    return np.arange(len(rows)) * period, rows


def step_5_54(s: float) -> float:
    """(5.54): 100 m up through the filter with w = 0.05 rad/s and damping 0.9, s seconds after the command."""
    if s < 0.0:
        return 1000.0
    w, xi = 0.05, 0.9
    wd = w * math.sqrt(1.0 - xi * xi)
    return 1000.0 + 100.0 * (1.0 - math.exp(-xi * w * s) * (math.cos(wd * s) + (xi * w / wd) * math.sin(wd * s)))


def rate_5_54(s: float) -> float:
    w, xi = 0.05, 0.9
    wd = w * math.sqrt(1.0 - xi * xi)
    return 100.0 * w * w / wd * math.exp(-xi * w * s) * math.sin(wd * s) if s > 0.0 else 0.0


@pytest.mark.parametrize("period", [0.001, 0.005, 0.01, 0.05])
def test_filtered_step_is_the_closed_form_of_5_54_at_every_tick_whatever_the_rate(period):
    t, rows = motion(Profile(0.0, 1000.0, 30.0, (Command(15.0, 1100.0, 30.0),)), 60.0, period)
    assert rows[:, Z] == pytest.approx([step_5_54(s) for s in t - 15.0], rel=1e-11)
    assert rows[:, Z_DOT] == pytest.approx([rate_5_54(s) for s in t - 15.0], abs=1e-9)


def test_acceleration_is_that_of_the_filter():
    t, rows = motion(Profile(0.0, 1000.0, 30.0, (Command(15.0, 1100.0, 30.0),)), 60.0)
    differenced = (rows[2:, Z] - 2.0 * rows[1:-1, Z] + rows[:-2, Z]) / 0.01**2
    apart = np.abs(t[1:-1] - 15.0) > 0.05
    assert rows[1:-1, Z_DDOT][apart] == pytest.approx(differenced[apart], abs=1e-5)
    assert rows[t == 15.0, Z_DDOT] == pytest.approx(0.05**2 * 100.0)


def test_cosine_joins_with_equal_value_and_slope():
    """(5.55): 60 cos(0.02 (t - 150)) - 60 from t = 150 s on, nothing before."""
    t, rows = motion(profile(8), 250.0)
    since = np.maximum(t - 150.0, 0.0)
    assert rows[:, Z] == pytest.approx(1000.0 + 60.0 * (np.cos(0.02 * since) - 1.0), abs=1e-9)
    assert rows[:, Z_DOT] == pytest.approx(-1.2 * np.sin(0.02 * since), abs=1e-12)
    assert rows[:, Z_DDOT] == pytest.approx(np.where(t >= 150.0, -0.024 * np.cos(0.02 * since), 0.0), abs=1e-12)


def test_leader_7_stands_where_the_monograph_has_it():
    """Reference: 1099.53 m at 125 s; the largest climb rate of the scenario is 1.970 m/s."""
    t, rows = motion(profile(7), 400.0)
    assert rows[np.argmin(np.abs(t - 125.0)), Z] == pytest.approx(1099.53, abs=0.005)
    assert max(map(max, climb_range({7: profile(7), 8: profile(8)}, 400.0).values())) == pytest.approx(1.970, abs=5e-4)


def test_forward_distance_is_the_integral_of_the_forward_speed():
    """Airspeed along the climbing path: x' = sqrt(V^2 - z'^2)."""
    t, rows = motion(Profile(5.0, 1000.0, 30.0, (Command(15.0, 1100.0, 30.0),)), 80.0)
    exact, _ = quad(lambda s: math.sqrt(30.0**2 - rate_5_54(s - 15.0) ** 2), 0.0, 80.0, points=[15.0], epsabs=1e-10)
    assert rows[-1, X] == pytest.approx(5.0 + exact, abs=1e-5)
    assert rows[:, X_DOT] ** 2 + rows[:, Z_DOT] ** 2 == pytest.approx(rows[:, V] ** 2)
    assert rows[t <= 15.0, X] == pytest.approx(5.0 + 30.0 * t[t <= 15.0])


def test_speed_goes_through_its_own_filter():
    rows = motion(Profile(0.0, 1000.0, 30.0, (Command(0.0, 1000.0, 34.0),), speed_filter=(0.5, 1.0)), 20.0)[1]
    t = np.arange(len(rows)) * 0.01
    assert rows[:, V] == pytest.approx(34.0 - 4.0 * np.exp(-0.5 * t) * (1.0 + 0.5 * t), rel=1e-10)
    assert rows[:, V_DOT] == pytest.approx(4.0 * 0.25 * t * np.exp(-0.5 * t), abs=1e-10)
    assert rows[:, Z] == pytest.approx(1000.0, abs=0.0)


def test_forward_speeds_may_be_commanded_instead_of_airspeeds():
    rows = motion(Profile(0.0, 1000.0, 30.0, (Command(1.0, 1050.0, 30.0),), forward=True), 40.0)[1]
    assert rows[:, X_DOT] == pytest.approx(30.0, abs=0.0)
    assert rows[:, V] == pytest.approx(np.sqrt(900.0 + rows[:, Z_DOT] ** 2))
    assert rows[-1, X] == pytest.approx(1200.0)


def test_a_wave_of_speed():
    t, rows = motion(Profile(0.0, 1000.0, 30.0, speed_wave=SpeedWave(2.0, 0.3)), 30.0)
    assert rows[:, V] == pytest.approx(30.0 + 2.0 * np.sin(0.3 * t))
    assert rows[:, V_DOT] == pytest.approx(0.6 * np.cos(0.3 * t))
    assert rows[:, X] == pytest.approx(30.0 * t + 2.0 / 0.3 * (1.0 - np.cos(0.3 * t)), abs=1e-4)


def test_commands_follow_each_other():
    """The second step begins with the height and climb that the first has reached."""
    profile_ = Profile(0.0, 1000.0, 30.0, (Command(5.0, 1100.0, 30.0), Command(20.0, 1000.0, 30.0)))
    t, rows = motion(profile_, 300.0)
    first = t <= 20.0
    assert rows[first, Z] == pytest.approx([step_5_54(s) for s in t[first] - 5.0])
    assert abs(np.diff(rows[:, Z_DOT])).max() < 0.01
    assert rows[-1, Z] == pytest.approx(1000.0, abs=0.01)


def test_climb_is_held_at_its_limit_and_the_height_still_reached():
    t, rows = motion(Profile(0.0, 1000.0, 30.0, (Command(5.0, 1100.0, 30.0),), climb_limit=1.0, sink_limit=1.0), 400.0)
    assert np.abs(rows[:, Z_DOT]).max() == 1.0
    assert rows[-1, Z] == pytest.approx(1100.0, abs=0.01)
    held = (t[1:] > 30.0) & (rows[1:, Z_DOT] == 1.0)
    assert held.sum() > 100
    assert np.diff(rows[:, Z])[held] == pytest.approx(0.01)


def test_climbs_and_descents_have_limits_of_their_own():
    there_and_back = (Command(0.0, 1100.0, 30.0), Command(200.0, 1000.0, 30.0))
    rows = motion(Profile(0.0, 1000.0, 30.0, there_and_back, climb_limit=1.5, sink_limit=0.75), 600.0)[1]
    assert (rows[:, Z_DOT].max(), rows[:, Z_DOT].min()) == (1.5, -0.75)
    assert rows[-1, Z] == pytest.approx(1000.0, abs=0.01)


def test_the_limit_counts_the_cosine_too():
    climb, sinking = (Command(0.0, 1100.0, 30.0),), Cosine(0.0, 60.0, 0.02)
    rows = motion(Profile(0.0, 1000.0, 30.0, climb, cosine=sinking, climb_limit=1.0, sink_limit=1.0), 200.0)[1]
    assert np.abs(rows[:, Z_DOT]).max() <= 1.0 + 1e-12


def test_a_clamped_climb_is_reported():
    steep = Profile(0.0, 1000.0, 30.0, (Command(0.0, 1100.0, 30.0),), climb_limit=1.0, sink_limit=1.0)
    arrays, triggers = profile_arrays(steep, 0.1), trigger_rows(steep, 7, [])
    state, reference, clamped = new_profile_state(steep), np.zeros(len(Reference._fields)), []
    for k in range(4000):
        refer(*arrays, triggers, state, reference, math.nan, k * 100_000, 100_000)
        clamped.append(state[CLAMPED])
    assert clamped[0] == clamped[-1] == 0.0
    assert 1.0 in clamped


# Commands by position.


def test_a_leader_climbs_when_it_has_passed_the_place_itself():
    rows = motion(Profile(0.0, 1000.0, 30.0, triggers=(Trigger(7, 300.0, 1050.0, 30.0),)), 60.0)[1]
    t = np.arange(len(rows)) * 0.01
    climb = [1000.0 + 0.5 * (step_5_54(s) - 1000.0) for s in t - 10.0]
    assert rows[:, Z] == pytest.approx(climb, rel=1e-9)


def test_a_leader_climbs_when_another_has_passed_the_place():
    ahead = Profile(200.0, 1000.0, 30.0)
    behind = Profile(0.0, 1000.0, 30.0, triggers=(Trigger(7, 500.0, 1050.0, 30.0),))
    rows = sampled({7: ahead, 8: behind}, 30.0, 0.01)[8]
    begun = int(np.argmax(rows[:, Z_DDOT] > 0.0))
    assert begun * 0.01 == pytest.approx(10.0, abs=0.0101)


def test_triggers_fire_one_after_the_other_and_supersede_commands_by_time():
    triggers = (Trigger(7, 150.0, 1050.0, 30.0), Trigger(7, 60.0, 1020.0, 30.0))
    rows = motion(Profile(0.0, 1000.0, 30.0, (Command(20.0, 1500.0, 30.0),), triggers=triggers), 200.0)[1]
    assert rows[-1, Z] == pytest.approx(1020.0, abs=0.1)
    assert rows[:, Z].max() < 1021.0


def test_what_a_trigger_waits_for():
    own = Profile(0.0, 1000.0, 30.0, triggers=(Trigger(7, 1.0, 1010.0, 30.0), Trigger(8, 2.0, 1000.0, 30.0)))
    rows, state = trigger_rows(own, 7, [9, 8]), new_profile_state(own)
    waiting = []
    for fired in range(3):
        state[5] = fired
        waiting.append(armed(rows, state))
    assert waiting == [-1, 1, -2]


def test_a_leader_that_is_not_heard_cannot_be_waited_for():
    with pytest.raises(ValueError, match="waits for UAV 8 to pass x = 500 m, but there is no edge 8 -> 7"):
        trigger_rows(Profile(0.0, 1000.0, 30.0, triggers=(Trigger(8, 500.0, 1050.0, 30.0),)), 7, [])
