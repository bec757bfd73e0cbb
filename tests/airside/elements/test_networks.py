"""Gaussian networks against their nodes written out, and the adaptation against its closed form."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from ftcc.airside.elements.networks import (
    adapt_neuron,
    adaptation_rate,
    adaptation_step,
    diagonal_energy,
    grid_axis_energy,
    learned_gain,
)
from tests.airside.elements.motion import integrated


def phi(x: np.ndarray, centres: np.ndarray, width: float) -> np.ndarray:
    return np.exp(-((x - centres) ** 2).sum(axis=1) / width**2)


@pytest.mark.parametrize(("inputs", "nodes", "width", "at_rest"), [(3, 3, 2.0, 10.8), (5, 2, 3.0, 10.5)])
def test_grid_network_is_the_product_of_its_axes(inputs, nodes, width, at_rest):
    """Chapter 3: 27 nodes with phi = exp(-|x-c|^2/4), 32 with exp(-|x-c|^2/9)."""
    centres = np.array(list(itertools.product(np.linspace(-1.0, 1.0, nodes), repeat=inputs)))
    for x in (np.zeros(inputs), np.linspace(-0.7, 1.4, inputs)):
        product = np.prod([grid_axis_energy(float(value), nodes, width) for value in x])
        assert product == pytest.approx(float((phi(x, centres, width) ** 2).sum()))
    assert grid_axis_energy(0.0, nodes, width) ** inputs == pytest.approx(at_rest, abs=0.05)


@pytest.mark.parametrize("inputs", [(0.1, -0.4, 0.0, 0.3), (0.0, 0.0, 0.0, 0.0, 0.0), (2.0, -1.0, 0.5, 0.2, 0.1, 0.9)])
def test_diagonal_network_is_the_sum_over_its_nodes(inputs):
    centres = np.repeat(np.linspace(-1.0, 1.0, 5)[:, None], len(inputs), axis=1)
    assert diagonal_energy(inputs, 5, 2.0) == pytest.approx(float((phi(np.array(inputs), centres, 2.0) ** 2).sum()))


def test_learned_gain():
    assert learned_gain(0.06, 10.8, 1.06) == pytest.approx(0.06 * 10.8 / (2.0 * 1.06**2))


def test_adaptation_settles_where_growth_and_leak_balance():
    """(3.40): F -> error^2 p / (2 w^2 leak), with the time constant 1 / (gain leak)."""
    t = np.linspace(0.0, 3.0, 13)
    (estimate,) = integrated(lambda t, y: [adaptation_rate(y[0], 0.2, 10.8, 1.06, 18.0, 0.06)], [0.0], t)
    final = 0.2**2 * 10.8 / (2.0 * 1.06**2 * 0.06)
    assert estimate == pytest.approx(final * (1.0 - np.exp(-18.0 * 0.06 * t)), abs=1e-7)


def test_adaptation_in_steps_converges_to_its_rate_and_settles_at_the_same_place():
    final = 0.2**2 * 2.2 / (2.0 * 0.6**2 * 0.05)
    exact = final * (1.0 - np.exp(-15.0 * 0.05 * 2.0))
    errors = []
    for h in (2e-3, 1e-3):
        estimate = 0.0
        for _ in range(round(2.0 / h)):
            estimate = adaptation_step(estimate, 0.2, 2.2, 0.6, 15.0, 0.05, h)
        errors.append(abs(estimate - exact))
    assert errors[0] < 2e-3 * final
    assert errors[1] == pytest.approx(0.5 * errors[0], rel=0.05)
    assert adaptation_step(final, 0.2, 2.2, 0.6, 15.0, 0.05, 0.1) == pytest.approx(final)


def test_leak_in_steps_never_overshoots():
    assert 0.0 < adaptation_step(1.0, 0.0, 2.2, 0.6, 15.0, 50.0, 10.0) < 1e-3


def test_adapted_neurons_are_an_euler_step_of_the_weights_matrix():
    """(8.27): W' = k (phi e^T - leak W); the output is that of the weights before the step."""
    random = np.random.default_rng(3)
    weights, activations, error = random.normal(size=(5, 3)), random.uniform(size=5), (0.3, -0.2, 0.1)
    before = weights.copy()
    added = [adapt_neuron(weights, n, activations[n], error, 2.0, 0.1, 0.01) for n in range(5)]
    assert np.sum(added, axis=0) == pytest.approx(before.T @ activations)
    assert weights == pytest.approx(before + 0.01 * 2.0 * (np.outer(activations, error) - 0.1 * before))
