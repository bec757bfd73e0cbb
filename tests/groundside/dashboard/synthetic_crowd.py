"""A synthetic swarm of any number of UAVs, to test the cost and the drawing of big swarms."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ftcc.groundside.dashboard.snapshot import Event, LinkState, Pace, Snapshot, UavState
from ftcc.groundside.dashboard.subject import Subject
from ftcc.link.graph import Graph
from tests.groundside.dashboard.synthetic_swarm import SUBJECT

BROKEN = {0.2: (17, 0.6), 0.5: (58, 0.3), 0.8: (83, 0.8)}
"""Faults: share of the flight at which it comes, UAV and remaining effectiveness of its elevator."""
SILENT = (41, 0.6)
"""UAV that falls silent, and when."""
DEAF = (72, 0.4)
"""UAV whose radio is cut, and when."""
_APART = 40.0
"""Between neighbours of the block in which the swarm flies, m."""
_STALL = (Pace(5.2, 10.0, "both cores busy, autopilots 61 %", "try --pack auto"), Pace(10.0, 10.0))


@functools.cache
def graph(n: int, leaders: int = 4) -> Graph:
    """Followers in a ring, each beside its two neighbours on either side; each leader is received at two places."""
    followers = tuple(range(1, n - leaders + 1))
    k = len(followers)
    weights = {
        (followers[i], followers[(i + d) % k]): 0.4 for i in range(k) for d in (-2, -1, 1, 2) if (i + d) % k != i
    }
    for j in range(leaders):
        for d in range(2):
            weights[followers[(j * k // leaders + d) % k], n - leaders + 1 + j] = 0.8
    return Graph(followers, tuple(range(n - leaders + 1, n + 1)), weights)


def subject(n: int) -> Subject:
    """What a dashboard shows of ``n`` UAVs."""
    return replace(SUBJECT, title=f"synthetic swarm of {n}", graph=graph(n))


@functools.cache
def _weights(n: int) -> np.ndarray:
    return graph(n).hull_weights


@functools.cache
def _senders(n: int) -> dict[int, list[int]]:
    found: dict[int, list[int]] = {uav: [] for uav in graph(n).uavs}
    for receiver, sender in graph(n).weights:
        found[receiver].append(sender)
    return found


def _leaders_at(n: int, t: float) -> np.ndarray:
    levels = np.linspace(-60.0, 60.0, len(graph(n).leaders))
    return 1000.0 + levels * (1.0 + 0.3 * math.sin(0.1 * t)) + 20.0 * math.sin(0.05 * t)


def snapshot(n: int, t: float, duration: float = 60.0, abreast: bool = False) -> Snapshot:
    """The swarm at ``t``, s, of a flight of ``duration``; ``abreast``: all in one vertical plane, not in a block."""
    crew = graph(n)
    leaders = _leaders_at(n, t)
    z, later = _weights(n) @ leaders, _weights(n) @ _leaders_at(n, t + 0.01)
    columns = math.ceil(math.sqrt(n))
    broken = {uav: left for when, (uav, left) in BROKEN.items() if t >= when * duration}
    uavs = {}
    for i, uav in enumerate(crew.uavs):
        now = t
        if uav == SILENT[0] and t > SILENT[1] * duration:
            now = SILENT[1] * duration
        leads = uav in crew.leaders
        level = float(leaders[i - len(crew.followers)] if leads else z[i])
        gamma = 0.0 if leads else math.asin(float(later[i] - z[i]) / 0.01 / 30.0)
        left = broken.get(uav, 1.0)
        S1 = 0.0 if leads else 0.2 * math.sin(0.5 * t + i) + (2.0 * (1.0 - left) if left < 1.0 else 0.0)
        row, column = divmod(i, columns)
        alpha = 0.032 + 0.02 * math.sin(t + i)
        truth = {
            "x": 30.0 * now - (0.0 if abreast else _APART * row),
            "y": 0.0 if abreast else _APART * (column - 0.5 * columns),
            "z": level + S1,
            "V": 30.0 + 0.1 * math.sin(t + i),
            "gamma": gamma,
            "chi": 0.0,
            "mu": 0.2 * math.sin(0.2 * t + i),
            "alpha": alpha,
            "beta": 0.0,
            "theta": gamma + alpha,
            "p": 0.0,
            "q": 0.0,
            "r": 0.0,
        }
        if leads:
            uavs[uav] = UavState(now, truth, {}, {}, {}, {}, {}, {})
            continue
        command = {"thrust": 21.3 + math.sin(0.3 * t + i), "elevator": -0.2 - 0.05 * math.sin(t + i)}
        deaf = uav == DEAF[0] and t > DEAF[1] * duration
        age = 0.05 + (t - DEAF[1] * duration if deaf else 0.0)
        uavs[uav] = UavState(
            t=now,
            truth=truth,
            command=command,
            acting=command | {"elevator": left * command["elevator"]},
            effectiveness={"elevator": left, "thrust": 1.0},
            bias={"elevator": 0.0, "thrust": 0.0},
            signals={"zhat": level, "d1_hat": 0.2 + 0.01 * math.sin(t + i), "S1": S1, "S5": 0.02 * math.cos(t + i)},
            links={j: LinkState(age, round(20 * (t - age)), 0, deaf) for j in _senders(n)[uav]},
            disturbances={"d1": 0.2},
            mode="mission",
        )
    return Snapshot(t, uavs, pace=_STALL[t > 0.7 * duration])


def flight(n: int, duration: float = 60.0, rate: float = 10.0, abreast: bool = False) -> Iterator[Snapshot]:
    """Snapshots from 0 to ``duration``, with their events."""
    events = [Event(0.0, "info", "engaged")]
    events += [Event(at * duration, "error", f"elevator at {100 * left:.0f} %", u) for at, (u, left) in BROKEN.items()]
    for k in range(round(duration * rate) + 1):
        t = k / rate
        new = tuple(event for event in events if event.t <= t)
        events = [event for event in events if event.t > t]
        yield replace(snapshot(n, t, duration, abreast), events=new)
