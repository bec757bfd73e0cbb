"""The communication graph: senders, receivers and weights, and what follows from them.

Weights are a_ij of receiver i for sender j, as in the monograph; leaders receive nothing that the schemes use.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

__all__ = ["Assumption", "Graph", "GraphError"]


class GraphError(ValueError):
    """The graph breaks an assumption of the scheme."""


class Assumption(Enum):
    """What a scheme requires of the topology; the value is the sentence that a user reads."""

    LEADERS_REACH_ALL = "every follower is reached from at least one leader by a directed path"
    UNDIRECTED_LEADERS_REACH_ALL = (
        "the followers' edges are undirected (a_ij = a_ji) and every follower is reached from at least one leader"
    )
    ONE_LEADER_UNDIRECTED = (
        "there is one leader, the followers' edges are undirected (a_ij = a_ji) and every follower is reached from it"
    )
    CONNECTED_UNDIRECTED = "the edges are undirected (a_ij = a_ji) and connect all UAVs"
    STRONGLY_CONNECTED = "the directed edges connect every UAV with every other"
    NONE = "no assumption"


@dataclass(frozen=True)
class Graph:
    """A weighted directed graph over UAV ids."""

    followers: tuple[int, ...]
    leaders: tuple[int, ...]
    weights: dict[tuple[int, int], float]
    """``(receiver, sender) -> a_ij > 0``."""

    def __post_init__(self) -> None:
        known = set(self.uavs)
        if len(known) != len(self.uavs):
            raise GraphError(f"a UAV id appears twice in {list(self.uavs)}")
        for (receiver, sender), weight in self.weights.items():
            for uav in (receiver, sender):
                if uav not in known:
                    raise GraphError(f"edge {sender} -> {receiver}: there is no UAV {uav}; UAVs are {sorted(known)}")
            if receiver == sender:
                raise GraphError(f"edge {sender} -> {receiver}: a UAV cannot be its own neighbour")
            if not (np.isfinite(weight) and weight > 0.0):
                raise GraphError(f"edge {sender} -> {receiver}: weight {weight} must be a positive number")

    @property
    def uavs(self) -> tuple[int, ...]:
        return self.followers + self.leaders

    def senders(self, receiver: int) -> list[int]:
        """Ids of the in-neighbours of ``receiver``, in the swarm's order."""
        return [uav for uav in self.uavs if (receiver, uav) in self.weights]

    def receivers(self, sender: int) -> list[int]:
        """Ids of the out-neighbours of ``sender``, in the swarm's order."""
        return [uav for uav in self.uavs if (uav, sender) in self.weights]

    @property
    def adjacency(self) -> NDArray[np.float64]:
        """A, shape (n, n) in the order of `uavs`; row = receiver."""
        index = {uav: i for i, uav in enumerate(self.uavs)}
        matrix = np.zeros((len(self.uavs), len(self.uavs)))
        for (receiver, sender), weight in self.weights.items():
            matrix[index[receiver], index[sender]] = weight
        return matrix

    @property
    def laplacian(self) -> NDArray[np.float64]:
        """L = diag(row sums) - A, shape (n, n)."""
        adjacency = self.adjacency
        return np.diag(adjacency.sum(axis=1)) - adjacency

    @property
    def hull_weights(self) -> NDArray[np.float64]:
        """W = -L1^-1 L2, shape (followers, leaders): the convex combination of leaders that each follower tracks.

        Raises
        ------
        GraphError
            If a follower is not reached by a leader (L1 is singular).
        """
        self.require(Assumption.LEADERS_REACH_ALL)
        n = len(self.followers)
        laplacian = self.laplacian
        return np.asarray(-np.linalg.solve(laplacian[:n, :n], laplacian[:n, n:]), np.float64)

    def reached_from(self, sources: tuple[int, ...]) -> set[int]:
        """Ids that records from ``sources`` can reach along the edges, sources included."""
        reached = set(sources)
        frontier = list(sources)
        while frontier:
            for uav in self.receivers(frontier.pop()):
                if uav not in reached:
                    reached.add(uav)
                    frontier.append(uav)
        return reached

    def require(self, assumption: Assumption) -> None:
        """Raise `GraphError`, naming the assumption and who breaks it, if the graph does not satisfy it."""
        broken = self._broken(assumption)
        if broken:
            raise GraphError(f"the scheme assumes that {assumption.value}; {broken}")

    def _broken(self, assumption: Assumption) -> str:
        if assumption in (Assumption.UNDIRECTED_LEADERS_REACH_ALL, Assumption.ONE_LEADER_UNDIRECTED):
            one_way = self._one_way(self.followers)
            if one_way:
                return one_way
        if assumption is Assumption.ONE_LEADER_UNDIRECTED and len(self.leaders) != 1:
            return f"there are {len(self.leaders)} leaders"
        if assumption in (
            Assumption.LEADERS_REACH_ALL,
            Assumption.UNDIRECTED_LEADERS_REACH_ALL,
            Assumption.ONE_LEADER_UNDIRECTED,
        ):
            unreached = sorted(set(self.followers) - self.reached_from(self.leaders))
            return f"no leader reaches UAV {', '.join(map(str, unreached))}" if unreached else ""
        if assumption is Assumption.CONNECTED_UNDIRECTED:
            return self._one_way(self.uavs) or self._unreached_pair()
        if assumption is Assumption.STRONGLY_CONNECTED:
            return self._unreached_pair()
        return ""

    def _one_way(self, among: tuple[int, ...]) -> str:
        for (receiver, sender), weight in self.weights.items():
            if receiver in among and sender in among and self.weights.get((sender, receiver)) != weight:
                back = self.weights.get((sender, receiver), 0.0)
                return f"edge {sender} -> {receiver} has weight {weight}, {receiver} -> {sender} has {back}"
        return ""

    def _unreached_pair(self) -> str:
        for uav in self.uavs:
            missing = sorted(set(self.uavs) - self.reached_from((uav,)))
            if missing:
                return f"nothing that UAV {uav} sends reaches UAV {', '.join(map(str, missing))}"
        return ""
