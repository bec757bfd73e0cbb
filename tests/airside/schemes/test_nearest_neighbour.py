"""Chapter 4: the reference, the start, what is added on board, and the conditions that are checked."""

from __future__ import annotations

import math

import pytest

from ftcc.airside.autopilots import build
from ftcc.airside.model import airspeed_model
from ftcc.airside.schemes import find
from ftcc.groundside.scenario.loading import load
from ftcc.groundside.scenario.mission import resolve
from ftcc.link.channel import hear
from ftcc.link.graph import Graph
from tests.airside.schemes.flying import MISSION, both_ways, flight, heard, model, own

SCHEME = find("nearest_neighbour")
LAW = SCHEME.module
MODEL = model(100.0, 0.96)
GRAPH = Graph(
    (1, 2, 3, 4), (5,), both_ways({(1, 2): 1.0, (2, 3): 1.0, (3, 4): 1.0, (4, 1): 1.0}) | {(1, 5): 1.0, (4, 5): 1.0}
)

LEADER = (30.0, 0.0, 1000.0, 0.0)
AT_START = {
    1: {"V": 31.5, "z": 998.0, "gamma": 0.4, "theta": 0.03},
    2: {"V": 27.0, "theta": 0.03},
    3: {"theta": 0.03},
    4: {"V": 33.0, "theta": 0.1, "q": 0.5},
}
"""Table 4.2."""


def said(uav: int) -> tuple[float, float, float, float]:
    """What a follower says at t = 0, its acceleration still 0."""
    aircraft = own(**AT_START[uav])
    return aircraft.V, 0.0, aircraft.z, aircraft.V * math.sin(aircraft.gamma)


HEARD_AT_START = {
    1: heard(said(2), said(4), LEADER),
    2: heard(said(1), said(3)),
    3: heard(said(2), said(4)),
    4: heard(said(1), said(3), LEADER),
}


def begin(form: str, aircraft, neighbours, dt: float = 0.005, **gains: float):
    """Gains, state after one step from the start, output."""
    chosen = SCHEME.gains(form, gains)
    state = LAW.start(aircraft, neighbours, MISSION, MODEL, chosen)
    return chosen, *LAW.step(state, aircraft, neighbours, MISSION, MODEL, chosen, dt)


@pytest.mark.parametrize(("uav", "V_id", "S1"), [(1, 30.0, 1.5), (2, 30.75, -3.75), (3, 30.0, 0.0), (4, 30.5, 2.5)])
def test_initial_references_are_those_of_the_monographs_figure(uav, V_id, S1):
    """The inset of Fig. 4.3 has 29.8..30.6 m/s, the axis of Fig. 4.4 -4..3 m/s."""
    _, _, law = begin("monograph", own(**AT_START[uav]), HEARD_AT_START[uav])
    assert (law.V_id, law.S1) == pytest.approx((V_id, S1))


@pytest.mark.parametrize("uav", [1, 2, 3, 4])
@pytest.mark.parametrize("form", ["monograph", "flight"])
def test_at_the_start_the_filters_stand_at_what_they_filter(form, uav):
    aircraft = own(**AT_START[uav])
    gains, after, law = begin(form, aircraft, HEARD_AT_START[uav])
    assert (law.gamma_d_rate, law.theta_d_rate) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert law.d1_hat == pytest.approx(gains.k11 * law.S1)
    assert law.lumped_hat == pytest.approx(gains.k51 * aircraft.q)
    assert after.begun == 1.0


def test_initial_pitch_estimate_of_uav_4_is_inside_the_monographs_figure():
    """q_d(0) = 0: 23 rad/s^2, axis -100..50 of Fig. 4.10."""
    assert begin("monograph", own(**AT_START[4]), HEARD_AT_START[4])[2].lumped_hat == pytest.approx(23.3)


def test_before_the_first_record_the_neighbours_are_known_as_they_start():
    """The spec that an autopilot is given holds its neighbours' V, V' = 0, z, z' of t = 0; leaders count likewise."""
    mission = resolve(load("nearest_neighbour"))
    _, inbox = build(mission.autopilots, mission.timing)
    assert inbox.valid[:4].sum() == sum(len(HEARD_AT_START[uav].age) for uav in HEARD_AT_START)
    for i, spec in enumerate(mission.autopilots[:4]):
        known = {n.uav: inbox.values[i, edge].tolist() for edge, n in enumerate(spec.neighbours)}
        assert known == {n.uav: pytest.approx(LEADER if n.uav == 5 else said(n.uav)) for n in spec.neighbours}
    hear(inbox, 0, 30_000)
    assert inbox.age[0, : inbox.degree[0]].tolist() == [0.03] * 3


def test_who_knows_of_no_neighbour_flies_on():
    _, _, law = begin("flight", own(V=27.0, z=940.0), heard())
    assert (law.S1, law.S2) == (0.0, 0.0)


def test_when_nobody_is_left_the_last_averages_are_held_with_zero_rates():
    gains, state, _ = begin("flight", own(), heard((31.0, 0.2, 1003.0, 1.0)))
    for _ in range(3):
        state, law = LAW.step(state, own(), heard((31.0, 0.2, 1003.0, 1.0), age=2.5), MISSION, MODEL, gains, 0.005)
        assert (law.V_id, law.z_id) == (31.0, 1003.0)
    assert state.z_r_rate < 1.0


def test_neighbours_hear_speed_acceleration_altitude_and_climb_of_one_instant():
    aircraft = own(gamma=0.1, theta=0.13)
    gains, after, law = begin("flight", aircraft, HEARD_AT_START[3])
    V, V_dot, z, z_dot = LAW.share(after, aircraft, MISSION, law, gains)
    f_v, g_v = airspeed_model(30.0, 0.1, aircraft.theta - 0.1, MODEL)
    assert (V, z, z_dot) == (30.0, 1000.0, 30.0 * math.sin(0.1))
    assert V_dot == pytest.approx(f_v + g_v * aircraft.thrust + law.d1_hat)


def test_an_ideal_accelerometer_knows_the_disturbance_after_one_tick():
    """V' = f_v + g_v T + 0.1: the value sent is the acceleration although the observer knows nothing yet."""
    gains, state, law = begin("monograph", own(), heard(LEADER), dt=0.001)
    V = 30.0 + 0.001 * (law.known_V_rate + 0.1)
    _, law = LAW.step(state, own(V=V), heard(LEADER), MISSION, MODEL, gains, 0.001)
    assert law.V_rate - law.known_V_rate == pytest.approx(0.1, abs=1e-9)


def test_lead_sends_what_brings_a_lagging_elevator_to_where_it_is_wanted():
    """After the command's tick, a 20 rad/s actuator is where a 100 rad/s one would be, to the step's order."""
    aircraft = own(theta=0.034)
    _, after, law = begin("flight", aircraft, heard(LEADER))
    wanted = min(max(law.elevator_wanted, -0.96), 0.96)
    assert law.elevator == pytest.approx(after.elevator + 5.0 * (wanted - after.elevator))
    assert after.elevator == pytest.approx(aircraft.elevator)
    assert begin("flight", aircraft, heard(LEADER), lead=0.0)[2].elevator == pytest.approx(wanted)


def test_guards_limit_the_virtual_controls():
    for aircraft in (own(z=900.0), own(gamma=0.8, theta=0.2), own(q=5.0, theta=-0.5)):
        _, after, law = begin("flight", aircraft, heard(LEADER))
        assert abs(law.gamma_bar) <= 0.3
        assert abs(law.theta_bar - aircraft.gamma) <= 0.25 + 1e-12
        assert abs(law.q_d_rate) <= (2.0 + abs(after.q_d)) / 0.05


def test_without_fault_tolerance_nothing_is_estimated():
    _, _, law = begin("flight", own(V=28.0, q=0.4), heard(LEADER), **SCHEME.switches["fault_tolerance"])
    assert (law.d1_hat, law.d2_hat, law.lumped_hat) == (0.0, 0.0, 0.0)


def texts(form: str, fatal: bool, period: float = 0.005, **gains: float) -> str:
    flown = flight(GRAPH, period)
    return "\n".join(p.text for p in SCHEME.check(SCHEME.gains(form, gains), flown) if p.fatal == fatal)


def test_flight_form_passes_with_a_word_on_condition_4_63():
    assert texts("flight", True) == ""
    assert texts("flight", False).startswith("gain k32 = 2.2 1/s: condition (4.63)")


@pytest.mark.parametrize(
    ("gains", "period", "words"),
    [
        ({"k21": -1.0}, 0.005, "gain k21 = -1: must be above 0"),
        ({}, 0.025, "gain k51, k52: its rate 86 1/s is unstable in Euler steps of 25 ms"),
        ({"oldest": 0.08}, 0.005, "exchange period plus the latency"),
        ({"horizon": -1.0}, 0.005, "gain horizon = -1: must be at least 0"),
        ({"gamma_limit": -0.3}, 0.005, "gain gamma_limit = -0.3: must be from 0 to 1.5708"),
    ],
)
def test_gains_that_break_a_condition_are_refused(gains, period, words):
    assert words in texts("flight", True, period, **gains)


def test_what_does_not_survive_a_slow_exchange_is_warned_about():
    assert "the ring is unstable" in texts("monograph", False)
    assert "50 Hz" in texts("flight", False, 0.02)
