"""Observers: of disturbances, and of a reference that only some neighbours know."""

from __future__ import annotations

import math

from ftcc.link.compiled import compiled

__all__ = ["disturbance_observer_rate", "extrapolated", "sliding_mode_observer"]


@compiled
def disturbance_observer_rate(gain, error, state, known, reference_rate):  # type: ignore[no-untyped-def]
    """Rate of the state xi of a first-order disturbance observer, eqs. (4.16), (5.20), (5.32), (5.36).

    For error' = known + d - reference_rate, with ``known`` = f + g u of the input that acts, the estimate
    d_hat = xi + gain error obeys d_hat' = gain (d - d_hat).
    """
    return -gain * (known + state + gain * error - reference_rate)


@compiled
def sliding_mode_observer(disagreement, beta1, beta2, phi):  # type: ignore[no-untyped-def]
    """Rate of a distributed reference estimate, eqs. (3.20), (5.12), with sign smoothed to tanh(./phi).

    ``disagreement`` is sum_j a_ij (own - neighbour's). ``beta2`` must exceed the reference's largest rate.

    Returns
    -------
    rate, slope : float
        The estimate's rate and d(rate)/d(disagreement).
    """
    smooth = math.tanh(disagreement / phi)
    return -beta1 * disagreement - beta2 * smooth, -(beta1 + (beta2 / phi) * (1.0 - smooth * smooth))


@compiled
def extrapolated(value, rate, age, horizon):  # type: ignore[no-untyped-def]
    """A neighbour's value carried to the present by the rate it sent, for at most ``horizon`` seconds."""
    return value + rate * min(age, horizon)
