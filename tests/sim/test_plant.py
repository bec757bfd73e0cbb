"""The vehicle in flight: integration, actuators, faults, disturbances, and where the model ends."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ftcc.link.actuators import ELEVATOR, THRUST
from ftcc.sim.actuation import actuate
from ftcc.sim.airframe import longitudinal_rates
from ftcc.sim.build import build_fleet
from ftcc.sim.disturbances import Disturbance
from ftcc.sim.faults import Fault
from ftcc.sim.fleet import Fleet
from ftcc.sim.plant import LOST, TRUTH, Guards
from ftcc.sim.plants import conditions_of, cycle_of
from ftcc.sim.spec import VehicleSpec
from tests.support.swarm import AIRFRAME, LEADER, TRIM, vehicle

cycle = cycle_of("longitudinal")
advance, conditions, truth = cycle.advance, cycle.conditions, cycle.truth

STEP = 1000
LAG = (0.0, 20.0, 0.0, 20.0)
COMMAND = (0.0, -0.25, 0.0, 26.0)
"""Away from the trim, so that everything moves."""


def flown(fleet: Fleet, milliseconds: int, step_us: int = STEP, period_us: int = 10_000) -> int:
    """Fly vehicle 0 from t = 0; the reason if it is lost."""
    for start in range(0, milliseconds * 1000, period_us):
        why = int(advance(fleet, 0, start, period_us, step_us))
        if why:
            return why
    return 0


def onset(since: float, rate: float) -> float:
    return 1.0 if rate == 0.0 else 1.0 - math.exp(-rate * since)


def reference(spec: VehicleSpec, command: tuple[float, ...], seconds: float) -> np.ndarray:
    """The same flight by an adaptive integrator, restarted at every step of a fault or disturbance.

    States (V, x, z, gamma, theta, q) and the positions of elevator and thrust.
    """

    def fault(actuator: int, t: float) -> tuple[float, float]:
        effectiveness, bias = 1.0, 0.0
        for f in sorted(spec.faults):
            if t >= f.time and f.actuator == actuator:
                effectiveness = 1.0 + (f.effectiveness - 1.0) * onset(t - f.time, f.effectiveness_onset)
                bias = f.bias * onset(t - f.time, f.bias_onset)
        return effectiveness, bias

    def rates(t: float, y: np.ndarray) -> list[float]:
        deflections, motion = [], []
        for actuator, position in ((ELEVATOR, y[6]), (THRUST, y[7])):
            effectiveness, bias = fault(actuator, t)
            target = min(max(command[actuator], spec.limits[actuator][0]), spec.limits[actuator][1])
            if spec.fault_before_lag:
                target, effectiveness, bias = effectiveness * target + bias, 1.0, 0.0
            if spec.lag[actuator] == 0.0:
                position = target
            deflections.append(effectiveness * position + bias)
            motion.append(spec.lag[actuator] * (target - position))
        d = [
            sum(
                e.value
                * onset(t - e.time, e.onset)
                * (math.sin(e.frequency * (t - e.time) + e.phase) if e.frequency else 1.0)
                for e in spec.disturbances
                if e.time <= t < e.until and e.channel == n
            )
            for n in range(3)
        ]
        V, _, _, gamma, theta, q = (float(value) for value in y[:6])
        plain = getattr(longitudinal_rates, "py_func", longitudinal_rates)
        return [*plain(V, gamma, theta, q, deflections[1], deflections[0], *d, AIRFRAME), *motion]

    y = np.array([*spec.initial, spec.command[ELEVATOR], spec.command[THRUST]])
    times = {e.time for e in (*spec.faults, *spec.disturbances)} | {e.until for e in spec.disturbances}
    breaks = sorted({0.0, seconds, *(t for t in times if 0.0 < t < seconds)})
    for a, b in itertools.pairwise(breaks):
        # A step at the end of a stretch belongs to the next one.
        inside = (lambda end: lambda t, y: rates(min(t, end), y))(math.nextafter(b, 0.0))
        y = solve_ivp(inside, (a, b), y, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return y


STEPS = {
    "faults": (Fault(0.5, ELEVATOR, 0.7, 0.1, 0.0, 0.0), Fault(1.2, THRUST, 0.8, 0.0, 0.0, 0.0)),
    "disturbances": tuple(Disturbance(0.8, channel, value, 0.0) for channel, value in enumerate((0.2, 0.2, 0.1))),
}
ONSETS = {
    "faults": (Fault(0.5, ELEVATOR, 0.7, 0.1, 3.0, 6.0), Fault(1.2, THRUST, 0.8, 2.0, 1.0, 4.0)),
    "disturbances": tuple(Disturbance(0.8, channel, value, 2.0) for channel, value in enumerate((0.2, 0.2, 0.1))),
}
SWINGS = {
    "faults": (Fault(0.5, ELEVATOR, 0.7, 0.1, 0.0, 0.0), Fault(1.2, ELEVATOR, 1.0, 0.0, 0.0, 0.0)),
    "disturbances": (
        Disturbance(0.3, 0, 0.5, 0.0, 1.5),
        Disturbance(0.8, 1, 0.2, 0.0, 1.7, 6.0, 0.5),
        Disturbance(0.8, 2, 0.4, 3.0, math.inf, 9.0),
    ),
}
"""What ends, and what oscillates."""


@pytest.mark.parametrize("events", [{}, STEPS, ONSETS, SWINGS], ids=["healthy", "steps", "onsets", "swings"])
@pytest.mark.parametrize("before", [False, True], ids=["after lag", "before lag"])
@pytest.mark.parametrize("lag", [(0.0,) * 4, LAG], ids=["no lag", "lag"])
def test_two_seconds_agree_with_an_adaptive_integrator(events, before, lag):
    """Fault, disturbance and lag included; exponential onsets are held over each step of 1 ms at their middle value."""
    spec = vehicle(lag=lag, fault_before_lag=before, **events)
    fleet = build_fleet([spec])
    fleet.command[0] = COMMAND
    assert flown(fleet, 2000) == 0
    tolerance = 2e-9 if events in ({}, STEPS) else 2e-6
    assert fleet.state[0] == pytest.approx(reference(spec, COMMAND, 2.0)[:6], rel=tolerance, abs=tolerance)


def test_integration_is_of_fourth_order():
    """Halving the step divides the error by sixteen."""
    spec = vehicle(initial=(30.0, 0.0, 1000.0, 0.0, 0.15, 0.5))
    exact = reference(spec, TRIM, 2.0)

    def error(step_us: int) -> float:
        fleet = build_fleet([spec])
        flown(fleet, 2000, step_us, 40_000)
        return float(np.abs(fleet.state[0] - exact[:6]).max())

    assert error(40_000) / error(20_000) == pytest.approx(16.0, rel=0.15)


def test_without_air_the_aircraft_falls_on_a_parabola():
    thrown = (20.0, 0.0, 500.0, 0.4, 0.4, 0.1)
    fleet = build_fleet([vehicle(airframe=AIRFRAME._replace(rho=0.0), command=(0.0,) * 4, initial=thrown)])
    assert flown(fleet, 1500) == 0
    V, x, z, gamma, theta, q = fleet.state[0]
    vx, vz, t, g = 20.0 * math.cos(0.4), 20.0 * math.sin(0.4), 1.5, AIRFRAME.g
    assert x == pytest.approx(vx * t, rel=1e-9)
    assert z == pytest.approx(500.0 + vz * t - 0.5 * g * t * t, rel=1e-9)
    assert (V * math.cos(gamma), V * math.sin(gamma)) == pytest.approx((vx, vz - g * t), rel=1e-9)
    assert 0.5 * V * V + g * z == pytest.approx(0.5 * 20.0**2 + g * 500.0, rel=1e-9), "energy"
    assert (theta, q) == pytest.approx((0.4 + 0.1 * t, 0.1), rel=1e-9)


def test_trimmed_aircraft_stays_where_it_is():
    fleet = build_fleet([vehicle(lag=LAG)])
    assert flown(fleet, 2000) == 0
    assert fleet.state[0, 0] == pytest.approx(30.0, abs=1e-3)
    assert fleet.state[0, 1] == pytest.approx(60.0, abs=1e-3)
    assert fleet.state[0, 2] == pytest.approx(1000.0, abs=1e-3)


# Actuators.


@pytest.mark.parametrize(("actuator", "bandwidth"), [(ELEVATOR, 20.0), (THRUST, 20.0), (ELEVATOR, 2.0)])
def test_lag_follows_its_exact_solution(actuator, bandwidth):
    """pos' = lag (command - pos), from the trim on."""
    lag = tuple(bandwidth if n == actuator else 0.0 for n in range(4))
    fleet = build_fleet([vehicle(lag=lag)])
    fleet.command[0] = COMMAND
    for k in range(20):
        t = (k + 1) * 0.01
        advance(fleet, 0, k * 10_000, 10_000, STEP)
        exact = COMMAND[actuator] + (TRIM[actuator] - COMMAND[actuator]) * math.exp(-bandwidth * t)
        assert fleet.position[0, actuator] == pytest.approx(exact, rel=1e-12)


def test_positions_start_at_the_initial_command_within_its_limits():
    assert build_fleet([vehicle()]).position[0].tolist() == list(TRIM)
    assert build_fleet([vehicle(command=(0.3, 0.9, 0.0, 55.0))]).position[0].tolist() == [0.0, 0.7, 0.0, 40.0]


@pytest.mark.parametrize("lag", [(0.0,) * 4, LAG], ids=["no lag", "lag"])
@pytest.mark.parametrize(
    ("command", "limited"),
    [((0.0, -1.5, 0.0, 60.0), (-0.7, 40.0)), ((0.0, 0.9, 0.0, -5.0), (0.7, 0.0)), ((0.0, 0.1, 0.0, 12.0), (0.1, 12.0))],
)
def test_commands_saturate_at_the_limits(lag, command, limited):
    """Table 5.1: T in [0, 40] N, elevator in [-0.7, 0.7] rad."""
    fleet = build_fleet([vehicle(lag=lag)])
    fleet.command[0] = command
    for k in range(50):
        advance(fleet, 0, k * 10_000, 10_000, STEP)
        actuate(fleet, 0, (k + 1) * 0.01)
    assert (fleet.acting[0, ELEVATOR], fleet.acting[0, THRUST]) == pytest.approx(limited, abs=2e-3 if any(lag) else 0.0)


def acting_over_time(spec: VehicleSpec, seconds: float = 1.0) -> Callable[[float], float]:
    """The elevator that acts at each tick of 10 ms under `COMMAND`."""
    fleet = build_fleet([spec])
    fleet.command[0] = COMMAND
    rows = {}
    for k in range(round(seconds * 100) + 1):
        actuate(fleet, 0, k * 0.01)
        rows[k] = float(fleet.acting[0, ELEVATOR])
        advance(fleet, 0, k * 10_000, 10_000, STEP)
    return lambda t: rows[round(t * 100)]


def test_a_fault_after_the_saturation_without_lag_acts_at_once():
    """(5.6): elevator = rho_f sat(command) + u_f, also beyond the limit of the command."""
    elevator = acting_over_time(vehicle(faults=(Fault(0.5, ELEVATOR, 0.7, 0.35, 0.0, 0.0),)))
    assert elevator(0.49) == -0.25
    assert elevator(0.5) == elevator(1.0) == pytest.approx(0.7 * -0.25 + 0.35)
    assert acting_over_time(vehicle(faults=(Fault(0.0, ELEVATOR, 1.0, -0.6, 0.0, 0.0),)))(0.5) == pytest.approx(-0.85)


def test_a_fault_after_the_lag_arrives_as_a_step():
    elevator = acting_over_time(vehicle(lag=LAG, faults=(Fault(0.5, ELEVATOR, 0.7, 0.35, 0.0, 0.0),)))
    assert elevator(0.5) - elevator(0.49) == pytest.approx(0.35 - 0.3 * -0.25, abs=1e-3)


def test_a_fault_before_the_lag_is_smoothed_by_it():
    elevator = acting_over_time(
        vehicle(lag=LAG, fault_before_lag=True, faults=(Fault(0.5, ELEVATOR, 0.7, 0.35, 0.0, 0.0),))
    )
    healthy, faulty = -0.25, 0.7 * -0.25 + 0.35
    assert elevator(0.5) == pytest.approx(healthy, abs=1e-4)
    for t in (0.55, 0.6, 0.8):
        assert elevator(t) == pytest.approx(faulty + (elevator(0.5) - faulty) * math.exp(-20.0 * (t - 0.5)), abs=1e-12)


@pytest.mark.parametrize(("loss_rate", "bias_rate"), [(5.0, 0.0), (0.0, 5.0), (2.0, 8.0)])
def test_an_exponential_onset_grows_at_its_rate(loss_rate, bias_rate):
    elevator = acting_over_time(vehicle(faults=(Fault(0.2, ELEVATOR, 0.6, 0.3, loss_rate, bias_rate),)))
    for t in (0.2, 0.3, 0.7, 1.0):
        effectiveness = 1.0 - 0.4 * onset(t - 0.2, loss_rate)
        assert elevator(t) == pytest.approx(effectiveness * -0.25 + 0.3 * onset(t - 0.2, bias_rate), abs=1e-12)


def test_the_latest_fault_of_an_actuator_counts_and_a_repair_is_one():
    spec = vehicle(
        faults=(
            Fault(0.6, ELEVATOR, 1.0, 0.0, 0.0, 0.0),
            Fault(0.2, ELEVATOR, 0.5, 0.1, 0.0, 0.0),
            Fault(0.4, THRUST, 0.9, 0.0, 0.0, 0.0),
        )
    )
    elevator = acting_over_time(spec)
    assert [elevator(t) for t in (0.1, 0.3, 0.5, 0.7)] == pytest.approx([-0.25, -0.025, -0.025, -0.25])


def test_the_conditions_of_a_vehicle_are_its_faults_and_disturbances():
    faults = (Fault(0.2, ELEVATOR, 0.5, 0.1, 0.0, 0.0), Fault(0.4, THRUST, 0.9, 0.0, 0.0, 0.0))
    fleet = build_fleet([vehicle(faults=faults, disturbances=(Disturbance(0.6, 1.0, 0.3, 0.0),))])
    names = [name for name, _ in conditions_of("longitudinal")]

    def at(time):
        found = np.zeros(len(names))
        conditions(fleet, 0, time, found)
        return {name: value for name, value in zip(names, found, strict=True) if value not in (0.0, 1.0)}

    assert at(0.1) == {}
    assert at(0.3) == {"elevator_effectiveness": 0.5, "elevator_bias": 0.1}
    assert at(0.5) == {"thrust_effectiveness": 0.9, "elevator_effectiveness": 0.5, "elevator_bias": 0.1}
    assert at(0.7)["d2"] == 0.3


def test_only_the_faulty_aircraft_feels_its_fault():
    healthy, faulty = vehicle(1), vehicle(2, faults=(Fault(0.0, ELEVATOR, 0.7, 0.35, 0.0, 0.0),))
    together, alone = build_fleet([healthy, faulty]), build_fleet([healthy])
    for start in range(0, 500_000, 10_000):
        for i in (0, 1):
            advance(together, i, start, 10_000, STEP)
        advance(alone, 0, start, 10_000, STEP)
    assert np.array_equal(together.state[0], alone.state[0])
    assert not np.array_equal(together.state[1], alone.state[0])


@pytest.mark.parametrize(("channel", "state"), [(0, 0), (1, 3), (2, 5)])
def test_a_disturbance_acts_on_its_own_equation_from_its_time_on(channel, state):
    """(5.1)-(5.5): d1 on the airspeed, d2 on the flight-path angle, d3 on the pitch rate."""
    calm, disturbed = (
        build_fleet([vehicle()]),
        build_fleet([vehicle(disturbances=(Disturbance(0.1, channel, 0.2, 0.0),))]),
    )
    flown(calm, 100)
    flown(disturbed, 100)
    assert np.array_equal(calm.state, disturbed.state)
    for fleet in (calm, disturbed):
        advance(fleet, 0, 100_000, STEP, STEP)
    difference = disturbed.state[0] - calm.state[0]
    assert difference[state] == pytest.approx(0.2 * 0.001, rel=0.02)
    others = [n for n in (0, 3, 5) if n != state]
    assert np.abs(difference[others]).max() < 0.1 * abs(difference[state])


def test_disturbances_add_up():
    one = build_fleet([vehicle(disturbances=(Disturbance(0.0, 0, 0.3, 0.0),))])
    two = build_fleet([vehicle(disturbances=(Disturbance(0.0, 0, 0.1, 0.0), Disturbance(0.0, 0, 0.2, 0.0)))])
    flown(one, 500)
    flown(two, 500)
    assert two.state == pytest.approx(one.state, rel=1e-12)


# Where the model ends.


@pytest.mark.parametrize(
    ("changes", "command", "reason"),
    [
        (
            {"initial": (30.0, 0.0, 1000.0, 1.2, 1.23, 0.0)},
            (0.0, -0.19688, 0.0, 0.0),
            "airspeed outside the model's valid range",
        ),
        (
            {"initial": (30.0, 0.0, 1000.0, 1.45, 1.45, 0.6)},
            (0.0, -0.7, 0.0, 40.0),
            "flight-path angle outside the model's valid range",
        ),
        ({"initial": (30.0, 0.0, 1000.0, 0.0, 1.45, 40.0)}, TRIM, "angle of attack outside the model's valid range"),
        ({"initial": (30.0, 0.0, 1000.0, math.nan, 0.0, 0.0)}, TRIM, "state is not a number"),
        ({"initial": (1e200, 0.0, 1000.0, 0.0, 0.03, 0.0)}, TRIM, "state is not a number"),
    ],
    ids=["stall", "dive or climb", "tumble", "nan", "overflow"],
)
def test_an_aircraft_that_leaves_its_model_is_lost_with_the_reason(changes, command, reason):
    fleet = build_fleet([vehicle(**{"guards": Guards(10.0, 1.5, 1.5, 1.4)} | changes)])
    fleet.command[0] = command
    assert LOST[flown(fleet, 20_000)] == reason


def test_whatever_is_commanded_an_aircraft_that_is_not_lost_has_a_finite_state():
    random = np.random.default_rng(4)
    ends = set()
    for _ in range(40):
        start = random.uniform([4.0, 0.0, 0.0, -1.2, -1.2, -3.0], [60.0, 0.0, 0.0, 1.2, 1.2, 3.0])
        fleet = build_fleet(
            [vehicle(initial=tuple(start), lag=LAG, faults=(Fault(0.5, ELEVATOR, 0.2, 0.5, 0.0, 0.0),))]
        )
        for k in range(600):
            if k % 20 == 0:
                fleet.command[0] = random.uniform(-1e3, 1e3, 4)
            why = int(advance(fleet, 0, k * 10_000, 10_000, STEP))
            if why:
                break
            assert np.isfinite(fleet.state).all()
        ends.add(LOST[why])
    assert len(ends) > 1, "aircraft were meant to be lost in more than one way"


# Truth.


def test_truth_is_the_state_in_the_order_of_its_names():
    fleet = build_fleet([vehicle(initial=(31.0, 5.0, 990.0, 0.1, 0.15, 0.02), offset=-20.0)])
    out = np.full(len(TRUTH), math.nan)
    truth(fleet, 0, 3.0, out)
    expected = dict.fromkeys(TRUTH, 0.0) | {
        "x": 5.0, "y": -20.0, "z": 990.0, "V": 31.0, "gamma": 0.1, "alpha": 0.15 - 0.1, "theta": 0.15, "q": 0.02,
    }  # fmt: skip
    assert dict(zip(TRUTH, out.tolist(), strict=True)) == expected


def test_a_reference_point_moves_at_the_velocity_of_its_target_from_its_stamp_on():
    fleet = build_fleet([vehicle(7, kind="reference_point", target=LEADER)])
    out = np.zeros(len(TRUTH))
    truth(fleet, 0, 2.0, out)
    assert (out[0], out[2], out[3]) == (60.0, 1000.0, 30.0)
    fleet.target[0] = (2.0, 100.0, 7.0, 1010.0, 24.0, 0.0, 7.0)
    assert advance(fleet, 0, 2_000_000, 10_000, STEP) == 0
    truth(fleet, 0, 2.5, out)
    motion = dict(zip(TRUTH, out.tolist(), strict=True))
    assert (motion["x"], motion["y"], motion["z"]) == (112.0, 7.0, 1013.5)
    assert motion["V"] == 25.0
    assert motion["gamma"] == motion["theta"] == pytest.approx(math.asin(7.0 / 25.0))
