"""Robustness of graphs: against every pair of groups, and against graphs of which papers say it."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ftcc.link.graph import Graph
from ftcc.link.robustness import EXACT_UP_TO, Standing, edges_that_raise, robustness_of, strong_robustness


def graph_of(pairs, followers, leaders=()) -> Graph:
    """``pairs`` are (sender, receiver)."""
    return Graph(tuple(followers), tuple(leaders), {(receiver, sender): 1.0 for sender, receiver in pairs})


def both(pairs):
    return [edge for i, j in pairs for edge in ((i, j), (j, i))]


def complete(n: int) -> Graph:
    return graph_of(both(combinations(range(1, n + 1), 2)), range(1, n + 1))


def cycle(n: int) -> Graph:
    return graph_of(both((i, i % n + 1) for i in range(1, n + 1)), range(1, n + 1))


def reachable(graph: Graph, group: frozenset[int]) -> int:
    return max(len(set(graph.senders(uav)) - group) for uav in group)


def by_definition(graph: Graph) -> int:
    """LeBlanc et al., definition 6: every two disjoint groups, one after the other."""
    groups = [frozenset(chosen) for n in range(1, len(graph.uavs)) for chosen in combinations(graph.uavs, n)]
    reach = {group: reachable(graph, group) for group in groups}
    return min(max(reach[one], reach[other]) for one, other in combinations(groups, 2) if not one & other)


def strongly_by_definition(graph: Graph) -> int:
    return min(
        reachable(graph, frozenset(chosen))
        for n in range(1, len(graph.followers) + 1)
        for chosen in combinations(graph.followers, n)
    )


@st.composite
def graphs(draw, leaders: int = 0, most: int = 6):
    n = draw(st.integers(2, most))
    uavs = range(1, n + leaders + 1)
    pairs = [(i, j) for i, j in product(uavs, uavs) if i != j and j <= n]
    chosen = draw(st.lists(st.sampled_from(pairs), unique=True, max_size=len(pairs)))
    return graph_of(chosen, uavs[:n], uavs[n:])


@settings(max_examples=60, deadline=None)
@given(graphs())
def test_robustness_is_what_every_pair_of_groups_says(graph):
    r = by_definition(graph)
    assert robustness_of(graph) == Standing(r, r)


@settings(max_examples=60, deadline=None)
@given(graphs(leaders=3))
def test_strong_robustness_is_what_every_group_of_followers_says(graph):
    r = strongly_by_definition(graph)
    assert strong_robustness(graph) == Standing(r, r)


@pytest.mark.parametrize("n", [2, 3, 4, 5, 8, 11])
def test_a_complete_graph_has_the_largest_robustness_of_its_size(n):
    """LeBlanc et al.: ceil(n / 2), and no graph of n more."""
    assert robustness_of(complete(n)).least == -(-n // 2)


def test_known_graphs():
    """A cycle is 1-robust; the graph of two cliques joined by a perfect matching is highly connected, and 1-robust
    all the same: no member hears more than one UAV of the other clique (LeBlanc et al., figure 2)."""
    assert robustness_of(cycle(7)).least == 1
    matching = [*combinations(range(1, 6), 2), *combinations(range(6, 11), 2), *((i, i + 5) for i in range(1, 6))]
    assert robustness_of(graph_of(both(matching), range(1, 11))).least == 1
    # Preferential attachment, theorem 5 there: each newcomer joins r members of an r-robust graph.
    grown = [*combinations(range(1, 6), 2), *((n, m) for n in range(6, 12) for m in (1, 3, n - 1))]
    assert robustness_of(graph_of(both(grown), range(1, 12))).least == 3


def test_nobody_is_reached_by_all_where_the_graph_is_in_pieces():
    assert robustness_of(graph_of(both([(1, 2), (3, 4)]), range(1, 5))).least == 0


@pytest.mark.parametrize("seed", range(6))
def test_the_bounds_for_larger_graphs_hold_what_is_exact_for_smaller_ones(seed, monkeypatch):
    random = np.random.default_rng(seed)
    uavs = range(1, 11)
    share = random.uniform(0.3, 0.95)
    pairs = [pair for pair in combinations(uavs, 2) if random.random() < share]
    graph = graph_of(both(pairs) if seed % 2 else pairs + [(j, i) for i, j in pairs if random.random() < 0.8], uavs)
    exact = robustness_of(graph).least
    monkeypatch.setattr("ftcc.link.robustness.EXACT_UP_TO", 2)
    bounds = robustness_of(graph)
    assert bounds.least <= exact <= bounds.most


def test_the_bounds_of_a_large_complete_graph_meet():
    n = EXACT_UP_TO + 4
    assert robustness_of(complete(n)) == Standing(n // 2, n // 2)


def test_one_trusted_leader_is_as_good_as_many():
    chain = graph_of([(4, 1), (4, 2), (1, 2), (4, 3), (2, 3)], (1, 2, 3), (4,))
    assert strong_robustness(chain).least == 1
    assert strong_robustness(chain, trusted=(4,)).least == 4  # for whatever number


def test_edges_are_proposed_that_are_enough():
    ring = graph_of([(10, 1), (11, 1), (12, 1), *both((i, i + 1) for i in range(1, 5))], range(1, 6), (10, 11, 12))
    assert strong_robustness(ring).least == 1
    edges = edges_that_raise(ring, 3, True, (), True, 12)
    assert edges is not None
    raised = graph_of(
        [(s, r) for r, s in ring.weights] + both(e for e in edges if e[0] < 10) + [e for e in edges if e[0] >= 10],
        range(1, 6),
        (10, 11, 12),
    )
    assert strong_robustness(raised).least >= 3
    plain = edges_that_raise(cycle(6), 3, False, (), True, 12)
    assert plain is not None
    whole = graph_of([(s, r) for r, s in cycle(6).weights] + both(plain), range(1, 7))
    assert robustness_of(whole).least == 3
    assert edges_that_raise(cycle(6), 4, False, (), True, 12) is None  # more than any graph of six has
