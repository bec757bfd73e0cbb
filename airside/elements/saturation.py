"""Auxiliary systems that carry what saturation took from a command."""

from __future__ import annotations

import math

from ftcc.airside.elements.nonlinear import sign
from ftcc.airside.elements.vectors import added, dot, scaled, subtracted
from ftcc.link.compiled import compiled

__all__ = ["auxiliary_step", "linear_auxiliary_rate", "squared_auxiliary_step", "vector_auxiliary_step"]


@compiled
def linear_auxiliary_rate(state, gain, effectiveness, saturated, wanted):
    """Rate of a linear auxiliary system, eqs. (4.19), (5.33), (5.39): -gain state + g (sat(u) - u)."""
    return -gain * state + effectiveness * (saturated - wanted)


@compiled
def auxiliary_step(state, gain, error, excess, threshold, h):
    """The state after a step of length ``h`` of a nonlinear auxiliary system, eq. (3.54) with Remark 3.3.

    state' = -gain state - (|error excess| + 0.5 excess^2)/state + excess where abs(state) >= threshold, else 0; with
    ``excess`` = sat(u) - u. An excess that finds the state below its threshold restarts it there. Steps itself,
    semi-implicitly: the equation is stiff (up to 1e4 1/s).
    """
    if abs(state) < threshold:
        if excess == 0.0:
            return state
        state = threshold * sign(excess)
    pull = gain + (abs(error * excess) + 0.5 * excess * excess) / (state * state)
    return (state + h * excess) / (1.0 + h * pull)


@compiled
def squared_auxiliary_step(state, gain, error, excess, threshold, h):
    """As `auxiliary_step`, eqs. (6.46), (6.78), for saturation that lasts: the square of the state is what is stepped.

    The state keeps its sign and never falls below its threshold once it has reached it (rates up to 1e7 1/s).
    """
    if abs(state) < threshold:
        if excess == 0.0:
            return state
        state = threshold if state >= 0.0 else -threshold
    square = state * state + 2.0 * h * (excess * state - abs(error * excess) - 0.5 * excess * excess)
    return sign(state) * math.sqrt(max(threshold * threshold, square / (1.0 + 2.0 * h * gain)))


@compiled
def vector_auxiliary_step(state, gain, power, excess, floor, h):
    """The state (three axes) after a step of length ``h`` of a nonlinear auxiliary system, eqs. (8.29), (8.41).

    state' = -(gain + (power + 0.5 |excess|^2)/max(|state|^2, floor)) state + excess; ``power`` is the rate at which the
    excess feeds the error's energy. The floor stands in the place of Remark 8.1's freeze and reset, which depend on the
    sampling. Steps itself, implicitly where the state decays.
    """
    decay = gain + (power + 0.5 * dot(excess, excess)) / max(dot(state, state), floor)
    if decay >= 0.0:
        return scaled(1.0 / (1.0 + h * decay), added(state, scaled(h, excess)))
    return added(state, scaled(h, subtracted(excess, scaled(decay, state))))
