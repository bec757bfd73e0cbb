"""How many lying neighbours a graph stands: r-robustness, and strong robustness towards leaders.

Definitions: H. J. LeBlanc, H. Zhang, X. Koutsoukos, S. Sundaram, "Resilient asymptotic consensus in robust networks",
IEEE Journal on Selected Areas in Communications 31 (2013), 766-781. With each honest UAV leaving out the F largest and
the F smallest of what lies beyond its own value (W-MSR), honest UAVs agree within the interval of their first values if
the graph is (2 F + 1)-robust, whichever F in-neighbours of each lie (theorem 2 there).

Strong robustness towards a set of leaders: A. Mitra, S. Sundaram, "Byzantine-resilient distributed observers for LTI
systems", Automatica 108 (2019); J. Usevitch, D. Panagou, "Resilient leader-follower consensus to arbitrary reference
values in time-varying graphs", IEEE Transactions on Automatic Control 65 (2020), which needs 2 F + 1 as well.

Trusted UAVs: W. Abbas, A. Laszka, X. Koutsoukos, "Improving network connectivity and robustness using trusted nodes
with application to resilient consensus", IEEE Transactions on Control of Network Systems 5 (2018): one trusted
in-neighbour is as good as any number.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.link.graph import Graph

__all__ = ["EXACT_UP_TO", "Standing", "edges_that_raise", "robustness_of", "strong_robustness"]

EXACT_UP_TO = 16
"""UAVs of which every pair of groups is looked at; the effort doubles with each more."""

_PROPOSED_UP_TO = 12
"""UAVs for which every missing edge is tried."""


class Standing(NamedTuple):
    """A robustness, exact or between two bounds."""

    least: int
    most: int

    def __str__(self) -> str:
        return f"{self.least}" if self.least == self.most else f"{self.least} to {self.most}"


def robustness_of(graph: Graph) -> Standing:
    """The largest r for which the graph is r-robust: of two disjoint groups of UAVs, one always has a member that hears
    at least r UAVs from without its group.

    Exact for up to `EXACT_UP_TO` UAVs. Beyond: at most ceil(n / 2), and, from 2 on, the least in-degree (LeBlanc et
    al.); at least 1 where somebody reaches all, least in-degree - floor(n / 2) + 1 (by counting: the smaller of two
    groups has at most n / 2 members), and, where all edges go both ways, half of the algebraic connectivity of the
    unweighted graph, rounded up (E. M. Shahrivar, M. Pirani, S. Sundaram, "Robustness and algebraic connectivity of
    random interdependent networks", 2015).
    """
    return _robustness(_hearing(graph))


def _hearing(graph: Graph) -> NDArray[np.bool_]:
    """(n, n): whether the UAV of the row hears that of the column."""
    return np.asarray(graph.adjacency > 0.0)


def _robustness(heard: NDArray[np.bool_]) -> Standing:
    n = len(heard)
    if n == 1:
        return Standing(1, 1)
    if n <= EXACT_UP_TO:
        r = _exact(heard)
        return Standing(r, r)
    degree = int(heard.sum(axis=1).min())
    rooted = any(_reaches_all(heard, root) for root in range(n))
    least = max(int(rooted), degree - n // 2 + 1)
    if (heard == heard.T).all():
        laplacian = np.diag(heard.sum(axis=1)) - heard.astype(float)
        # A connectivity that is an integer must not be rounded up by an error in its last digit.
        least = max(least, math.ceil(float(np.linalg.eigvalsh(laplacian)[1]) / 2.0 - 1e-9))
    most = min((n + 1) // 2, degree) if degree >= 2 else int(rooted)
    return Standing(least, max(least, most))


def _reaches_all(heard: NDArray[np.bool_], root: int) -> bool:
    reached = np.zeros(len(heard), bool)
    reached[root] = True
    while (more := reached | heard[:, reached].any(axis=1)).sum() > reached.sum():
        reached = more
    return bool(reached.all())


def _reach(heard: NDArray[np.bool_]) -> NDArray[np.int8]:
    """By group (bit i: UAV i is in it): the most UAVs from without that a member hears; 0 of the empty group."""
    n = len(heard)
    groups = np.arange(1 << n, dtype=np.int64)
    reach = np.zeros(1 << n, np.int8)
    for i in range(n):
        mask = int(sum(1 << j for j in range(n) if heard[i, j]))
        outside = np.bitwise_count(mask & ~groups).astype(np.int8)
        reach = np.where(groups >> i & 1, np.maximum(reach, outside), reach)
    return reach


def _least_within(reach: NDArray[np.int8], n: int) -> NDArray[np.int8]:
    """By group, the least reach of a group within it that is not empty; very much for the empty group."""
    least = reach.copy()
    least[0] = np.iinfo(np.int8).max
    for i in range(n):
        halves = least.reshape(-1, 2, 1 << i)
        halves[:, 1] = np.minimum(halves[:, 1], halves[:, 0])
    return least


def _exact(heard: NDArray[np.bool_]) -> int:
    """The robustness: over all pairs of disjoint groups, the least of the larger reach of both."""
    n = len(heard)
    reach = _reach(heard)
    least = _least_within(reach, n)
    groups = np.arange(1, (1 << n) - 1)
    return int(np.maximum(reach[groups], least[((1 << n) - 1) ^ groups]).min())


def _weakness(heard: NDArray[np.bool_], r: int) -> int:
    """How many groups reach less than ``r`` and have a disjoint one that does so, too: 0 where r-robust."""
    n = len(heard)
    reach = _reach(heard)
    least = _least_within(reach, n)
    groups = np.arange(1, (1 << n) - 1)
    return int((np.maximum(reach[groups], least[((1 << n) - 1) ^ groups]) < r).sum())


def strong_robustness(graph: Graph, trusted: Iterable[int] = ()) -> Standing:
    """The largest r for which the graph is strongly r-robust towards its leaders: every group of followers has a member
    that hears at least r UAVs from without the group, or one of ``trusted``.

    The number of UAVs, where trusted ones vouch for all. Exact for any number: the group that breaks it is what is left
    when, beginning with the leaders, everybody is taken away who hears r of those who were taken away before.
    """
    believed = tuple(trusted)
    r = 0
    while r < len(graph.uavs) and not _left(graph, r + 1, believed):
        r += 1
    return Standing(r, r)


def _left(graph: Graph, r: int, trusted: tuple[int, ...]) -> set[int]:
    """Followers that the leaders' values cannot be sure to get to where r neighbours must vouch for them."""
    reached = set(graph.leaders)
    left = set(graph.followers)
    while True:
        new = {uav for uav in left if _vouched(graph, uav, reached, trusted) >= r}
        if not new:
            return left
        reached |= new
        left -= new


def _vouched(graph: Graph, uav: int, reached: set[int], trusted: tuple[int, ...]) -> float:
    """How many of those ``reached`` a UAV hears; without bound where one of them is trusted."""
    heard = reached.intersection(graph.senders(uav))
    return math.inf if heard.intersection(trusted) else len(heard)


def edges_that_raise(
    graph: Graph, wanted: int, led: bool, trusted: Iterable[int], both_ways: bool, most: int
) -> list[tuple[int, int]] | None:
    """Few edges, (sender, receiver), found greedily, that make the graph ``wanted``-robust; None: ``most`` do not do.

    ``led``: strongly, towards its leaders; ``both_ways``: an edge between followers stands for both directions.
    """
    if led:
        return _raise_strong(graph, wanted, tuple(trusted), both_ways, most)
    return _raise_plain(graph, wanted, both_ways, most)


def _with(graph: Graph, sender: int, receiver: int, both_ways: bool) -> Graph:
    weights = dict(graph.weights)
    weights[receiver, sender] = 1.0
    if both_ways and sender in graph.followers:
        weights[sender, receiver] = 1.0
    return replace(graph, weights=weights)


def _raise_strong(
    graph: Graph, wanted: int, trusted: tuple[int, ...], both_ways: bool, most: int
) -> list[tuple[int, int]] | None:
    added: list[tuple[int, int]] = []
    while left := _left(graph, wanted, trusted):
        reached = set(graph.uavs) - left
        # Whoever lacks least is helped first: once reached, it helps the others.
        uav = max(sorted(left), key=lambda one: _vouched(graph, one, reached, trusted))
        missing = [one for one in graph.uavs if one in reached and (uav, one) not in graph.weights]
        missing.sort(key=lambda one: (one not in trusted, one in graph.leaders, graph.uavs.index(one)))
        if not missing or len(added) == most:
            return None
        added.append((missing[0], uav))
        graph = _with(graph, missing[0], uav, both_ways)
    return added


def _raise_plain(graph: Graph, wanted: int, both_ways: bool, most: int) -> list[tuple[int, int]] | None:
    if len(graph.uavs) > _PROPOSED_UP_TO or wanted > (len(graph.uavs) + 1) // 2:
        return None
    added: list[tuple[int, int]] = []
    weakness = _weakness(_hearing(graph), wanted)
    while weakness:
        pairs = combinations(graph.uavs, 2) if both_ways else ((i, j) for i in graph.uavs for j in graph.uavs if i != j)
        free = [(i, j) for i, j in pairs if (j, i) not in graph.weights]
        if not free or len(added) == most:
            return None
        tried = [(_weakness(_hearing(_with(graph, i, j, both_ways)), wanted), i, j) for i, j in free]
        weakness, sender, receiver = min(tried)
        added.append((sender, receiver))
        graph = _with(graph, sender, receiver, both_ways)
    return added
