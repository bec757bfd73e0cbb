"""An aircraft and its neighbours as a law sees them, and a flight as a check sees it; chapters 3, 4 and 6."""

from __future__ import annotations

import numpy as np

from ftcc.airside.flight_path import Own
from ftcc.airside.model import Model
from ftcc.airside.scheme import Flight, Heard, Reference
from ftcc.link.graph import Graph
from tests.support.swarm import nominal

MISSION = Reference(0.0, 30.0, 0.0, 1000.0, 0.0, 0.0)


def model(thrust: float, elevator: float, lag: float = 20.0) -> Model:
    return nominal(thrust=thrust, elevator=elevator, lag=lag)


def own(**values: float) -> Own:
    """An aircraft in level trim at 30 m/s and 1000 m unless told otherwise."""
    trim = dict.fromkeys(Own._fields, 0.0) | {"z": 1000.0, "V": 30.0, "theta": 0.032175, "thrust": 21.3032}
    found = trim | {"elevator": -0.196882} | values
    return Own(**found | {"alpha": found["theta"] - found["gamma"]})


def heard(*neighbours: tuple[float, ...], weight: tuple[float, ...] = (), age: float = 0.0) -> Heard:
    """Neighbours' shared values; nobody without arguments."""
    n = len(neighbours)
    values = np.array(neighbours, np.float64).reshape(n, -1) if n else np.zeros((0, 4))
    return Heard(values, np.full(n, age), np.ones(n), np.array(weight or (1.0,) * n), np.ones(values.shape))


def flight(graph: Graph, period: float = 0.005, **facts: float) -> Flight:
    known = {"exchange_period": 0.05, "latency": 0.05, "leader_climb": 1.0} | facts
    return Flight(
        graph,
        period,
        known["exchange_period"],
        known["latency"],
        known["leader_climb"],
        bool(known.get("leader_speed_varies", False)),
        known.get("leader_acceleration", 0.0),
    )


def both_ways(weights: dict[tuple[int, int], float]) -> dict[tuple[int, int], float]:
    return weights | {(j, i): weight for (i, j), weight in weights.items()}
