"""The attitude laws of chapters 7 and 8: single steps, their conditions, and the same bits in plain Python."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ftcc.airside.autopilots import build
from ftcc.airside.compiled_stages import stages_of
from ftcc.airside.elements.filters import butterworth_step
from ftcc.airside.scheme import Flight
from ftcc.airside.schemes import find
from ftcc.groundside.scenario.loading import load
from ftcc.groundside.scenario.mission import resolve
from ftcc.link.graph import Graph, GraphError
from ftcc.link.rotation import wrapped

REPOSITORY = Path(__file__).parents[3]
LAWS = ("attitude_synchronization", "directed_attitude")
RING = Graph(
    (1, 2, 3, 4), (), {pair: 1.0 for i in range(4) for pair in ((i + 1, (i + 1) % 4 + 1), ((i + 1) % 4 + 1, i + 1))}
)
FLIGHT = Flight(RING, 0.005, 0.05, 0.05, 0.0, False)


class Pilot:
    """UAV 1 of a scenario, shown what a test wants it to see."""

    def __init__(self, scheme: str) -> None:
        mission = resolve(load(scheme, form="flight"))
        self.scheme = find(scheme)
        self.period = mission.timing.period
        self.autopilots, self.inbox = build(mission.autopilots, mission.timing)
        self.stages = stages_of(scheme)
        self.n = 0

    def see(self, neighbours: float | None = None, **state: float) -> dict[str, float]:
        """One tick with this attitude (rad); the neighbours' errors are all ``neighbours``. Returns the signals."""
        own = self.autopilots.own[0]
        own[:] = 0.0
        own[0] = self.n * self.period
        for place, name in ((4, "V"), (7, "mu"), (8, "alpha"), (9, "beta"), (11, "p"), (12, "q"), (13, "r")):
            own[place] = state.get(name, 25.0 if name == "V" else 0.0)
        self.n += 1
        if neighbours is not None:
            self.inbox.values[0, :, :3] = neighbours
            self.inbox.valid[0, :] = 1.0
        assert self.stages.control(self.autopilots, self.inbox, 0, self.period)
        names = (signal.name for signal in self.scheme.signals)
        return dict(zip(names, self.autopilots.signals[0].tolist(), strict=True))

    def wanted(self, **reference: float) -> Pilot:
        """Another reference (rad), which stays."""
        for place, name in enumerate(("mu", "alpha", "beta")):
            self.autopilots.reference[0, place] = reference.get(name, 0.0)
        return self

    @property
    def command(self) -> tuple[float, float, float]:
        """Aileron, elevator, rudder, rad."""
        return tuple(self.autopilots.command[0, :3].tolist())  # type: ignore[return-value]


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("axis", "surface"), [("mu", 0), ("alpha", 1), ("beta", 2)])
def test_an_error_of_an_axis_is_answered_by_its_surface(law, axis, surface):
    """A positive deflection turns negatively: too much bank or alpha calls for more of it, sideslip for nose right."""
    level = {"alpha": math.radians(2.0)}
    calm, upset = Pilot(law), Pilot(law)
    for _ in range(3):
        calm.see(**level)
        upset.see(**level | {axis: level.get(axis, 0.0) + 0.03})
    sign = -1.0 if axis == "beta" else 1.0
    assert sign * (upset.command[surface] - calm.command[surface]) > 0.01


@pytest.mark.parametrize(("law", "own_share", "other_share"), [(LAWS[0], 1.2, 2.0), (LAWS[1], 0.4, 0.25 * 0.5)])
def test_the_synchronization_error_weighs_the_own_error_and_the_neighbours(law, own_share, other_share):
    """(7.12), (8.10): nobody heard yet; then the ring's two neighbours, or the one whom UAV 1 hears."""
    alpha = {"alpha": math.radians(2.0)}
    error = "E_mu" if law == LAWS[0] else "e_mu"
    assert Pilot(law).see(mu=0.05, **alpha)[error] == pytest.approx(own_share * 0.05)
    assert Pilot(law).see(0.02, mu=0.05, **alpha)[error] == pytest.approx(own_share * 0.05 + other_share * 0.03)


@pytest.mark.parametrize(("law", "own_share", "other_share"), [(LAWS[0], 1.2, 2.0), (LAWS[1], 0.4, 0.25 * 0.5)])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_an_error_across_half_a_turn_is_the_shorter_way_around(law, own_share, other_share, side):
    """Reference 179 deg, bank -179 deg: 2 deg too far right; a neighbour that is 3 deg off: 1 deg less."""
    degree = math.radians(side)
    error = "E_mu" if law == LAWS[0] else "e_mu"
    seen = Pilot(law).wanted(mu=179.0 * degree).see(3.0 * degree, mu=-179.0 * degree)[error]
    assert seen == pytest.approx(own_share * 2.0 * degree - other_share * degree)


@pytest.mark.parametrize("law", LAWS)
def test_a_bank_that_passes_half_a_turn_jumps_in_no_estimate(law):
    """Rolling on at 0.4 rad/s, told within half a turn: estimates and commands are those of a roll elsewhere."""
    shown = {"upright": [], "inverted": []}
    for where, bank in (("upright", 0.0), ("inverted", math.pi)):
        pilot = Pilot(law).wanted(mu=bank)
        for n in range(-10, 11):
            roll = 0.4 * pilot.period * n
            mu = wrapped(bank + roll)
            signals = pilot.see(mu=mu, alpha=math.radians(2.0), p=0.4)
            names = ("E_mu", "p_d") if law == LAWS[0] else ("e_mu", "p_d", "D1_mu", "D2_p")
            shown[where].append([signals[name] for name in names])
    # The networks see the bank itself; they have hardly begun to learn.
    assert np.array(shown["inverted"]) == pytest.approx(np.array(shown["upright"]), abs=0.05)


def test_a_neighbour_silent_for_half_a_second_is_left_out():
    pilot = Pilot("directed_attitude")
    pilot.inbox.age[0, :] = 0.51
    assert pilot.see(0.02, mu=0.05)["e_mu"] == pytest.approx(0.4 * 0.05)
    pilot = Pilot("directed_attitude")
    pilot.inbox.age[0, :] = 0.49
    assert pilot.see(0.02, mu=0.05)["e_mu"] == pytest.approx(0.4 * 0.05 + 0.125 * 0.03)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(
    "state",
    [
        {"V": 0.1, "beta": 1.55, "mu": 3.0},
        {"V": 60.0, "alpha": -1.4, "p": 20.0, "q": -20.0, "r": 20.0},
        {"mu": 3.1, "alpha": -3.1, "beta": -1.57},
    ],
)
def test_no_state_however_lost_makes_a_command_that_is_not_a_number(law, state):
    pilot = Pilot(law)
    for _ in range(5):
        pilot.see(0.5, **state)
    assert all(abs(deflection) <= 1.0472 for deflection in pilot.command)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(
    ("gains", "because"),
    [
        ({"eps0": 0.1}, "eps0 = 0.1 rad: must be at least eps_inf = 0.15"),
        ({"edge": 1.0}, "edge = 1: must be above 0 and below 1"),
        ({"k_up": 0.0}, "k_up = 0: must be above 0"),
    ],
)
def test_gains_that_break_a_condition_are_refused(law, gains, because):
    scheme = find(law)
    problems = scheme.check(scheme.gains("flight", gains), FLIGHT)
    assert any(problem.fatal and because in problem.text for problem in problems), problems
    assert not [problem for problem in scheme.check(scheme.gains("flight", {}), FLIGHT) if problem.fatal]


def test_what_only_one_law_demands():
    first, second = (find(law) for law in LAWS)
    odd = first.check(first.gains("flight", {"substeps": 5.0}), FLIGHT)
    assert [problem.fatal for problem in odd] == [False]
    assert first.check(first.gains("flight", {"upsilon": 1.2}), FLIGHT)[0].fatal
    slow = Flight(RING, 0.1, 0.1, 0.1, 0.0, False)
    assert any("k1" in problem.text for problem in second.check(second.gains("flight", {}), slow))


@pytest.mark.parametrize(
    ("gains", "steep"),
    [({}, False), ({"eps_inf": 0.1}, True), ({"lambda1": 0.8, "lambda2": 0.5}, True), ({"lambda2": 0.2}, False)],
)
def test_a_tighter_bound_is_a_higher_gain_of_which_the_second_law_warns(gains, steep):
    """Reference section on sampled-data limits: phi / (k eps_inf) beyond 5.5 1/rad; 5.45 on this ring as published."""
    law = find("directed_attitude")
    found = [p for p in law.check(law.gains("flight", gains), FLIGHT) if "phi / (k eps_inf)" in p.text]
    assert [p.fatal for p in found] == [False] * steep


@pytest.mark.parametrize(
    ("law", "gains", "fatal", "because"),
    [
        (LAWS[0], {"observer": 90.0}, False, "observer = 90 rad/s: 0.45 of the control rate"),
        (LAWS[0], {"observer": 5000.0}, True, "observer: its rate 5000 1/s is unstable"),
        (LAWS[0], {"observer": 5.0}, False, "observer = 5 rad/s: slower than the faults"),
        (LAWS[0], {"w_u": 208.0}, True, "w_u = 208 rad/s: must be below 207 rad/s"),
        (LAWS[0], {"neighbour_filter": 25.0}, False, "neighbour_filter = 25 rad/s"),
        (LAWS[1], {"tau": 0.001}, True, "tau: its rate 1000 1/s is unstable"),
        (LAWS[1], {"tau": 0.007}, False, "tau = 0.007 s: shorter than the control period, 0.01 s"),
        (LAWS[1], {"tau": 0.3}, False, "tau = 0.3 s: slower than the loop"),
        (LAWS[1], {"k9": 40.0}, False, "k9 = 40 1/s: the rates' observer makes the loop cycle beyond 30 1/s"),
    ],
)
def test_what_cannot_be_sampled_well_is_said(law, gains, fatal, because):
    """At the control rates of the two chapters; where trouble begins is measured, see the laws."""
    scheme = find(law)
    flight = replace(FLIGHT, period=0.005 if law == LAWS[0] else 0.01)
    problems = scheme.check(scheme.gains("flight", gains), flight)
    assert [problem.fatal for problem in problems if because in problem.text] == [fatal], problems
    assert scheme.check(scheme.gains("flight", {}), flight) == []


@pytest.mark.parametrize(("w", "bounded"), [(206.0, True), (208.0, False)])
def test_the_limit_of_the_low_pass_is_that_of_its_steps(w, bounded):
    y, rate = (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for _ in range(5000):
        y, rate = butterworth_step(y, rate, (0.0, 0.0, 0.0), w, 0.005)
    assert (abs(y[0]) < 10.0) == bounded


def test_each_law_demands_its_own_graph():
    one_way = Graph((1, 2, 3), (), {(1, 2): 1.0, (2, 3): 1.0, (3, 1): 1.0})
    one_way.require(find("directed_attitude").graph)
    with pytest.raises(GraphError):
        one_way.require(find("attitude_synchronization").graph)
    law = find("directed_attitude")
    alone = replace(FLIGHT, graph=Graph((1, 2, 3), (), {(1, 2): 1.0, (2, 1): 1.0}))
    (warned,) = law.check(law.gains("flight", {}), alone)
    assert not warned.fatal
    assert "nothing that UAV 1 sends reaches UAV 3" in warned.text


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_a_flight_in_plain_python_has_the_same_bits(law):
    """Four aircraft with loss and noise for the first tenth of a second, law and equations of motion."""
    program = (
        "import hashlib, numpy as np\n"
        "from ftcc.groundside.scenario.mission import resolve\n"
        "from ftcc.groundside.scenario.loading import load\n"
        "from ftcc.groundside.simulation import fly_in_memory\n"
        f"scenario = load({law!r}, settings=('channel.loss=0.3', 'noise.p=0.01'), duration=0.12)\n"
        "flight = fly_in_memory(resolve(scenario))\n"
        "assert np.isfinite(flight.signals).all()\n"
        "print(hashlib.sha256(flight.truth.tobytes() + flight.signals.tobytes()).hexdigest())"
    )

    def run(plain: str) -> str:
        environment = {**os.environ, "NUMBA_DISABLE_JIT": plain}
        return subprocess.run(
            [sys.executable, "-c", program], cwd=REPOSITORY, env=environment, capture_output=True, text=True, check=True
        ).stdout

    assert run("1") == run("0")
