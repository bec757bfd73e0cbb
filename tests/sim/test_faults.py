"""Failures of a vehicle: actuators that stick, slow down, fail now and then; a navigation solution that is off."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ftcc.airside.flight_path import Own, decode_state
from ftcc.link.actuators import ELEVATOR, THRUST
from ftcc.link.failures import AIRFRAME_SIZES, KINDS, UNITS, Failure, meaning_of
from ftcc.sim import navigation
from ftcc.sim.build import build_fleet
from ftcc.sim.faults import INTERMITTENT, STUCK, Fault
from ftcc.sim.fleet import Fleet
from ftcc.sim.injection import SPARE, faults_of, inject
from ftcc.sim.navigation import ATTITUDE, POSITION, NavigationFault
from ftcc.sim.plants import cycle_of
from ftcc.sim.spec import VehicleSpec
from tests.support.swarm import LEADER, TRIM, vehicle

cycle = cycle_of("longitudinal")
MS = 1000
HEALTHY = Fault(0.0, ELEVATOR, 1.0, 0.0, 0.0, 0.0)
SIZES = {size.name: size.default for size in AIRFRAME_SIZES}


class Flight:
    """One vehicle, flown in periods of 10 ms; what acts on its elevator at every tick."""

    def __init__(self, spec: VehicleSpec) -> None:
        self.fleet = build_fleet([spec])
        self.acting: list[float] = []
        self.messages: list[np.ndarray] = []

    def fly(self, ticks: int, elevator: float) -> None:
        """Fly on under a commanded elevator (rad)."""
        true, seen, state, controls = np.zeros(13), np.zeros(13), np.zeros(13), np.zeros(4)
        for _ in range(ticks):
            tick = len(self.acting)
            self.fleet.command[0, ELEVATOR] = elevator
            cycle.sense(self.fleet, 0, tick, tick * 10 * MS, 1, true, seen, state, controls)
            self.acting.append(float(self.fleet.acting[0, ELEVATOR]))
            self.messages.append(state.copy())
            cycle.advance(self.fleet, 0, tick * 10 * MS, 10 * MS, MS)


LAGGED = {"lag": (0.0, 20.0, 0.0, 20.0)}


@pytest.mark.parametrize("changes", [{}, LAGGED, LAGGED | {"fault_before_lag": True}], ids=["no lag", "lag", "before"])
def test_a_stuck_actuator_holds_the_deflection_that_it_has_until_it_is_repaired(changes):
    repaired = HEALTHY._replace(time=0.2)
    flight = Flight(vehicle(faults=(HEALTHY._replace(time=0.1, kind=STUCK), repaired), **changes))
    flight.fly(10, TRIM[ELEVATOR])
    flight.fly(10, -0.3)
    flight.fly(60, -0.3)
    assert flight.acting[11:20] == pytest.approx([TRIM[ELEVATOR]] * 9, abs=1e-9)
    assert flight.acting[-1] == pytest.approx(-0.3, abs=1e-4)


@pytest.mark.parametrize("changes", [{}, LAGGED], ids=["no lag", "lag"])
def test_a_slow_actuator_moves_at_its_limit_and_gets_there(changes):
    flight = Flight(vehicle(faults=(HEALTHY._replace(slew=0.5),), **changes))
    flight.fly(1, TRIM[ELEVATOR])
    flight.fly(30, TRIM[ELEVATOR] + 0.1)
    moved = np.diff(flight.acting)
    assert moved.max() == pytest.approx(0.5 * 0.01, rel=1e-6)
    assert flight.acting[-1] == pytest.approx(TRIM[ELEVATOR] + 0.1, abs=5e-3)


def test_an_intermittent_actuator_is_healthy_for_its_share_of_each_period():
    fault = HEALTHY._replace(effectiveness=0.5, kind=INTERMITTENT, period=0.2, duty=0.25)
    flight = Flight(vehicle(faults=(fault,)))
    flight.fly(80, -0.2)
    healthy = np.array(flight.acting) == -0.2
    assert healthy.mean() == pytest.approx(0.25)
    assert set(np.round(flight.acting, 12)) == {-0.2, -0.1}
    assert healthy[:5].all()
    assert not healthy[5:20].any()


# Navigation.


def seen(flight: Flight) -> list[Own]:
    """What an autopilot makes of the messages."""
    found = []
    for tick, message in enumerate(flight.messages):
        own = np.zeros(len(Own._fields))
        decode_state(message, tick / 100, np.zeros(4), own)
        found.append(Own(*own.tolist()))
    return found


def navigated(*faults: NavigationFault, ticks: int = 100) -> tuple[list[Own], list[Own]]:
    """The same motion, a pull-up, seen with and without navigation faults."""
    flights = [Flight(vehicle(navigation_faults=given)) for given in (faults, ())]
    for flight in flights:
        flight.fly(ticks, TRIM[ELEVATOR] - 0.05)
    return seen(flights[0]), seen(flights[1])


def test_a_stuck_position_holds_place_and_velocity_and_leaves_the_attitude_right():
    stuck, right = navigated(NavigationFault(0.5, POSITION, navigation.STUCK))
    assert {(o.x, o.z, o.V, o.gamma) for o in stuck[50:]} == {(o.x, o.z, o.V, o.gamma) for o in right[49:50]}
    assert [(o.theta, o.q) for o in stuck] == [(o.theta, o.q) for o in right]


def test_without_gps_the_place_is_reckoned_from_the_last_velocity():
    off, right = navigated(NavigationFault(0.5, POSITION, navigation.OFF))
    last = right[49]
    assert off[99].x == pytest.approx(last.x + last.V * math.cos(last.gamma) * 0.5, abs=1e-3)
    assert {o.V for o in off[50:]} == {last.V}


def test_without_gyros_the_rates_read_zero_and_the_attitude_is_held():
    off, right = navigated(NavigationFault(0.5, ATTITUDE, navigation.OFF))
    assert {(o.q, o.theta) for o in off[50:]} == {(0.0, right[49].theta)}
    assert [o.z for o in off] == [o.z for o in right]


def test_a_stuck_attitude_holds_attitude_and_rates():
    stuck, right = navigated(NavigationFault(0.5, ATTITUDE, navigation.STUCK))
    assert {(o.q, o.theta) for o in stuck[50:]} == {(right[49].q, right[49].theta)}


def test_a_slow_solution_is_fresh_once_in_a_period():
    slow, right = navigated(NavigationFault(0.2, POSITION, navigation.SLOW, period=0.1))
    assert len({o.z for o in slow[30:80]}) == 5
    assert {o.z for o in slow} <= {o.z for o in right}


def test_an_intermittent_solution_is_fresh_for_its_share_of_the_period():
    now_and_then, right = navigated(NavigationFault(0.2, POSITION, navigation.INTERMITTENT, period=0.1, duty=0.3))
    fresh = [a.z == b.z for a, b in zip(now_and_then[30:80], right[30:80], strict=True)]
    assert sum(fresh) == 15


def test_a_wrong_solution_is_off_by_what_was_asked_for():
    wrong, right = navigated(
        NavigationFault(0.5, POSITION, first=10.0, third=-3.0, second_rate=4.0),
        NavigationFault(0.5, ATTITUDE, second=0.02, second_rate=0.1),
    )
    assert wrong[40] == right[40]
    after, true = wrong[60], right[60]
    assert (after.x - true.x, after.z - true.z) == pytest.approx((10.0, 3.0), abs=1e-3)
    assert after.chi == pytest.approx(math.atan2(4.0, true.V * math.cos(true.gamma)), abs=1e-5)
    assert (after.theta - true.theta, after.q - true.q) == pytest.approx((0.02, 0.1), abs=1e-5)


def test_a_repaired_solution_is_right_again():
    repaired, right = navigated(NavigationFault(0.2, POSITION, navigation.STUCK), NavigationFault(0.4, POSITION))
    assert repaired[40:] == right[40:]


@pytest.mark.parametrize("part", [POSITION, ATTITUDE])
@pytest.mark.parametrize("kind", range(5))
def test_whatever_fails_from_the_first_tick_on_the_messages_hold_numbers_and_unit_quaternions(part, kind):
    flight = Flight(vehicle(navigation_faults=(NavigationFault(0.0, part, kind, 0.05, 0.5, *(0.3,) * 6),)))
    flight.fly(20, TRIM[ELEVATOR])
    assert np.isfinite(flight.messages).all()
    assert [np.linalg.norm(message[:4]) for message in flight.messages] == pytest.approx([1.0] * 20, abs=1e-6)
    assert np.isfinite([list(own) for own in seen(flight)]).all()


# In flight.


def failure(unit: str, kind: str, instance: int = 1, **sizes: float) -> Failure:
    meaning = meaning_of(UNITS[unit].code, KINDS[kind], instance)
    assert meaning is not None
    return Failure(meaning, instance, SIZES | sizes)


def active(fleet: Fleet) -> list[Fault]:
    return [Fault(*row) for row in fleet.faults[0, : fleet.fault_count[0]].tolist()]


def test_what_is_injected_is_what_is_planned():
    fault = Fault(4.0, ELEVATOR, 0.7, 0.35, 2.0, 2.0)
    planned, injected = build_fleet([vehicle(faults=(fault,))]), build_fleet([vehicle()])
    asked = failure("servo", "wrong", 2, FAIL_EFF=0.7, FAIL_BIAS=0.35, FAIL_EFF_RATE=2.0, FAIL_BIAS_RATE=2.0)
    for one in faults_of(injected, 0, asked, 4.0):
        assert inject(injected, 0, one, 1.0)
    assert active(injected) == active(planned)


def test_the_same_asked_for_twice_is_one_and_another_of_that_time_replaces_it():
    fleet = build_fleet([vehicle()])
    for effectiveness in (0.6, 0.6, 0.8):
        assert inject(fleet, 0, Fault(4.0, ELEVATOR, effectiveness, 0.0, 0.0, 0.0), 1.0)
    assert [fault.effectiveness for fault in active(fleet)] == [0.8]


def test_a_long_session_of_faults_and_repairs_does_not_fill_the_table():
    fleet = build_fleet([vehicle()])
    for second in range(10 * SPARE):
        assert inject(fleet, 0, HEALTHY._replace(time=float(second), effectiveness=0.5), float(second))
        assert inject(fleet, 0, HEALTHY._replace(time=float(second), actuator=float(THRUST)), float(second))


def test_more_than_there_is_room_for_is_refused_and_changes_nothing():
    fleet = build_fleet([vehicle()])
    answers = [inject(fleet, 0, HEALTHY._replace(time=100.0 + n), 1.0) for n in range(SPARE + 1)]
    assert answers == [True] * SPARE + [False]
    assert [fault.time for fault in active(fleet)] == [100.0 + n for n in range(SPARE)]


def test_a_part_that_the_aircraft_has_not_cannot_fail():
    fleet = build_fleet([vehicle()])
    assert faults_of(fleet, 0, failure("servo", "off", 1), 1.0) == []
    assert [fault[1] for fault in faults_of(fleet, 0, failure("servo", "off", 0), 1.0)] == [ELEVATOR]


def test_a_reference_point_has_room_but_no_faults():
    assert build_fleet([vehicle(kind="reference_point", target=LEADER)]).fault_count.tolist() == [0]
