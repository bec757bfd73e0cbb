"""Swarms, lies and defences of ``attack_studies.py``: a dozen UAVs of five chapters on graphs that stand liars or not.

A swarm is what `ftcc new` writes for its scheme, on a graph that is made here: followers in a row (around the fire in a
ring), each of which hears so many to either side; a few hear a leader. Lies are drawn from a
seed and a number: the same for every defence.
"""

from __future__ import annotations

import functools
import itertools
import tempfile
import tomllib
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.schemes import find
from ftcc.groundside.claims import evaluate_expression
from ftcc.groundside.generator import Request
from ftcc.groundside.generator.writing import text_of
from ftcc.groundside.scenario import Mission, load, resolve
from ftcc.groundside.simulation import fly_in_memory
from ftcc.link.graph import Graph

DURATION = 32.0
"""s."""
BEGIN = (6.0, 10.0)
"""When lies begin, s."""
REACH = {"sparse": 1, "F = 1": 3, "F = 2": 5}
"""By graph, how many to either side a follower hears: 2 F + 1. As many in the middle hear a single leader; of two
leaders each is heard by the last one or three of its end of the row."""
LIARS = {"sparse": 1, "F = 1": 1, "F = 2": 2}
HULL = 1.0
"""Outside the leaders' hull by more, m, counts; as for the verdict."""
_LEADER_WEIGHT = 0.4
NOT_DEFENDED, NO_MSR, ALL = "undefended", "all but MSR", "all together"
SINGLE = ("offset", "drift", "freeze", "replay", "noise", "oscillate", "opposite", "sybil")
SEVERAL = ("offset", "drift", "freeze", "replay", "noise", "oscillate", "opposite", "collude")


@dataclass(frozen=True)
class Chapter:
    """What differs between the chapters."""

    number: int
    scheme: str
    leaders: int
    judged: Mapping[str, float]
    """By expression, how large it may become with a honest follower."""
    agreed: Mapping[str, str]
    """By shared estimate, the leaders' column between which it must stay; empty where none is shared."""
    lied: tuple[tuple[str, ...], ...]
    """Signals that a lie is about, one of these groups."""
    sizes: Mapping[str, tuple[float, float]]
    """By signal, least and largest lie, in its unit."""
    rates: Mapping[str, tuple[float, float]]
    """By signal, slowest and fastest drift."""
    targets: Mapping[str, tuple[float, float]]
    """By signal, what those who collude count their target from at t = 0, and its rate."""
    gate: Mapping[str, float]
    trust: Mapping[str, float]
    changes: Mapping[str, Any] = field(default_factory=dict)
    """Of what `ftcc new` writes."""

    def defences(self, F: int) -> dict[str, dict[str, float]]:
        """Return the settings by defence."""
        msr, hull = {"F": float(F)}, {"hull": float(F)}
        return {
            "MSR": msr,
            "hull": hull,
            "gate": dict(self.gate),
            "trust": dict(self.trust),
            NO_MSR: hull | dict(self.gate) | dict(self.trust),
            ALL: msr | hull | dict(self.gate) | dict(self.trust),
        }


_ALTITUDE, _ALTITUDE_RATE = (15.0, 60.0), (0.5, 4.0)
"""m, m/s."""
_BETWEEN = {
    "start": {"uav": {str(uav): {"z": 1010.0} for uav in range(1, 11)}},
    "leaders": {
        "11": {"z": 1000.0, "commands": [{"at": 5.0, "altitude": 1030.0}]},
        "12": {"z": 1020.0, "commands": [{"at": 5.0, "altitude": 1050.0}]},
    },
}
_CLIMB = {"leaders": {"12": {"commands": [{"at": 5.0, "altitude": 1012.0}]}}}
"""So slowly that the sparse graph can follow, too."""
_HEIGHT = {"jump": 3.0, "most_speed": 10.0}
_HEIGHT_TRUST = {"past": 3.0, "crowd": 25.0}

CHAPTERS = {
    chapter.scheme: chapter
    for chapter in (
        Chapter(
            3, "prescribed_performance", 1, {"z - z_d": 2.0}, {}, (("zhat",),), {"zhat": _ALTITUDE},
            {"zhat": _ALTITUDE_RATE}, {"zhat": (1010.0, 0.0)}, _HEIGHT, {"past": 3.0, "crowd": 5.0}, _CLIMB,
        ),
        Chapter(
            4, "nearest_neighbour", 1, {"z - z_d": 2.0, "V - V[12]": 1.0}, {}, (("z",), ("V",), ("V", "z")),
            {"z": _ALTITUDE, "V": (2.0, 6.0)}, {"z": _ALTITUDE_RATE, "V": (0.2, 1.0)},
            {"z": (1010.0, 0.0), "V": (30.0, 0.0)}, _HEIGHT | {"jump_speed": 1.0, "most_accel": 5.0},
            {"past": 3.0, "crowd": 5.0, "past_speed": 1.0, "crowd_speed": 2.0}, _CLIMB,
        ),
        Chapter(
            5, "containment", 2, {"hull_distance": HULL}, {"zhat": "z"}, (("zhat",),), {"zhat": _ALTITUDE},
            {"zhat": _ALTITUDE_RATE}, {"zhat": (1010.0, 0.0)}, _HEIGHT, _HEIGHT_TRUST, _BETWEEN,
        ),
        Chapter(
            6, "finite_time_containment", 2, {"hull_distance": HULL, "hull_distance_x": HULL},
            {"z_hat": "z", "x_hat": "x"}, (("z_hat",), ("x_hat",), ("x_hat", "z_hat")),
            {"x_hat": _ALTITUDE, "z_hat": _ALTITUDE}, {"x_hat": _ALTITUDE_RATE, "z_hat": _ALTITUDE_RATE},
            {"x_hat": (20.0, 30.0), "z_hat": (1010.0, 0.0)}, _HEIGHT | {"most_speed": 45.0},
            {"past": 3.0, "crowd": 50.0}, _BETWEEN,
        ),
        Chapter(
            9, "fire_monitoring", 0, {"x - x_ref": 5.0, "y - y_ref": 5.0, "z - z_ref": 2.0}, {},
            (("Pt_x",), ("Pt_y",), ("Pt_z",), ("Pt_x", "Pt_y", "Pt_z")),
            {f"Pt_{axis}": _ALTITUDE for axis in "xyz"}, {f"Pt_{axis}": _ALTITUDE_RATE for axis in "xyz"},
            {f"Pt_{axis}": (0.0, 0.0) for axis in "xyz"}, {"jump": 3.0, "most_speed": 10.0},
            {"past": 3.0, "crowd": 10.0},
        ),
    )
}  # fmt: skip
"""By scheme."""


def graph_of(chapter: Chapter, kind: str) -> Graph:
    """Return a graph of a dozen UAVs; the followers' weights are those of Metropolis."""
    count = 12 - chapter.leaders
    followers, leaders = tuple(range(1, count + 1)), tuple(range(count + 1, 13))
    reach = REACH[kind]

    def near(i: int, j: int) -> bool:
        apart = abs(i - j)
        return (min(apart, count - apart) if not leaders else apart) <= reach

    pairs = [pair for pair in itertools.combinations(followers, 2) if near(*pair)]
    degree = {uav: sum(uav in pair for pair in pairs) for uav in followers}
    weights: dict[tuple[int, int], float] = {}
    for i, j in pairs:
        weights[i, j] = weights[j, i] = round(1.0 / (1.0 + max(degree[i], degree[j])), 4)
    begin, at_ends = (count - reach) // 2, min(reach, 3)
    listeners = {1: [followers[begin : begin + reach]], 2: [followers[:at_ends], followers[-at_ends:]]}
    for leader, heard_by in zip(leaders, listeners.get(len(leaders), ()), strict=True):
        weights |= {(uav, leader): _LEADER_WEIGHT for uav in heard_by}
    return Graph(followers, leaders, dict(sorted(weights.items())))


@functools.cache
def mission_of(scheme: str, kind: str, defence: str) -> Mission:
    """Return a swarm with a defence, in which nobody lies."""
    return _resolved(CHAPTERS[scheme], kind, defence, {})


def write_scenario(chapter: Chapter, kind: str, folder: Path) -> Path:
    """Write a swarm as a scenario."""
    graph = graph_of(chapter, kind)
    request = Request(
        scheme=chapter.scheme, followers=len(graph.followers), leaders=chapter.leaders or None, faults=0,
        graph="chain",
    )  # fmt: skip
    text = text_of(request, "python docs/attack_studies.py", find(chapter.scheme), graph, (), {})
    file = folder / f"{chapter.scheme}.toml"
    file.write_text(text, encoding="utf-8")
    return file


def _resolved(chapter: Chapter, kind: str, defence: str, more: Mapping[str, Any]) -> Mission:
    changes: dict[str, Any] = {**chapter.changes, "claims": [], "record_rate": 10.0, **more}
    if defence != NOT_DEFENDED:
        settings = chapter.defences(LIARS[kind])[defence]
        changes["defence"] = {**settings, **({"trusted": ["leaders"]} if chapter.leaders else {})}
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        # That the sparse graph stands no liar is known.
        warnings.simplefilter("ignore")
        file = Path(folder) / f"{chapter.scheme}.toml"
        file.write_text(_text(chapter.scheme, kind), encoding="utf-8")
        return resolve(load(file, form="flight", changes=changes, duration=DURATION))


@functools.cache
def _text(scheme: str, kind: str) -> str:
    with tempfile.TemporaryDirectory() as folder:
        return write_scenario(CHAPTERS[scheme], kind, Path(folder)).read_text(encoding="utf-8")


def with_lies(scheme: str, kind: str, defence: str, attacks: list[dict[str, Any]]) -> Mission:
    """Return a swarm with a defence and lies."""
    mission = mission_of(scheme, kind, defence)
    if not attacks:
        return mission
    lying = _resolved(CHAPTERS[scheme], kind, NOT_DEFENDED, {"attacks": attacks})
    told = {spec.uav: spec.attacks for spec in lying.autopilots}
    # The robustness of a graph is computed once for a defence, and not for every lie.
    return replace(mission, autopilots=tuple(replace(one, attacks=told[one.uav]) for one in mission.autopilots))


def lies_of(chapter: Chapter, kind: str, number: int, seed: int = 1) -> list[dict[str, Any]]:
    """Draw who lies, how, when and how much."""
    graph, liars = graph_of(chapter, kind), LIARS[kind]
    random = np.random.default_rng([seed, chapter.number, liars, number])
    what = str(random.choice(SINGLE if liars == 1 else SEVERAL))
    who = [int(uav) for uav in random.choice(graph.followers, liars, replace=False)]
    at = round(float(random.uniform(*BEGIN)), 2)
    signals = list(chapter.lied[random.integers(len(chapter.lied))])
    size = {s: round(float(random.choice([-1.0, 1.0]) * random.uniform(*chapter.sizes[s])), 2) for s in signals}
    rate = {s: round(float(random.uniform(*chapter.rates[s]) * np.sign(size[s])), 3) for s in signals}
    period, delay, onset = (round(float(random.uniform(*span)), 1) for span in ((5.0, 30.0), (5.0, 15.0), (0.0, 10.0)))
    lie: dict[str, Any] = {"at": at, "kind": what, "signals": signals}
    lie |= {"uav": who[0]} if liars == 1 else {"uavs": who}
    if what in ("offset", "noise", "oscillate", "sybil"):
        lie["size"] = {s: abs(size[s]) if what == "noise" else size[s] for s in signals}
    if what == "drift":
        lie |= {"rate": rate, "size": {s: abs(size[s]) for s in signals}}
    if what == "oscillate":
        lie["period"] = period
    if what == "replay":
        lie["delay"] = delay
    if what == "sybil":
        heard = {uav: set(graph.senders(uav)) for uav in graph.uavs}
        beside = sorted(set().union(*(heard[uav] for uav in graph.uavs if who[0] in heard[uav])) & {*graph.followers})
        victims = [uav for uav in beside if uav != who[0]]
        lie["as"] = int(random.choice(victims))
    if what == "collude":
        targets = {s: chapter.targets[s] for s in signals}
        lie["size"] = {s: round(c + r * at + size[s], 2) for s, (c, r) in targets.items()}
        lie |= {"rate": {s: r for s, (_, r) in targets.items()}, "onset": max(onset, 0.1)}
    return [lie]


class Outcome(NamedTuple):
    """What a flight did to the honest followers from the beginning of the lies on, over what is allowed."""

    worst: float
    """Largest of what is judged; inf if an honest one was lost."""
    end: float
    """Likewise in the last 2 s, as the verdict judges errors."""
    agreed: float
    """What is largest of that on which followers agree before they fly it; nan where nothing such is shared."""


def fly(chapter: Chapter, kind: str, defence: str, lies: list[dict[str, Any]]) -> Outcome:
    """Fly a swarm with lies; without any what honest ones do from the earliest beginning of lies on."""
    mission = with_lies(chapter.scheme, kind, defence, lies)
    flight = fly_in_memory(mission)
    dishonest = {uav for lie in lies for uav in lie.get("uavs", [lie.get("uav")])}
    begin = min((lie["at"] for lie in lies), default=BEGIN[0])
    worst, end, agreed = 0.0, 0.0, 0.0 if chapter.agreed else np.nan
    graph = mission.graph
    for uav in graph.followers:
        if uav in dishonest:
            continue
        if uav in flight.lost:
            return Outcome(np.inf, np.inf, np.nan)
        t = flight.column("t", uav)
        late = t >= begin
        for expression, bound in chapter.judged.items():
            values = np.abs(evaluate_expression(expression, flight, graph, uav)) / bound
            worst, end = max(worst, float(values[late].max())), max(end, float(values[t >= DURATION - 2.0].max()))
        for estimate, column in chapter.agreed.items():
            led = np.array([flight.column(column, leader)[late] for leader in graph.leaders])
            own = flight.column(estimate, uav)[late]
            agreed = max(agreed, float(np.maximum(own - led.max(axis=0), led.min(axis=0) - own).max()) / HULL)
    return Outcome(worst, end, agreed)


TRACKED = {
    "prescribed_performance": "z - z_d",
    "nearest_neighbour": "z - z_d",
    "containment": "z - z_r",
    "finite_time_containment": "S3",
    "fire_monitoring": "sqrt((x - x_ref)**2 + (y - y_ref)**2 + (z - z_ref)**2)",
}
"""By scheme, the tracking error, m."""
_SETTLED = 0.5
"""m."""


class Cost(NamedTuple):
    """How well a swarm flies where nobody lies."""

    error: float
    """Root mean square of `TRACKED` from `BEGIN` on, m; leaders climb."""
    place: float
    """Of followers between leaders likewise how far they are off the place of their weights, m; nan of others."""
    delay: float
    """Time until everybody who began off its altitude stays within 0.5 m of where it ends, leaders level, s."""


def cost(chapter: Chapter, kind: str, defence: str, number: int, seed: int = 2) -> Cost:
    """Fly a swarm in which nobody lies from random altitudes, once behind climbing leaders, once behind level ones."""
    random = np.random.default_rng([seed, chapter.number, number])
    base = _resolved(chapter, kind, NOT_DEFENDED, {})
    off = {spec.uav: float(random.uniform(-8.0, 8.0)) for spec in base.autopilots if spec.role == "follower"}
    text = tomllib.loads(_text(chapter.scheme, kind))
    middle = {1: 1000.0, 2: 1010.0}.get(chapter.leaders)
    starts = text["start"]["uav"]
    begun = {str(uav): {"z": round(z + (middle or starts[str(uav)]["z"]), 2)} for uav, z in off.items()}
    climbing = fly_in_memory(_resolved(chapter, kind, defence, {"start": {"uav": begun}}))
    led = chapter.changes.get("leaders", {})
    still = {str(uav): {**led.get(str(uav), {}), "commands": []} for uav in base.graph.leaders}
    level = fly_in_memory(_resolved(chapter, kind, defence, {"start": {"uav": begun}, "leaders": still}))
    errors, places, delay = [], [], 0.0
    for uav in off:
        t = climbing.column("t", uav)
        errors.append(evaluate_expression(TRACKED[chapter.scheme], climbing, base.graph, uav)[t >= BEGIN[0]])
        if chapter.agreed:
            places.append(evaluate_expression("z - z_d", climbing, base.graph, uav)[t >= BEGIN[0]])
        z, t = level.column("z", uav), level.column("t", uav)
        away = np.flatnonzero(np.abs(z - z[-1]) > _SETTLED)
        delay = max(delay, float(t[away[-1]]) if len(away) else 0.0)
    return Cost(_rms(errors), _rms(places) if places else np.nan, delay)


def _rms(values: list[NDArray[np.float64]]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(values) ** 2)))
