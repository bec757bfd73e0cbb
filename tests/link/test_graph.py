"""The communication graph of chapter 5, and graphs that a scheme must refuse."""

from __future__ import annotations

import numpy as np
import pytest

from ftcc.link.graph import Assumption, Graph, GraphError
from tests.support.swarm import FOLLOWERS, GRAPH, LEADERS, WEIGHTS

HULL_WEIGHTS = [
    (0.88492, 0.11508),
    (0.73496, 0.26504),
    (0.43504, 0.56496),
    (0.18003, 0.81997),
    (0.51762, 0.48238),
    (0.79775, 0.20225),
]
"""Reference: shares of leaders 7 and 8 in what UAV 1-6 track, from the decoded matrix (5.50)."""

EIGENVALUES = [0.1972, 0.5258, 0.6671, 1.1259, 1.4458, 2.1381]
"""Reference: spectrum of L1."""


def test_adjacency_of_chapter_5_has_receivers_as_rows():
    a = GRAPH.adjacency
    assert a.shape == (8, 8)
    assert a[0].tolist() == [0, 0.4, 0, 0, 0, 0.5, 0.9, 0]
    assert a[3].tolist() == [0, 0, 0.3, 0, 0.2, 0, 0, 0.8]
    assert not a[6:].any(), "leaders receive nothing"
    assert np.array_equal(a[:6, :6], a[:6, :6].T)


def test_laplacian_rows_sum_to_zero():
    assert GRAPH.laplacian.sum(axis=1) == pytest.approx(np.zeros(8), abs=1e-15)


def test_followers_laplacian_has_the_reference_eigenvalues():
    assert np.linalg.eigvalsh(GRAPH.laplacian[:6, :6]) == pytest.approx(EIGENVALUES, abs=5e-5)


def test_hull_weights_of_chapter_5():
    assert GRAPH.hull_weights == pytest.approx(np.array(HULL_WEIGHTS), abs=5e-6)


def test_hull_weights_are_convex_combinations_of_the_leaders():
    weights = GRAPH.hull_weights
    assert (weights >= 0.0).all()
    assert weights.sum(axis=1) == pytest.approx(np.ones(6))


def test_altitudes_quoted_at_125_s():
    """Prose of section 5.4: 1088, 1073, 1043, 1018, 1052 and 1079 m with the leaders at 1099.53 and 1000 m."""
    assert np.rint(GRAPH.hull_weights @ [1099.53, 1000.0]).tolist() == [1088, 1073, 1043, 1018, 1052, 1079]


def test_who_hears_whom():
    assert GRAPH.senders(1) == [2, 6, 7]
    assert GRAPH.senders(4) == [3, 5, 8]
    assert GRAPH.receivers(7) == [1, 6]
    assert GRAPH.senders(7) == []
    assert GRAPH.reached_from((8,)) == {1, 2, 3, 4, 5, 6, 8}
    GRAPH.require(Assumption.UNDIRECTED_LEADERS_REACH_ALL)


def without(*edges: tuple[int, int]) -> dict[tuple[int, int], float]:
    return {edge: weight for edge, weight in WEIGHTS.items() if edge not in edges}


REFUSED = [
    # A follower that no leader reaches: 2 hears and is heard by nobody.
    (
        Assumption.LEADERS_REACH_ALL,
        Graph(FOLLOWERS, LEADERS, without((1, 2), (2, 1), (2, 3), (3, 2))),
        "no leader reaches UAV 2",
    ),
    # Heard, but deaf: 2 still sends to 1 and 3.
    (Assumption.LEADERS_REACH_ALL, Graph(FOLLOWERS, LEADERS, without((2, 1), (2, 3))), "no leader reaches UAV 2"),
    (
        Assumption.UNDIRECTED_LEADERS_REACH_ALL,
        Graph(FOLLOWERS, LEADERS, without((2, 1))),
        "edge 2 -> 1 has weight 0.4, 1 -> 2 has 0.0",
    ),
    (
        Assumption.UNDIRECTED_LEADERS_REACH_ALL,
        Graph(FOLLOWERS, LEADERS, WEIGHTS | {(2, 1): 0.5}),
        "edge 2 -> 1 has weight 0.4, 1 -> 2 has 0.5",
    ),
    (Assumption.ONE_LEADER_UNDIRECTED, GRAPH, "there are 2 leaders"),
    (
        Assumption.CONNECTED_UNDIRECTED,
        Graph((1, 2, 3, 4), (), {(1, 2): 1.0, (2, 1): 1.0, (3, 4): 1.0, (4, 3): 1.0}),
        "nothing that UAV 1 sends reaches UAV 3, 4",
    ),
    (
        Assumption.STRONGLY_CONNECTED,
        Graph((1, 2, 3), (), {(2, 1): 1.0, (3, 2): 1.0}),
        "nothing that UAV 2 sends reaches UAV 1",
    ),
]


@pytest.mark.parametrize(("assumption", "graph", "because"), REFUSED)
def test_a_graph_that_breaks_the_assumption_is_refused_with_assumption_and_culprit(assumption, graph, because):
    with pytest.raises(GraphError) as refusal:
        graph.require(assumption)
    assert assumption.value in str(refusal.value)
    assert because in str(refusal.value)


def test_a_directed_ring_is_strongly_connected():
    Graph((1, 2, 3), (), {(2, 1): 1.0, (3, 2): 1.0, (1, 3): 1.0}).require(Assumption.STRONGLY_CONNECTED)


def test_no_assumption_refuses_nothing():
    Graph((1, 2), (), {}).require(Assumption.NONE)


def test_hull_weights_of_a_follower_that_no_leader_reaches_do_not_exist():
    with pytest.raises(GraphError, match="no leader reaches UAV 2"):
        _ = Graph((1, 2), (3,), {(1, 3): 1.0}).hull_weights


@pytest.mark.parametrize(
    ("weights", "because"),
    [
        ({(1, 9): 0.5}, "there is no UAV 9; UAVs are [1, 2, 3]"),
        ({(1, 1): 0.5}, "cannot be its own neighbour"),
        ({(1, 2): 0.0}, "weight 0.0 must be a positive number"),
        ({(1, 2): -1.0}, "weight -1.0 must be a positive number"),
        ({(1, 2): float("nan")}, "weight nan must be a positive number"),
        ({(1, 2): float("inf")}, "weight inf must be a positive number"),
    ],
)
def test_edges_that_are_none_are_refused(weights, because):
    with pytest.raises(GraphError) as refusal:
        Graph((1, 2), (3,), weights)
    assert because in str(refusal.value)


def test_an_id_that_appears_twice_is_refused():
    with pytest.raises(GraphError, match="appears twice"):
        Graph((1, 2), (2,), {})
