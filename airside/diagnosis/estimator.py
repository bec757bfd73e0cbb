"""Joint estimate of an actuator's effectiveness and additive effect: a Kalman filter with the fault as a bias state.

The motion that an actuator drives, in its own unit: y' = F + c R + rho u + b. F is the nominal drift, R the part of it
whose coefficient is uncertain, u the position, rho the effectiveness, b the lumped additive effect. What is estimated
is (y, rho, b, c). This is the joint form of the two-stage filter for loss of control effectiveness of Wu, Zhang, Zhou
(Int. J. Adapt. Control Signal Process. 14, 2000, eqs. (8)-(20)) and Zhang, Jiang (IEE Proc. Control Theory Appl. 149,
2002): with exact coupling both give the same numbers, and this one inverts no covariance (Hsieh, Chen, IEEE Trans.
Autom. Control 44, 1999).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ftcc.airside.diagnosis.beliefs import BIAS, FLOATING, LOSS
from ftcc.link.compiled import compiled

__all__ = ["RHO", "STATES", "B", "C", "Surprises", "Y", "correct", "given_kind", "predict", "surprises_of", "widen"]

STATES = 4
"""Length of the state."""
Y, RHO, B, C = range(STATES)
"""Its entries. y is the predicted less the measured sum of motion, so that the measurement is always 0."""


class Surprises(NamedTuple):
    """What speaks against each special case of loss and bias: half a Wald statistic, as a log-likelihood."""

    loss: float
    bias: float
    stuck: float
    floating: float


@compiled
def predict(x, P, dt, step, drift, regressor, position, spread):
    """Predict state ``x`` (4,) and covariance ``P`` (4, 4) over ``dt`` (s), in which ``step`` of motion was measured.

    ``drift`` is F, ``regressor`` R, ``position`` u, all mean values of the step in the actuator's unit; ``spread`` its
    unit times sqrt(s): white noise that moves the aircraft beside the model.
    """
    a, b, c = dt * position, dt, dt * regressor
    x[Y] += dt * (drift + x[C] * regressor + x[RHO] * position + x[B]) - step
    # P <- Phi P Phi', where only the first row of Phi is not that of the identity.
    for n in range(STATES):
        P[Y, n] += a * P[RHO, n] + b * P[B, n] + c * P[C, n]
    for n in range(STATES):
        P[n, Y] += a * P[n, RHO] + b * P[n, B] + c * P[n, C]
    P[Y, Y] += spread * spread * dt


@compiled
def correct(x, P, noise, faulty):
    """Correct by the measurement of y, whose standard deviation is ``noise``; return the innovation and its variance.

    The coefficient, and without ``faulty`` the effectiveness, are considered, not estimated (Schmidt): their variances
    stay as they are, and what they may do is counted in those of the others.
    """
    variance = P[Y, Y] + noise * noise
    innovation = -x[Y]
    gain = (P[Y, Y] / variance, P[RHO, Y] / variance, P[B, Y] / variance, P[C, Y] / variance)
    for n in range(STATES):
        considered = n == C or (n == RHO and not faulty)
        if not considered:
            x[n] += gain[n] * innovation
        for m in range(STATES):
            if not (considered and (m == C or (m == RHO and not faulty))):
                P[n, m] -= gain[n] * gain[m] * variance
    return innovation, variance


@compiled
def widen(P, entry, deviation):
    """Let the true value of an ``entry`` have jumped by something of this standard deviation."""
    P[entry, entry] += deviation * deviation


@compiled
def given_kind(x, P, kind, effectiveness, bias, sure):
    """The estimate given that the fault is of a ``kind``: one that has no part of the other entry.

    A loss leaves the additive effect of the healthy actuator, ``bias``, but for ``sure`` (a standard deviation, its
    unit), a bias leaves its ``effectiveness``; other kinds say nothing of either. The condition is a measurement.

    Returns
    -------
    effectiveness, its standard deviation, additive effect less ``bias``, its standard deviation
    """
    rho, b, var_rho, var_b, both = x[RHO], x[B], P[RHO, RHO], P[B, B], P[RHO, B]
    if kind in (LOSS, FLOATING):
        left = sure * sure
        gain, away = both / (var_b + left), bias - b
        # No actuator acts against its command.
        rho, var_rho = max(rho + gain * away, 0.0), var_rho - gain * both
        b, var_b = b + var_b / (var_b + left) * away, var_b * left / (var_b + left)
    elif kind == BIAS:
        gain = both / var_rho
        b, var_b = b + gain * (effectiveness - rho), var_b - gain * both
        rho, var_rho = effectiveness, 0.0
    return rho, math.sqrt(max(var_rho, 0.0)), b - bias, math.sqrt(max(var_b, 0.0))


@compiled
def surprises_of(x, P, effectiveness, bias, rough):
    """How little the estimate agrees with each of the `Surprises`.

    A loss leaves the additive effect of the healthy actuator, ``bias``, a bias its ``effectiveness``; one that is stuck
    has none of the latter, one that floats neither. ``rough`` (2,) are standard deviations of the model in both; the
    others are the estimate's own.
    """
    rho, b = x[RHO], x[B] - bias
    var_rho, var_b, both = P[RHO, RHO] + rough[0] * rough[0], P[B, B] + rough[1] * rough[1], P[RHO, B]
    away = rho - effectiveness
    floating = (rho * rho * var_b - 2.0 * rho * b * both + b * b * var_rho) / (var_rho * var_b - both * both)
    return Surprises(0.5 * b * b / var_b, 0.5 * away * away / var_rho, 0.5 * rho * rho / var_rho, 0.5 * floating)
