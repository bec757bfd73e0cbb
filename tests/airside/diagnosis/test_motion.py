"""What the nominal model says of each actuator, against the true equations of motion of the same aircraft."""

from __future__ import annotations

import numpy as np
import pytest

from ftcc.airside.diagnosis.gains import diagnosis_gains
from ftcc.airside.diagnosis.motion import Motion, aircraft_motion, kinematic_slips, point_motion
from ftcc.airside.flight_path import Own
from ftcc.groundside.scenario.loading import load
from ftcc.groundside.scenario.mission import resolve
from ftcc.link.actuators import AILERON, ELEVATOR, RUDDER, THRUST
from ftcc.sim.plants import attitude, position

DT = 0.01
GAINS = diagnosis_gains({})


def integrated(plant, state, inputs, disturbances, parameters, dt=DT, steps=20):
    """Runge-Kutta over ``dt``."""
    s, h = np.array(state), dt / steps

    def rates(values):
        return np.array(plant.rates(plant.State(*values), inputs, disturbances, parameters))

    for _ in range(steps):
        a = rates(s)
        b = rates(s + h / 2 * a)
        c = rates(s + h / 2 * b)
        s = s + h / 6 * (a + 2 * b + 2 * c + rates(s + h * c))
    return plant.State(*s)


def seen(s, **more) -> Own:
    known = {name: getattr(s, name) for name in s._fields if name in Own._fields}
    blank = dict.fromkeys(Own._fields, 0.0)
    return Own(**(blank | known | more))


@pytest.fixture(scope="module")
def aircraft():
    mission = resolve(load("attitude_synchronization", settings=["plant.coefficients={}"]))
    return mission.autopilots[0].model, attitude.Parameters(*mission.vehicles[0].airframe)


def residuals(aircraft, inputs, believed=None, **disturbed):
    """Per actuator what it did less what was ``believed``, and the unexplained turn of the path, in units and rad/s."""
    model, parameters = aircraft
    before = attitude.State(0.0, 0.0, 1000.0, 27.0, 0.1, -0.05, 0.2, 0.06, 0.03, 0.1, -0.08, 0.05)
    calm = attitude.Disturbances(*(0.0,) * len(attitude.Disturbances._fields))
    after = integrated(attitude, before, inputs, calm._replace(**disturbed), parameters)
    out = np.zeros((4, len(Motion._fields)))
    positions = np.array(inputs if believed is None else believed)
    turn = aircraft_motion(seen(after), seen(before), positions, model, GAINS, DT, 1, out)
    rows = [Motion(*row) for row in out]
    left = [row.step / DT - row.drift - position for row, position in zip(rows, positions, strict=True)]
    return np.array(left), turn / DT, rows


def test_a_healthy_aircraft_leaves_nothing_unexplained(aircraft):
    inputs = attitude.Inputs(0.02, -0.15, -0.03, 25.0)
    left, turn, _ = residuals(aircraft, inputs)
    # The control-oriented model neglects nothing here but the curvature within a tick.
    assert np.abs(left[[AILERON, ELEVATOR, RUDDER]]).max() < 2e-3
    assert abs(left[THRUST]) < 0.1
    assert abs(turn) < 2e-3


@pytest.mark.parametrize("slot", [AILERON, ELEVATOR, RUDDER, THRUST])
def test_what_an_actuator_does_beside_its_command_is_seen_in_its_own_equation_alone(aircraft, slot):
    inputs = np.array([0.02, -0.15, -0.03, 25.0])
    size = 10.0 if slot == THRUST else 0.1
    wrong = inputs.copy()
    wrong[slot] += size
    left, turn, rows = residuals(aircraft, attitude.Inputs(*wrong), inputs)
    healthy, still, _ = residuals(aircraft, attitude.Inputs(*inputs))
    found = left - healthy
    assert found[slot] == pytest.approx(size, rel=0.02)
    others = [n for n in (AILERON, ELEVATOR, RUDDER) if n != slot]
    assert np.abs(found[others]).max() < 0.005
    if slot == ELEVATOR:
        assert turn - still == pytest.approx(rows[slot].lift * size, rel=0.05)


def test_moving_air_is_seen_in_the_flight_path_and_cancelled_by_it(aircraft):
    inputs = attitude.Inputs(0.0, -0.15, 0.0, 25.0)
    healthy, still, _ = residuals(aircraft, inputs)
    left, turn, rows = residuals(aircraft, inputs, wind_up=1.0)
    found, bent = left - healthy, turn - still
    assert abs(found[ELEVATOR]) > 0.05, "a gust of 1 m/s looks like a bias of the elevator"
    assert abs(found[ELEVATOR] - rows[ELEVATOR].air * bent) < 0.2 * abs(found[ELEVATOR])
    # The tilt of the lift is counted, the change of airspeed is not.
    assert abs(found[THRUST] - rows[THRUST].air * bent) < 0.5 * abs(found[THRUST])


def test_kinematics_hold_whatever_the_forces_are(aircraft):
    _, parameters = aircraft
    before = attitude.State(0.0, 0.0, 1000.0, 27.0, 0.1, -0.05, 0.2, 0.06, 0.03, 0.1, -0.08, 0.05)
    wild = attitude.Disturbances(2.0, 0.3, 1.0, wind_up=2.0, wind_right=1.0)
    after = integrated(attitude, before, attitude.Inputs(0.1, 0.2, -0.2, 40.0), wild, parameters)
    assert np.abs(kinematic_slips(seen(after), seen(before), DT)).max() < 2e-4
    tilted = seen(after)._replace(alpha=after.alpha + 0.02)
    assert kinematic_slips(tilted, seen(before), DT)[1] == pytest.approx(0.02, abs=3e-4)
    gyro = seen(after)._replace(p=after.p + 0.2)
    assert abs(kinematic_slips(gyro, seen(before), DT)[0]) == pytest.approx(DT * 0.1, rel=0.1)


def test_a_point_mass_is_explained_by_thrust_load_factor_and_bank():
    mission = resolve(load("fire_monitoring"))
    model, parameters = mission.autopilots[0].model, position.Parameters(*mission.vehicles[0].airframe)
    before = position.State(0.0, 0.0, 100.0, 45.0, 10.0, 2.0)
    calm = position.Disturbances(*(0.0,) * len(position.Disturbances._fields))
    inputs = position.Inputs(0.3, 1.2, 0.0, 60.0)
    after = integrated(position, before, inputs, calm, parameters)

    def own(s):
        ground = np.hypot(s.vx, s.vy)
        return Own(**dict.fromkeys(Own._fields, 0.0))._replace(
            V=np.hypot(ground, s.vz), gamma=np.arctan2(s.vz, ground), chi=np.arctan2(s.vy, s.vx), mu=0.3
        )

    out = np.zeros((4, len(Motion._fields)))
    assert point_motion(own(after), own(before), np.array(inputs), model, GAINS, DT, 0.0, out) == 0.0
    thrust, load_factor, bank = (Motion(*out[slot]) for slot in (THRUST, ELEVATOR, AILERON))
    assert load_factor.step / DT - load_factor.drift == pytest.approx(1.2, abs=2e-3)
    assert bank.step / DT == pytest.approx(0.3, abs=1e-9)
    # The law's drag polar is not the plant's (9.32): a few newtons.
    assert thrust.step / DT - thrust.drift == pytest.approx(60.0, abs=8.0)
