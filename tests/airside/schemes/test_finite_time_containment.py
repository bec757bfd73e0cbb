"""Chapter 6: the start, the estimates, the guards, and the conditions that are checked."""

from __future__ import annotations

import math

import pytest

from ftcc.airside.schemes import find
from ftcc.link.graph import Graph
from tests.airside.schemes.flying import MISSION, both_ways, flight, heard, model, own

SCHEME = find("finite_time_containment")
LAW = SCHEME.module
MODEL = model(60.0, 0.9075)
GRAPH = Graph(
    (1, 2, 3, 4),
    (5, 6),
    both_ways({(1, 2): 0.4, (2, 3): 0.3, (3, 4): 0.5, (5, 6): 1.0})
    | {(1, 5): 0.7, (4, 5): 0.7, (2, 6): 0.8, (3, 6): 0.8},
)
ADAPTED = ("c11", "c12", "c21", "c22", "c31", "c32", "c41", "c42")
HERE = heard((0.0, 30.0, 1000.0, 0.0))


def begin(form: str, aircraft, neighbours=HERE, dt: float = 0.005, **gains: float):
    """Gains, state at the start, state and output after one step."""
    chosen = SCHEME.gains(form, gains)
    state = LAW.start(aircraft, neighbours, MISSION, MODEL, chosen)
    return chosen, state, *LAW.step(state, aircraft, neighbours, MISSION, MODEL, chosen, dt)


def test_hull_weights_of_the_reference_graph():
    """Reference: the followers' shares of leader 5; edges between leaders change nothing."""
    assert GRAPH.hull_weights[:, 0] == pytest.approx([0.7258, 0.2461, 0.2626, 0.6928], abs=1e-4)


def test_estimates_start_at_the_own_motion_and_filters_at_the_trim():
    _, state, _, _ = begin("flight", own(x=10.0, z=468.0))
    assert state[:4] == (10.0, 30.0, 468.0, 0.0)
    assert [getattr(state, name) for name in ADAPTED] == [0.0] * 8
    assert (state.u1_f, state.alpha_f, state.u2_f) == pytest.approx((21.3032, 0.032175, 0.196882))
    assert (state.eta1, state.eta2, state.p2) == (0.01, 0.01, 30.0)


def test_28_states_and_the_last_measurement():
    assert len(LAW.State._fields) == 28 + 4


def test_alone_the_estimate_flies_on_at_its_speed():
    """No neighbour heard: x_hat' = V_hat."""
    _, before, after, _ = begin("flight", own(x=10.0), heard())
    assert after.x_hat == pytest.approx(before.x_hat + 0.005 * 30.0)
    assert (after.Vx_hat, after.z_hat) == (30.0, 1000.0)


def test_a_neighbour_in_step_leaves_the_estimate_in_step_however_old_its_record():
    """The neighbour flies at 30 m/s: age and control step are accounted for to the last mm."""
    late = heard((-3.0, 30.0, 1000.0, 0.0), age=0.1)
    _, _, after, _ = begin("flight", own(), late)
    assert after.x_hat == pytest.approx(0.15, abs=1e-12)
    assert begin("flight", own(), late, growth=0.0)[2].x_hat < 0.15 - 1e-4


def test_neighbours_hear_the_estimates_of_the_measurements_instant():
    gains, before, _, law = begin("flight", own(x=10.0))
    assert LAW.share(before, own(x=10.0), MISSION, law, gains) == before[:4]


def test_errors_are_the_printed_ones():
    """(6.31)-(6.53) by hand for S1 = 2 m, S3 = -1 m from the start."""
    gains, state, _, _ = begin("monograph", own())
    _, law = LAW.step(state, own(x=2.0, z=999.0), HERE, MISSION, MODEL, gains, 0.0005)
    assert (law.S1, law.S3) == (2.0, -1.0)
    assert law.x2d == pytest.approx(30.0 - 0.2 * 2.0)
    assert pytest.approx(0.4 + 0.2 * 2.0**0.8) == law.S2
    assert law.x4d == pytest.approx(0.8 / 30.0)
    assert pytest.approx(-0.8 / 30.0 - 0.05) == law.S4
    assert law.x5d == pytest.approx(-3.0 * law.S4)
    assert pytest.approx(0.032175 - law.x5d - 0.33 * abs(law.S4) ** 0.8) == law.S5
    assert law.thrust_wanted == pytest.approx(-2.0 * law.S2 - 0.4 * law.S2**0.8 + 1.1 * 0.01)


def test_without_the_finite_time_terms_the_law_is_linear_in_small_errors():
    gains, state, _, _ = begin("monograph", own(), **SCHEME.switches["finite_time"])
    one, two = (LAW.step(state, own(x=x), HERE, MISSION, MODEL, gains, 0.0005)[1].S2 for x in (1e-3, 2e-3))
    assert two == pytest.approx(2.0 * one)


@pytest.mark.parametrize(
    ("aircraft", "held", "free"),
    [(own(V=36.0), ("c11", "c12"), ("c21", "c22")), (own(q=2.0, z=999.0), ("c41", "c42", "c21"), ("c11", "c12"))],
    ids=["thrust at its limit", "elevator at its limit"],
)
def test_nothing_is_learned_from_a_saturated_command(aircraft, held, free):
    gains, state, _, _ = begin("flight", own())
    after, law = LAW.step(state, aircraft, HERE, MISSION, MODEL, gains, 0.005)
    assert law.thrust != law.thrust_wanted or law.elevator != law.elevator_wanted
    assert [getattr(after, name) for name in held] == [0.0] * len(held)
    gains = SCHEME.gains("monograph", {})
    after, _ = LAW.step(state, aircraft, HERE, MISSION, MODEL, gains, 0.005)
    assert all(getattr(after, name) > 0.0 for name in held)


def test_adapted_gains_stay_below_their_caps():
    gains = SCHEME.gains("flight", {"cap1": 1e-4, "cap2": 5e-5, "cap4": 3e-4})
    state = LAW.start(own(), HERE, MISSION, MODEL, gains)
    for _ in range(20):
        state, _ = LAW.step(state, own(z=999.9, x=0.1), HERE, MISSION, MODEL, gains, 0.005)
    assert (state.c12, state.c31, state.c42) == (1e-4, 5e-5, 3e-4)


@pytest.mark.parametrize(("until", "learns"), [(0.0, True), (40.0, True), (10.0, False)])
def test_adaptation_of_the_elevator_can_be_frozen_from_an_instant_on(until, learns):
    _, _, after, _ = begin("flight", own(t=30.0), adapt_until=until)
    assert (after.c31 > 0.0) == learns


def test_without_adaptation_all_learned_gains_stay_at_zero():
    _, _, after, _ = begin("flight", own(z=999.0, x=1.0), **SCHEME.switches["adaptation"])
    assert [getattr(after, name) for name in ADAPTED] == [0.0] * 8


def test_prediction_carries_the_measurement_one_sample_ahead_from_the_second_tick_on():
    gains, _, state, first = begin("flight", own(), prediction=1.0)
    plain = begin("flight", own())[3]
    assert first == plain
    _, law = LAW.step(state, own(x=0.15, q=0.01), HERE, MISSION, MODEL, gains, 0.005)
    _, at_q = LAW.step(state, own(x=0.15, q=0.02), HERE, MISSION, MODEL, gains._replace(prediction=0.0), 0.005)
    assert pytest.approx(at_q.S6) == law.S6


def test_internal_steps_of_1_ms_agree_with_finer_ones():
    start = own(z=998.0, x=-2.0, gamma=0.02)
    coarse, fine = (begin("flight", start, substeps=n)[2] for n in (5.0, 50.0))
    assert coarse[:4] == pytest.approx(fine[:4], abs=2e-3)
    assert coarse[4:12] == pytest.approx(fine[4:12], rel=0.02, abs=1e-6)


def fatal(period: float = 0.005, leader_acceleration: float = 0.2, **gains: float) -> str:
    flown = flight(GRAPH, period, leader_acceleration=leader_acceleration)
    return "\n".join(p.text for p in SCHEME.check(SCHEME.gains("flight", gains), flown) if p.fatal)


def test_both_forms_pass():
    assert SCHEME.check(SCHEME.gains("flight", {}), flight(GRAPH, 0.005, leader_climb=2.58)) == []
    assert SCHEME.check(SCHEME.gains("monograph", {}), flight(GRAPH, 0.0005, leader_climb=2.58)) == []


@pytest.mark.parametrize(
    ("gains", "words"),
    [
        ({"k61": 0.0}, "gain k61 = 0: must be above 0"),
        ({"r": 1.0}, "gain r = 1: must be above 0 and below 1"),
        ({"a": 0.0}, "gain a = 0: must be above 0 and below 1"),
        ({"b3": -0.1}, "gain b3 = -0.1: must be from 0 to 10000"),
        ({"substeps": 2.5}, "whole number"),
        ({"beta4": 0.1}, "must exceed the leaders' largest acceleration, 0.200 m/s^2 (Lemma 6.6)"),
        ({"low_pass": 1500.0}, "gain low_pass: its rate 2121 1/s is unstable in Euler steps of 1 ms"),
        ({"kappa": 0.001}, "UAV hears: its rate 4800 1/s is unstable in Euler steps of 1 ms"),
        ({"beta2": 30.0}, "gain beta2 / kappa"),
        ({"cap4": 0.0}, "gain cap4 = 0: must be above 0"),
    ],
)
def test_gains_that_break_a_condition_are_refused(gains, words):
    assert words in fatal(**gains)


def test_infinite_time_variant_is_allowed():
    assert fatal(**SCHEME.switches["finite_time"]) == ""


def test_slow_control_is_warned_about():
    (slow,) = SCHEME.check(SCHEME.gains("flight", {"substeps": 10.0}), flight(GRAPH, 0.01))
    assert not slow.fatal
    assert "limit-cycles" in slow.text
    predicted = SCHEME.check(SCHEME.gains("flight", {"substeps": 10.0, "prediction": 1.0}), flight(GRAPH, 0.01))
    assert predicted == []


def test_estimate_keeps_the_climb_of_the_own_start():
    aircraft = own(gamma=0.1, theta=0.13)
    _, state, _, _ = begin("flight", aircraft)
    assert (state.Vx_hat, state.Vz_hat) == pytest.approx((30.0 * math.cos(0.1), 30.0 * math.sin(0.1)))
