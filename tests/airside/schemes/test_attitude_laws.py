"""The attitude laws of chapters 7 and 8: single steps, their conditions, and the same bits in plain Python."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path

import pytest

from ftcc.airside.autopilots import build, tick_of
from ftcc.airside.scheme import Flight
from ftcc.airside.schemes import find
from ftcc.groundside.mission import resolve
from ftcc.groundside.scenario import load
from ftcc.link.graph import Graph, GraphError

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
        self.tick = tick_of(scheme)
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
        assert self.tick.control(self.autopilots, self.inbox, 0, self.period)
        names = (signal.name for signal in self.scheme.signals)
        return dict(zip(names, self.autopilots.signals[0].tolist(), strict=True))

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
        ({"edge": 1.0}, "edge = 1: must lie between 0 and 1"),
        ({"k_up": 0.0}, "k_up = 0: must be > 0"),
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


def test_each_law_demands_its_own_graph():
    one_way = Graph((1, 2, 3), (), {(1, 2): 1.0, (2, 3): 1.0, (3, 1): 1.0})
    one_way.require(find("directed_attitude").graph)
    with pytest.raises(GraphError):
        one_way.require(find("attitude_synchronization").graph)
    with pytest.raises(GraphError):
        Graph((1, 2, 3), (), {(1, 2): 1.0, (2, 1): 1.0}).require(find("directed_attitude").graph)


@pytest.mark.parametrize("law", LAWS)
def test_a_flight_in_plain_python_has_the_same_bits(law):
    """Four aircraft with loss and noise for the first tenth of a second, law and equations of motion."""
    program = (
        "import hashlib, numpy as np\n"
        "from ftcc.groundside.mission import resolve\n"
        "from ftcc.groundside.scenario import load\n"
        "from ftcc.groundside.simulate import fly\n"
        f"flight = fly(resolve(load({law!r}, settings=('channel.loss=0.3', 'noise.p=0.01'), duration=0.12)))\n"
        "assert np.isfinite(flight.signals).all()\n"
        "print(hashlib.sha256(flight.truth.tobytes() + flight.signals.tobytes()).hexdigest())"
    )

    def run(plain: str) -> str:
        environment = {**os.environ, "NUMBA_DISABLE_JIT": plain}
        return subprocess.run(
            [sys.executable, "-c", program], cwd=REPOSITORY, env=environment, capture_output=True, text=True, check=True
        ).stdout

    assert run("1") == run("0")
