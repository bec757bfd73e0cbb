"""The aircraft of chapter 9 as a point: its equations, drag and wind, its actuators, gust and delay."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ftcc.link.actuators import SLOT, THRUST
from ftcc.sim.actuation import drive_of, latch, stroke
from ftcc.sim.build import build_fleet
from ftcc.sim.disturbances import Disturbance, Gust, gust
from ftcc.sim.faults import Fault
from ftcc.sim.fleet import Fleet
from ftcc.sim.plant import LOST, TRUTH
from ftcc.sim.plants import cycle_of
from ftcc.sim.plants.position import Disturbances, Inputs, Parameters, State, drag, initial, rates, wind_speed
from ftcc.sim.spec import VehicleSpec
from tests.support.swarm import vehicle

cycle = cycle_of("position")

UAV = Parameters(m=20.0, g=9.81, rho=1.225, S=1.37, CD0=0.02, kn=1.0, kd=0.1)
CALM = Disturbances(0.0, 0.0, 0.0, 0.0, 0.0)
LOAD, BANK = SLOT["load_factor"], SLOT["bank"]
LIMITS = ((-1.2, 1.2), (0.0, 3.0), (0.0, 0.0), (0.0, 300.0))
PLANT_B = {"lag": (5.0, 8.0, 0.0, 20.0), "damping": (0.0, 0.7, 0.0, 0.0), "rate": (2.0, math.inf, math.inf, math.inf)}


def point(**changes: object) -> VehicleSpec:
    """Level flight at 50 m/s to the north-east at 100 m."""
    standard = {
        "plant": "position",
        "airframe": UAV,
        "initial": initial({"V": 50.0, "z": 100.0, "chi": 0.7}, {}),
        "command": (0.0, 1.0, 0.0, float(drag(50.0, 1.0, UAV))),
        "limits": LIMITS,
    }
    return vehicle(**standard | changes)


def flown(fleet: Fleet, seconds: float, from_s: float = 0.0) -> int:
    return int(cycle.advance(fleet, 0, round(from_s * 1e6), round(seconds * 1e6), 1000))


def test_rates_are_those_of_the_flight_path():
    """(2.15)-(2.16) with alpha = beta = 0, L = n m g: V', chi' and gamma' of the velocity that is integrated."""
    V, chi, gamma, n, mu, thrust = 55.0, 0.9, 0.2, 1.4, 0.5, 120.0
    s = State(*initial({"V": V, "z": 100.0, "chi": chi, "gamma": gamma}, {}))
    found = rates(s, Inputs(mu, n, 0.0, thrust), CALM, UAV)
    v, a = np.array(found[:3]), np.array(found[3:])
    assert v == pytest.approx(
        [V * math.cos(gamma) * math.cos(chi), V * math.cos(gamma) * math.sin(chi), V * math.sin(gamma)]
    )
    along, ground = v / V, math.hypot(v[0], v[1])
    g = UAV.g
    assert a @ along == pytest.approx((thrust - drag(V, n, UAV)) / UAV.m - g * math.sin(gamma))
    chi_rate = (v[0] * a[1] - v[1] * a[0]) / ground**2
    assert chi_rate == pytest.approx(g * n * math.sin(mu) / (V * math.cos(gamma)))
    gamma_rate = (a[2] - (a @ along) * math.sin(gamma)) / (V * math.cos(gamma))
    assert gamma_rate == pytest.approx(g / V * (n * math.cos(mu) - math.cos(gamma)))


def test_drag_and_wind_are_the_printed_ones():
    """(9.32) as printed: the induced part is 0.01 N; (9.33): 10 m/s of mean wind are 7.15 m/s at 100 m."""
    assert drag(47.0, 1.0, UAV) == pytest.approx(0.5 * 1.225 * 47.0**2 * 1.37 * 0.02 + 0.0216, abs=1e-3)
    assert wind_speed(100.0, 10.0, 0.0) == pytest.approx(0.215 * 10.0 * 2.0 + 2.85)
    assert wind_speed(100.0, 0.0, 0.3) == 0.3
    s = State(*initial({"V": 50.0, "z": 100.0}, {}))
    windy = rates(s, Inputs(0.0, 1.0, 0.0, 0.0), CALM._replace(wind=10.0, gust=0.4), UAV)
    assert windy[3] == pytest.approx(-drag(50.0 - 7.55, 1.0, UAV) / UAV.m)


def test_thrust_cannot_brake():
    s = State(*initial({"V": 50.0, "z": 100.0}, {}))
    assert rates(s, Inputs(0.0, 1.0, 0.0, -40.0), CALM, UAV) == rates(s, Inputs(0.0, 1.0, 0.0, 0.0), CALM, UAV)


def test_a_turn_agrees_with_an_adaptive_integrator():
    fleet = build_fleet([point(disturbances=(Disturbance(0.0, 0, -2.0, 0.0), Disturbance(0.0, 3, 10.0, 0.0)))])
    fleet.command[0] = (0.6, 1.3, 0.0, 90.0)
    assert flown(fleet, 5.0) == 0
    d = CALM._replace(b_x=-2.0, wind=10.0)
    plain = getattr(rates, "py_func", rates)
    exact = solve_ivp(
        lambda t, x: plain(State(*x), Inputs(0.6, 1.3, 0.0, 90.0), d, UAV), (0.0, 5.0), point().initial,
        "DOP853", rtol=1e-12, atol=1e-12,
    )  # fmt: skip
    assert fleet.state[0] == pytest.approx(exact.y[:, -1], rel=1e-9)


def test_truth_shows_path_and_bank():
    fleet = build_fleet([point()])
    fleet.command[0, BANK] = 0.4
    cycle.actuate(fleet, 0, 0.0)
    true = np.zeros(len(TRUTH))
    cycle.truth(fleet, 0, 0.0, true)
    shown = dict(zip(TRUTH, true, strict=True))
    assert (shown["V"], shown["chi"], shown["gamma"], shown["mu"]) == pytest.approx((50.0, 0.7, 0.0, 0.4))


def test_a_point_that_stops_is_lost():
    fleet = build_fleet([point(initial=initial({"V": 3.2, "z": 100.0}, {}))])
    fleet.command[0] = (0.0, 1.0, 0.0, 0.0)
    fleet.airframe[0, Parameters._fields.index("CD0")] = 50.0
    assert LOST[flown(fleet, 5.0)] == "airspeed outside the model's valid range"


def test_a_second_order_actuator_follows_its_transfer_function():
    """n'' = 64 (n_c - n) - 11.2 n', whatever the steps, the fault behind it."""
    fleet = build_fleet([point(**PLANT_B, faults=(Fault(0.0, LOAD, 0.5, 0.1, 0.0, 0.0),))])
    fleet.command[0, LOAD] = 1.5
    exact = solve_ivp(
        lambda t, x: [x[1], 64.0 * (1.5 - x[0]) - 11.2 * x[1]], (0.0, 0.4), [1.0, 0.0], rtol=1e-11, atol=1e-12
    ).y[:, -1]
    for _ in range(40):
        begin, middle, end = stroke(fleet, 0, LOAD, drive_of(fleet, 0, LOAD, 0.2, 0.01), 0.01)
    assert (fleet.position[0, LOAD], fleet.speed[0, LOAD]) == pytest.approx(exact, abs=1e-8)
    assert end == pytest.approx(0.5 * exact[0] + 0.1)
    assert begin < middle < end


def test_bank_rolls_at_its_rate_limit():
    fleet = build_fleet([point(**PLANT_B)])
    fleet.command[0, BANK] = 1.2
    assert flown(fleet, 0.2) == 0
    assert fleet.position[0, BANK] == pytest.approx(0.4)


def test_gusts_are_normal_held_for_their_period_and_each_uavs_own():
    first, second = (build_fleet([point(uav=uav, gust=Gust(0.9, 100_000, 5))]) for uav in (1, 2))
    draws = np.array([gust(first, 0, 0.1 * n + 0.05) for n in range(2000)])
    assert [gust(first, 0, t) for t in (0.2001, 0.25, 0.2999)] == [draws[2]] * 3
    assert abs(draws.mean()) < 4.0 * 0.9 / math.sqrt(2000)
    assert draws.std() == pytest.approx(0.9, rel=4.0 / math.sqrt(4000))
    others = np.array([gust(second, 0, 0.1 * n + 0.05) for n in range(2000)])
    assert abs(np.corrcoef(draws, others)[0, 1]) < 4.0 / math.sqrt(2000)
    assert gust(build_fleet([point()]), 0, 0.05) == 0.0


def test_a_delayed_command_acts_that_many_samples_later_and_the_first_one_at_once():
    fleet = build_fleet([point(delay=2)])
    acted = []
    for thrust in (10.0, 20.0, 30.0, 40.0, 50.0):
        latch(fleet, 0, np.array([0.0, 1.0, 0.0, thrust]))
        acted.append(fleet.command[0, THRUST])
    assert acted == [10.0, 10.0, 10.0, 20.0, 30.0]


def test_a_command_given_for_the_start_stays_in_force_for_the_delay():
    fleet = build_fleet([point(delay=2, holds_first=True, command=(0.0, 0.0, 0.0, 5.0))])
    acted = []
    for thrust in (10.0, 20.0, 30.0):
        latch(fleet, 0, np.array([0.0, 1.0, 0.0, thrust]))
        acted.append(fleet.command[0, THRUST])
    assert acted == [5.0, 5.0, 10.0]
