"""A synthetic swarm: smooth curves in the shape of a containment flight, for tests of what is drawn."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ftcc.airside.scheme import Quantity
from ftcc.groundside.dashboard.snapshot import Event, LinkState, Snapshot, UavState
from ftcc.groundside.dashboard.subject import Subject
from ftcc.link.graph import Graph

FOLLOWERS = (1, 2, 3, 4, 5, 6)
LEADERS = (7, 8)
_BOTH_WAYS = {(1, 2): 0.4, (1, 6): 0.5, (2, 3): 0.2, (3, 4): 0.3, (3, 5): 0.2, (4, 5): 0.2, (5, 6): 0.3}
GRAPH = Graph(
    FOLLOWERS,
    LEADERS,
    _BOTH_WAYS | {(j, i): w for (i, j), w in _BOTH_WAYS.items()} | {(1, 7): 0.9, (6, 7): 0.2, (4, 8): 0.8},
)
SIGNALS = (
    Quantity("zhat", "m", "estimated altitude reference"),
    Quantity("d1_hat", "m/s^2", "estimated disturbance of the airspeed"),
    Quantity("S1", "m", "altitude tracking error", bound=1.0),
    Quantity("S5", "m/s", "speed tracking error"),
)
LIMITS = {"elevator": (-0.7, 0.7), "thrust": (0.0, 40.0)}
SUBJECT = Subject("synthetic swarm", "containment", GRAPH, SIGNALS, LIMITS, (("d1", "m/s^2"),))

FAULT_AT = 20.0
"""Elevator of UAV 1, s."""
CUT = (12.0, 30.0)
"""Edge 4 -> 3, s."""
_HULL = GRAPH.hull_weights


def leaders_at(t: float) -> np.ndarray:
    """Altitudes of the leaders, m."""
    return np.array([1000.0 + 15.0 * (1.0 - math.exp(-t / 6.0)), 1000.0 - 12.0 * (1.0 - math.cos(0.1 * t))])


def snapshot(t: float, events: tuple[Event, ...] = ()) -> Snapshot:
    """The swarm at ``t``, s."""
    leaders = leaders_at(t)
    uavs = {}
    for i, uav in enumerate(FOLLOWERS):
        z = float(_HULL[i] @ leaders)
        later = float(_HULL[i] @ leaders_at(t + 0.01))
        gamma = math.asin((later - z) / 0.01 / 30.0)
        faulty = uav == 1 and t >= FAULT_AT
        S1 = 0.1 * math.sin(0.5 * t + i) + (0.5 * math.exp(-(t - FAULT_AT)) if faulty else 0.0)
        truth = _truth(30.0 * t - 0.5 * i, z + S1, gamma, 0.032 + 0.02 * math.sin(t + i))
        elevator = -0.2 - 0.05 * math.sin(t + i)
        command = {"thrust": 21.3 + math.sin(0.3 * t + i), "elevator": elevator}
        uavs[uav] = UavState(
            t=t,
            truth=truth,
            command=command,
            acting=command | ({"elevator": 0.7 * elevator + 0.35} if faulty else {}),
            effectiveness={"elevator": 0.7 if faulty else 1.0, "thrust": 1.0},
            bias={"elevator": 0.35 if faulty else 0.0, "thrust": 0.0},
            signals={"zhat": z, "d1_hat": 0.19, "S1": S1, "S5": 0.02 * math.cos(t + i)},
            links={j: _link(t, uav, j) for j in GRAPH.senders(uav)},
            disturbances={"d1": 0.2},
            mode="mission",
        )
    for i, uav in enumerate(LEADERS):
        truth = _truth(30.0 * t, float(leaders[i]), 0.0, 0.0)
        uavs[uav] = UavState(t, truth, {}, {}, {}, {}, {}, {})
    return Snapshot(t, uavs, events)


def flight(duration: float, rate: float = 10.0) -> Iterator[Snapshot]:
    """Snapshots from 0 to ``duration``, with their events."""
    sent: set[Event] = set()
    for k in range(round(duration * rate) + 1):
        t = k / rate
        new = tuple(event for event in EVENTS if event.t <= t and event not in sent)
        sent.update(new)
        yield snapshot(t, new)


EVENTS = (
    Event(0.0, "info", "engaged"),
    Event(CUT[0], "warning", "link 4 -> 3 cut", 3),
    Event(FAULT_AT, "error", "elevator fault: effectiveness 70 %, bias +0.35 rad", 1),
    Event(CUT[1], "info", "link 4 -> 3 restored", 3),
)


def _truth(x: float, z: float, gamma: float, alpha: float) -> dict[str, float]:
    return {
        "x": x,
        "y": 0.0,
        "z": z,
        "V": 30.0,
        "gamma": gamma,
        "chi": 0.0,
        "mu": 0.0,
        "alpha": alpha,
        "beta": 0.0,
        "theta": gamma + alpha,
        "p": 0.0,
        "q": 0.0,
        "r": 0.0,
    }


def _link(t: float, receiver: int, sender: int) -> LinkState:
    sent = round(20.0 * t)
    lost = sent // 3 if (receiver, sender) == (6, 5) else 0
    if (receiver, sender) == (3, 4) and CUT[0] <= t < CUT[1]:
        return LinkState(0.05 + t - CUT[0], round(20.0 * CUT[0]), 0, True)
    if (receiver, sender) == (6, 5) and 15.0 <= t < 17.0:
        return LinkState(0.05 + t - 15.0, sent - lost, lost, False)
    return LinkState(0.05 + 0.04 * ((7 * receiver + sender) % 2), sent - lost, lost, False)
