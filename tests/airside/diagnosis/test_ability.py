"""What an aircraft can hold, against the trim of the true equations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ftcc.airside.autopilots import build
from ftcc.airside.diagnosis.ability import end_of, level_alpha, level_speed
from ftcc.airside.diagnosis.arrays import Trial
from ftcc.airside.diagnosis.beliefs import FAULTY, LOSS, SENSOR, UNDETERMINED, WRONG, Belief
from ftcc.airside.diagnosis.estimator import RHO, B
from ftcc.airside.diagnosis.gains import diagnosis_gains
from ftcc.airside.spec import DiagnosisSpec
from ftcc.link.actuators import ELEVATOR, THRUST
from ftcc.link.compiled import width
from ftcc.sim.trim import trim as level_trim
from tests.support.swarm import AIRFRAME, autopilot, nominal, timing

MODEL = nominal()


def believing(slot: int | None = None, **changes: Any) -> Any:
    """The arrays of a UAV that believes this of one actuator."""
    on = DiagnosisSpec(on=True, gains=tuple(diagnosis_gains({})), actuators=("thrust", "elevator"))
    autopilots, _ = build([autopilot(1, diagnosis=on)], timing("flight", 1.0))
    d = autopilots.diagnosis
    if slot is not None:
        belief = Belief(*d.belief[0, slot].tolist())
        d.belief[0, slot] = belief._replace(**{"state": FAULTY, "kind": LOSS} | changes)
    return d


def test_a_healthy_aircraft_holds_the_wanted_speed():
    level = level_speed(believing(), 0, 30.0, MODEL)
    assert level[:2] == (30.0, 0.0)
    assert level.spare == pytest.approx((40.0 - level_trim(AIRFRAME, 30.0).thrust) * 30.0 / (25.0 * 9.8), rel=1e-2)


def test_with_less_thrust_it_holds_the_nearest_speed_that_leaves_a_reserve():
    """24 N of 40 N are left, of which 4 N shall stay unused; level flight at 30 m/s takes 21.3 N."""
    level = level_speed(believing(THRUST, effectiveness=0.6), 0, 30.0, MODEL)
    assert level.climb == 0.0
    assert level_trim(AIRFRAME, level.V).thrust <= 20.01
    assert level_trim(AIRFRAME, level.V + 0.75).thrust > 19.99


def test_where_no_speed_leaves_a_reserve_it_holds_the_one_that_takes_least():
    """20 N are left, and least is 18.7 N."""
    speeds = np.arange(18.0, 30.0, 0.25)
    best = speeds[np.argmin([level_trim(AIRFRAME, V).thrust for V in speeds])]
    level = level_speed(believing(THRUST, effectiveness=0.5), 0, 30.0, MODEL)
    assert level[:2] == (pytest.approx(best, abs=0.75), 0.0)


def test_with_too_little_thrust_it_sinks_as_slowly_as_it_can():
    level = level_speed(believing(THRUST, effectiveness=0.3), 0, 30.0, MODEL)
    needed = min(level_trim(AIRFRAME, V).thrust for V in np.arange(18.0, 30.0, 0.25))
    assert level.climb == pytest.approx((12.0 - needed) * level.V / (25.0 * 9.8), abs=0.02)
    assert level.climb < 0.0


def test_with_a_weak_elevator_it_flies_faster():
    """0.4 x (-0.7) + 0.15 rad = -0.13 rad is left, and level flight at 30 m/s takes -0.197 rad."""
    level = level_speed(believing(ELEVATOR, kind=WRONG, effectiveness=0.4, bias=0.15), 0, 30.0, MODEL)
    assert level.V > 33.0
    assert level_trim(AIRFRAME, level.V).elevator > -0.13


def test_a_sensor_fault_takes_nothing_away():
    assert level_speed(believing(THRUST, kind=SENSOR, effectiveness=0.3), 0, 30.0, MODEL).V == 30.0


def test_what_an_actuator_does_at_the_end_of_its_travel_may_be_known_while_the_fault_is_not():
    d = believing(THRUST, state=UNDETERMINED, effectiveness=0.7, bias=-2.0)
    P = d.trial[0, THRUST, width(Trial) - 16 :].reshape(4, 4)
    P[RHO, RHO], P[B, B] = 0.3**2, 12.0**2
    assert end_of(d, 0, THRUST, 40.0) == (40.0, False)
    P[RHO, B] = P[B, RHO] = -0.3 * 12.0 * 0.999
    assert end_of(d, 0, THRUST, 40.0) == (pytest.approx(0.7 * 40.0 - 2.0), True)


def test_wings_level_takes_the_trim_or_what_the_elevator_leaves():
    healthy = level_trim(AIRFRAME, 30.0).alpha
    assert level_alpha(believing(), 0, 30.0, MODEL) == pytest.approx(healthy, abs=1e-3)
    weak = level_alpha(believing(ELEVATOR, kind=WRONG, effectiveness=0.4, bias=0.15), 0, 30.0, MODEL)
    acting = 0.4 * -0.7 + 0.15 + 0.07
    assert weak == pytest.approx(-(MODEL.Cm0 + MODEL.Cmde * acting) / MODEL.Cma)
    assert weak < healthy
