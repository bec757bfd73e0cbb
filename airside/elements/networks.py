"""Gaussian networks with minimal learning parameter: one adapted number, the squared norm of the ideal weights.

Only phi'phi of the basis vector phi enters a law, so that is what the networks give. Eqs. (3.19), (3.38)-(3.40).
"""

from __future__ import annotations

import math

from ftcc.airside.elements.nonlinear import limited
from ftcc.link.compiled import compiled

__all__ = [
    "adapt_neuron",
    "adaptation_rate",
    "adaptation_step",
    "diagonal_energy",
    "grid_axis_energy",
    "learned_gain",
    "network_inputs",
]


@compiled
def network_inputs(a, scale, largest):
    """Three inputs of a network: a / scale axis by axis, within +-``largest`` > 0."""
    return limited(a[0] / scale[0], largest), limited(a[1] / scale[1], largest), limited(a[2] / scale[2], largest)


@compiled
def grid_axis_energy(x, nodes, width):
    """The factor of one input in phi'phi of a network whose ``nodes`` per axis form a full grid over [-1, 1].

    phi = exp(-|x - c|^2 / width^2) separates, so phi'phi is the product over the inputs.
    """
    total = 0.0
    for n in range(nodes):
        distance = (x - (-1.0 + 2.0 * n / (nodes - 1))) / width
        total += math.exp(-2.0 * distance * distance)
    return total


@compiled
def diagonal_energy(inputs, nodes, width):
    """phi'phi of a network with ``nodes`` centres (c, c, .., c), c equally spaced over [-1, 1], for a tuple of inputs.

    phi = exp(-|x - c|^2 / width^2), eq. (3.19).
    """
    total = 0.0
    for n in range(nodes):
        centre = -1.0 + 2.0 * n / (nodes - 1)
        square = 0.0
        for x in inputs:
            square += (x - centre) * (x - centre)
        total += math.exp(-2.0 * square / (width * width))
    return total


@compiled
def learned_gain(estimate, energy, scale):
    """What the estimate adds to the gain on the error: estimate phi'phi / (2 scale^2), eqs. (3.38), (6.37)."""
    return estimate * energy / (2.0 * scale * scale)


@compiled
def adaptation_rate(estimate, error, energy, scale, gain, leak):
    """Rate of the estimate with leak: gain (error^2 phi'phi / (2 scale^2) - leak estimate), eqs. (3.40), (3.57)."""
    return gain * (error * error * energy / (2.0 * scale * scale) - leak * estimate)


@compiled
def adaptation_step(estimate, error, energy, scale, gain, leak, h):
    """The estimate after a step of length ``h`` of `adaptation_rate`, eqs. (6.38)-(6.39).

    Steps itself, the leak implicitly: never below zero.
    """
    return (estimate + h * gain * error * error * energy / (2.0 * scale * scale)) / (1.0 + h * gain * leak)


@compiled
def adapt_neuron(weights, n, activation, error, gain, leak, h):
    """One Euler step of the weights (n, 3) of a neuron of a network with three outputs, eqs. (8.27), (8.39).

    W' = gain (activation error - leak W). Modifies ``weights[n]``.

    Returns
    -------
    What the neuron adds to the network's outputs with its weights before the step.
    """
    row = weights[n]
    w = (row[0], row[1], row[2])
    for axis in range(3):
        row[axis] += h * gain * (activation * error[axis] - leak * w[axis])
    return activation * w[0], activation * w[1], activation * w[2]
