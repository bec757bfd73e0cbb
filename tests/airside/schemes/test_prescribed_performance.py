"""Chapter 3: the start, what is added on board, and the conditions that are checked."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from ftcc.airside.scheme import Flight, Reference
from ftcc.airside.schemes import find
from ftcc.link.graph import Graph
from tests.airside.schemes.flying import MISSION, both_ways, flight, heard, model, own

SCHEME = find("prescribed_performance")
LAW = SCHEME.module
MODEL = model(100.0, 0.87)
GRAPH = Graph((1, 2, 3), (4,), both_ways({(1, 2): 0.3, (1, 3): 0.5, (2, 3): 0.4}) | {(1, 4): 0.7})
AGREEING = heard((1000.0, 0.0), (1000.0, 0.0))


def begin(form: str, aircraft, neighbours=AGREEING, dt: float = 0.01, **gains: float):
    """Gains, state at the start, state and output after one step."""
    chosen = SCHEME.gains(form, gains)
    state = LAW.start(aircraft, neighbours, MISSION, MODEL, chosen)
    return chosen, state, *LAW.step(state, aircraft, neighbours, MISSION, MODEL, chosen, dt)


@pytest.mark.parametrize("form", ["monograph", "flight"])
def test_at_the_start_every_filter_stands_at_what_it_filters(form):
    """The published start: engine and servo at 0, theta = 0.0322 rad; none of the filters moves in the first step."""
    aircraft = own(theta=0.0322, z=1000.4, thrust=0.0, elevator=0.0)
    _, before, after, law = begin(form, aircraft)
    assert before.z_d == before.z_r == 1000.0
    assert before.z_h == 1000.4
    for name in ("z_d", "gamma_d", "theta_d", "q_d", "u_l", "theta_f", "z_h"):
        assert getattr(after, name) == pytest.approx(getattr(before, name), abs=1e-12), name
    assert pytest.approx(-before.gamma_d) == law.E3
    assert (before.u_s, before.q_h) == (0.0, 0.0)


def test_tube_of_the_published_start():
    _, _, _, law = begin("monograph", own(z=1001.0))
    assert (law.width, law.error) == (2.0, 1.0)
    assert law.transformed == pytest.approx(math.atanh(0.5))


def test_printed_reference_is_the_estimate_and_its_rate():
    """(3.20) with s = 0.3 (1000 - 1000.2): -8 s - 4 tanh(s/0.1)."""
    _, _, after, law = begin("monograph", own(), heard((1000.2, 0.0), weight=(0.3,)))
    assert law.v_ref == pytest.approx(8.0 * 0.06 + 4.0 * math.tanh(0.6))
    assert after.z_d == pytest.approx(1000.0 + 0.01 * law.v_ref)


def test_on_board_the_estimate_moves_at_most_3_m_s_and_the_reference_follows_smoothly():
    _, before, after, law = begin("flight", own(), heard((1100.0, 1.0), age=0.05))
    assert law.z_d_rate == 3.0
    assert (law.v_ref, after.v_r) == (0.0, 0.0)
    assert after.z_r == before.z_r


def test_neighbours_hear_the_estimate_and_the_smoothed_rate_of_the_same_instant():
    gains, before, _, law = begin("flight", own(), heard((1001.0, 1.0)))
    assert LAW.share(before, own(), MISSION, law, gains) == (before.z_d, before.v_r)


def test_silent_neighbour_is_extrapolated_for_5_seconds():
    first = begin("flight", own(), heard((1000.0, 0.001), age=5.0))[3].z_d_rate
    later = begin("flight", own(), heard((1000.0, 0.001), age=50.0))[3].z_d_rate
    assert first == later > 0.0


def test_before_its_first_record_a_neighbour_counts_at_the_start_altitude():
    silent = heard((7.0, 7.0))
    silent.valid[0] = 0.0
    assert begin("flight", own(), silent)[3].z_d_rate == 0.0


@pytest.mark.parametrize(("form", "integral"), [("monograph", 0.2), ("flight", 0.0)])
def test_speed_integral_waits_while_thrust_is_saturated_on_board_only(form, integral):
    _, _, after, law = begin(form, own(V=10.0))
    assert law.thrust == 100.0
    assert after.integral == pytest.approx(integral)


def test_on_board_virtual_controls_are_limited_in_any_attitude():
    for aircraft in (own(gamma=0.9), own(theta=-1.0, q=3.0), own(z=1500.0, V=12.0)):
        _, _, after, law = begin("flight", aircraft)
        assert abs(law.gamma_bar) <= 0.2
        assert abs(law.theta_bar) <= 0.3
        assert abs(law.q_bar) <= 0.6
        assert abs(law.elevator) <= 0.87
        assert max(after.F_gamma, after.F_q) <= 0.5


def test_estimator_finds_the_acceleration_that_a_stuck_bias_causes():
    """q' = 17 u_s + d with u = 0: the estimate goes to d with 20 1/s."""
    gains = SCHEME.gains("flight", {})
    state = LAW.start(own(elevator=0.0), AGREEING, MISSION, MODEL, gains)
    _, law = LAW.step(state, own(elevator=0.0, q=0.02), AGREEING, MISSION, MODEL, gains, 0.01)
    assert law.unexplained == pytest.approx(20.0 * 0.02)


def test_without_fault_tolerance_nothing_is_estimated_or_learned():
    _, _, after, law = begin("flight", own(q=0.3, z=1001.0), **SCHEME.switches["fault_tolerance"])
    assert (law.unexplained, law.energy_gamma, law.energy_q, after.zeta) == (0.0, 0.0, 0.0, 0.0)
    assert max(after.F_gamma, after.F_q) <= 0.0


def test_networks_have_their_published_size_at_rest():
    """phi'phi about 10.8 and 10.5 at zero inputs."""
    _, _, _, law = begin("monograph", own(theta=0.0, elevator=0.0))
    assert (law.energy_gamma, law.energy_q) == pytest.approx((10.8, 10.5), abs=0.1)


def fatal(flown: Flight, form: str = "flight", **gains: float) -> str:
    return "\n".join(p.text for p in SCHEME.check(SCHEME.gains(form, gains), flown) if p.fatal)


def test_published_set_ups_pass_with_a_word_on_the_sufficient_condition():
    for form, period in (("monograph", 0.001), ("flight", 0.01)):
        problems = SCHEME.check(SCHEME.gains(form, {}), flight(GRAPH, period, leader_climb=1.577))
        assert [p.fatal for p in problems] == [False, False]
        assert all("(3.71)" in p.text for p in problems)


def test_start_outside_of_the_tube_is_refused():
    initial = {1: Reference(0.0, 30.0, 0.0, 1000.0, 0.0, 0.0), 2: Reference(0.0, 30.0, 0.0, 1002.5, 0.0, 0.0)}
    flown = replace(flight(GRAPH, 0.01), initial=initial)
    assert "UAV 2 starts at z = 1002.5 m" in fatal(flown)
    assert "performance tube" in fatal(flown)
    assert fatal(flown, in_flight=1.0) == ""


@pytest.mark.parametrize(
    ("gains", "facts", "words"),
    [
        ({"k31": 0.0}, {}, "gain k31 = 0: must be above 0"),
        ({}, {"leader_climb": 4.5}, "gain beta2 = 4 m/s: must exceed the leaders' largest climb rate"),
        ({}, {"leader_climb": 3.5}, "gain observer_limit"),
        ({"tube_last": 3.0}, {}, "must not widen"),
        ({}, {"leader_speed_varies": True}, "must be constant"),
        ({"phi": 0.01}, {}, "unstable in Euler steps"),
        ({"horizon": -5.0}, {}, "gain horizon = -5: must be at least 0"),
        ({"cap": -0.5}, {}, "gain cap = -0.5: must be at least 0"),
    ],
)
def test_gains_that_break_a_condition_are_refused(gains, facts, words):
    assert words in fatal(flight(GRAPH, 0.01, **facts), **gains)


def test_lead_filter_is_unstable_above_30_ms():
    assert "lead_fast" not in fatal(flight(GRAPH, 0.025))
    assert "lead_fast" in fatal(flight(GRAPH, 0.031))


def test_printed_inner_loop_in_slow_steps_is_warned_about():
    texts = [p.text for p in SCHEME.check(SCHEME.gains("monograph", {}), flight(GRAPH, 0.01)) if not p.fatal]
    assert any("1 kHz" in text for text in texts)
