"""Communication graphs by name: ring, chain, star, grid, complete, nearest:K, random:P."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable

import numpy as np

from ftcc.groundside.errors import UserError
from ftcc.link.graph import Assumption, Graph, GraphError

__all__ = ["KINDS", "LEADER_EVERY", "RequestError", "graph_of", "pairs_of"]

Pair = tuple[int, int]
"""Two members by number from 0, the lower one first unless a ring closes."""

LEADER_EVERY = 3
"""Each so many followers one hears a leader: estimates need not travel far, so that swarms of any size settle alike."""
_LITTLE = 0.25
"""A follower whose neighbours weigh less in sum hears a leader itself; so do the leaves of a large star."""
_DRAWS = 100
"""Random graphs that are drawn in search of a connected one."""


class RequestError(UserError):
    """A swarm that was asked for and cannot be: what, and what would be right."""


def _ring(n: int) -> set[Pair]:
    return {(i, (i + 1) % n) for i in range(n)} if n > 2 else _chain(n)


def _chain(n: int) -> set[Pair]:
    return {(i, i + 1) for i in range(n - 1)}


def _star(n: int) -> set[Pair]:
    return {(0, i) for i in range(1, n)}


def _grid(n: int) -> set[Pair]:
    """Rows of equal length, as square as can be; the last one may be shorter."""
    columns = math.ceil(math.sqrt(n))
    beside = {(i, i + 1) for i in range(n - 1) if (i + 1) % columns}
    return beside | {(i, i + columns) for i in range(n - columns)}


def _complete(n: int) -> set[Pair]:
    return set(itertools.combinations(range(n), 2))


def _nearest(n: int, k: int) -> set[Pair]:
    """Each with its K nearest in the line abreast, as many to either side as there are."""
    pairs = set()
    for i in range(n):
        for j in sorted((j for j in range(n) if j != i), key=lambda j: (abs(j - i), j))[:k]:
            pairs.add((min(i, j), max(i, j)))
    return pairs


def _random(n: int, p: float, seed: int) -> set[Pair]:
    """Each pair with probability P, drawn until the graph is connected."""
    draws = np.random.Generator(np.random.Philox(seed))
    for _ in range(_DRAWS):
        pairs = {pair for pair in itertools.combinations(range(n), 2) if draws.random() < p}
        if _connected(n, pairs):
            return pairs
    raise RequestError(
        f"--graph random:{p:g}: {_DRAWS} draws with {n} UAVs, none of them connected; with P = "
        f"{min(1.0, 2.0 * math.log(n) / n):.2g} nearly all are"
    )


KINDS: dict[str, Callable[[int], set[Pair]]] = {
    "ring": _ring,
    "chain": _chain,
    "star": _star,
    "grid": _grid,
    "complete": _complete,
}
"""Graphs without a number, by name."""


def pairs_of(kind: str, n: int, seed: int) -> list[Pair]:
    """Return the pairs of ``n`` members that hear each other, in order.

    Raises
    ------
    RequestError
        For an unknown kind, a number that does not fit, or random graphs that are never connected.
    """
    name, _, text = kind.partition(":")
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if kind in KINDS:
        return sorted(KINDS[kind](n))
    if name == "nearest" and number in range(1, n):
        return sorted(_nearest(n, int(number)))
    if name == "random" and 0.0 < number <= 1.0:
        return sorted(_random(n, number, seed))
    raise RequestError(
        f"--graph {kind}: must be {', '.join(KINDS)}, nearest:K with K from 1 to {n - 1}, or random:P with 0 < P <= 1"
    )


def graph_of(
    kind: str, followers: tuple[int, ...], leaders: tuple[int, ...], directed: bool, seed: int, assumption: Assumption
) -> Graph:
    """Return a graph that satisfies a scheme's assumption.

    The followers' weights are those of Metropolis, a_ij = 1 / (1 + max(d_i, d_j)) with the degrees d: symmetric, and in
    sum below 1 for every UAV, so that rates do not grow with the swarm (Xiao, Boyd, Kim: Distributed average consensus
    with least-mean-square deviation, 2007). What a leader sends counts with 1.

    Raises
    ------
    RequestError
        If the graph is unknown, or breaks the assumption (naming it).
    """
    pairs = pairs_of(kind, len(followers), seed)
    degree = [sum(i in pair for pair in pairs) for i in range(len(followers))]
    weights: dict[Pair, float] = {}
    for i, j in pairs:
        weight = round(1.0 / (1.0 + max(degree[i], degree[j])), 4)
        weights[followers[j], followers[i]] = weight
        if not directed:
            weights[followers[i], followers[j]] = weight
    for n, i in enumerate(_listeners(len(followers), len(leaders), followers, weights)):
        weights[followers[i], leaders[n % len(leaders)]] = 1.0
    graph = Graph(followers, leaders, weights)
    try:
        graph.require(assumption)
    except GraphError as error:
        way = " --directed" if directed else ""
        raise RequestError(f"--graph {kind}{way} with {len(leaders)} leaders: {error}") from None
    return graph


def _listeners(count: int, leaders: int, followers: tuple[int, ...], weights: dict[Pair, float]) -> Iterable[int]:
    """The followers, by number, that hear a leader."""
    if not leaders:
        return []
    heard = [sum(weight for (receiver, _), weight in weights.items() if receiver == uav) for uav in followers]
    every = max(1, min(LEADER_EVERY, count // leaders))
    return [i for i in range(count) if i % every == 0 or heard[i] < _LITTLE]


def _connected(n: int, pairs: set[Pair]) -> bool:
    from scipy.sparse.csgraph import connected_components

    adjacency = np.zeros((n, n), bool)
    for i, j in pairs:
        adjacency[i, j] = True
    return int(connected_components(adjacency, directed=False, return_labels=False)) == 1
