"""Flights with defences: what they cost without liars, and what they hold with one; the same in plain Python."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from ftcc.airside.law_checks import ignores_trust
from ftcc.airside.schemes import find, names
from ftcc.groundside import Flight, ScenarioError, load, simulate
from ftcc.groundside.scenario import resolve

FOLLOWERS = range(1, 7)
TOP = 1028.9
"""Altitude of the upper honest leader after 100 s, m."""


def everybody_hears_everybody(scheme: str) -> list[dict[str, Any]]:
    plan = load(scheme, form="flight").plan
    followers, leaders = plan.uavs.followers, plan.uavs.leaders
    edges: list[dict[str, Any]] = [{"between": [*pair], "weight": 0.3} for pair in itertools.combinations(followers, 2)]
    edges += [{"from": leader, "to": uav, "weight": 0.5} for leader in leaders for uav in followers]
    # The leaders of chapter 6 wait for each other.
    return edges + [{"between": [*pair], "weight": 1.0} for pair in itertools.combinations(leaders, 2)]


def led_astray(**defence: Any) -> Flight:
    """Six followers that hear each other, two honest leaders, and a third "leader", 9, that climbs to 1140 m.

    It is a stubborn liar, whose say is as great as that of an honest leader.
    """
    filtered = {"frequency": 0.05, "damping": 0.9}
    liar = {
        "y": 40.0,
        "z": 1000.0,
        "V": 30.0,
        "altitude_filter": filtered,
        "commands": [{"at": 15.0, "altitude": 1140}],
    }
    edges = everybody_hears_everybody("containment")[: len(FOLLOWERS) * 5 // 2 + 2 * len(FOLLOWERS)]
    settings: dict[str, Any] = {
        "faults": [],
        "disturbances": [],
        "uavs": {"leaders": [7, 8, 9]},
        "leaders": {"7": {"commands": [{"at": 15.0, "altitude": 1030.0}]}, "9": liar},
        "graph": {"edges": [*edges, *({"from": 9, "to": uav, "weight": 0.5} for uav in FOLLOWERS)]},
    }
    if defence:
        settings["defence"] = defence
    return simulate("containment", form="flight", settings=settings, duration=100.0)


def farthest_out(flight: Flight) -> float:
    """How far an honest follower is off the honest leaders' altitudes at worst, m."""
    one, other = flight.column("z", 7), flight.column("z", 8)
    low, high = np.minimum(one, other), np.maximum(one, other)
    z = [flight.column("z", uav) for uav in FOLLOWERS]
    return max(float(np.maximum(own - high, low - own).max()) for own in z)


@pytest.mark.filterwarnings("ignore::ftcc.groundside.ScenarioWarning")
def test_a_stubborn_liar_draws_followers_out_of_the_hull_unless_they_defend_themselves():
    assert farthest_out(led_astray()) > 20.0
    for defence in ({"F": 1}, {"F": 1, "trusted": [7, 8]}, {"hull": 1}, {"hull": 1, "trusted": [7, 8]}):
        assert farthest_out(led_astray(**defence)) < 0.1, defence


@pytest.mark.filterwarnings("ignore::ftcc.groundside.ScenarioWarning")
def test_who_leaves_whom_out_is_an_event_and_stands_with_the_links():
    flight = led_astray(F=1, trusted=[7, 8])
    told = {(uav, text) for _, uav, severity, text in flight.events if severity == "info"}
    assert {(uav, "leaves UAV 9 out of its sums: its values are the most extreme") for uav in FOLLOWERS} <= told
    links = flight.link_table()
    last = links["t"] == links["t"].max()
    assert (links["trust"][last & (links["sender"] == 9)] < 0.01).all()
    assert (links["trust"][last & np.isin(links["sender"], [7, 8])] == 1.0).all()


SETTLED = {"finite_time_containment": 60.0}
"""Time in which followers get to their places, s; in other schemes they begin there."""


@pytest.mark.filterwarnings("ignore::ftcc.groundside.ScenarioWarning")
@pytest.mark.parametrize("scheme", names())
def test_w_msr_among_honest_neighbours_leaves_the_verdict_as_it_is(scheme):
    """Everybody hears everybody, leaders are trusted; the gate lets every honest record pass."""
    gate = {"jump": 1.0, "jump_speed": 2.0, "jump_angle": 0.1, "most_speed": 60.0, "most_accel": 20.0, "most_turn": 2.0}
    graph = {"graph": {"edges": everybody_hears_everybody(scheme)}}
    duration = SETTLED.get(scheme, 8.0)
    alone = simulate(scheme, form="flight", settings=graph, duration=duration)
    defence = {"F": 1, "trusted": ["leaders"], **gate}
    defended = simulate(scheme, form="flight", settings={**graph, "defence": defence}, duration=duration)
    assert defended.verdict.word == alone.verdict.word != "failed"
    assert not [event for event in defended.events if "distrusts" in event[3]]
    assert (alone.link_table()["trust"] == 1.0).all()


PLAIN = """
import hashlib, sys
from ftcc.groundside import simulate
flight = simulate("containment", form="flight", duration=1.5, settings={"defence": {
    "F": 1, "hull": 1, "jump": 0.05, "past": 0.02, "crowd": 20.0, "oldest": 1.0}})
parts = (flight.signals, flight.truth, flight.links)
print(hashlib.sha256(b"".join(part.tobytes() for part in parts)).hexdigest())
"""


@pytest.mark.filterwarnings("ignore::ftcc.groundside.ScenarioWarning")
def test_defences_compiled_and_in_plain_python_give_the_same_bits():
    found = [
        subprocess.run(
            [sys.executable, "-W", "ignore", "-c", PLAIN],
            env={**os.environ, "NUMBA_DISABLE_JIT": plain},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for plain in ("0", "1")
    ]
    assert found[0] == found[1] != ""


def check(**defence: Any) -> tuple[str, ...]:
    return resolve(load("containment", form="flight", settings={"defence": defence})).warnings


def test_a_check_says_which_edges_the_graph_lacks():
    (text,) = (one for one in check(F=1, trusted=["leaders"]) if one.startswith("defence.F"))
    assert "strongly 2-robust towards its leaders, its leaders trusted" in text
    assert "these further edges would do: 7->5, 7->3, 7->2" in text
    (text,) = (one for one in check(F=1) if one.startswith("defence.F"))
    assert "strongly 1-robust" in text
    assert "needs 3 leaders, or a trusted one" in text


@pytest.mark.parametrize(
    ("defence", "text"),
    [
        ({"trusted": [99]}, "defence.trusted.0: there is no UAV 99; UAVs are 1, 2, 3, 4, 5, 6, 7, 8"),
        ({"G": 1}, "defence: there is no setting G; there are trusted, F, hull"),
        ({"hull": -1}, "defence: hull = -1: must be a whole number from 0"),
        ({"trusted": ["everybody"]}, "defence.trusted.0"),
    ],
)
def test_wrong_defences_are_refused(defence, text):
    with pytest.raises(ScenarioError) as refused:
        check(**defence)
    assert text in str(refused.value)


@pytest.mark.parametrize("scheme", names())
def test_every_law_weighs_by_trust(scheme):
    assert ignores_trust([find(scheme).module]) is None


def test_a_law_that_sums_without_trust_is_named(tmp_path):
    module = ModuleType("mine")
    module.__file__ = str(tmp_path / "mine.py")
    text = "def step(s, own, heard, reference, model, gains, dt):\n    return heard.weight[0] * heard.values[0, 0]\n"
    (tmp_path / "mine.py").write_text(text, encoding="utf-8")
    assert "does not weigh by heard.trust" in str(ignores_trust([module]))
    deaf = ModuleType("deaf")
    deaf.__file__ = str(tmp_path / "deaf.py")
    (tmp_path / "deaf.py").write_text("def step(s, own):\n    return own.z\n", encoding="utf-8")
    assert ignores_trust([deaf]) == "the law hears nobody"
