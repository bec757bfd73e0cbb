"""Observers: of disturbances, and of a reference that only some neighbours know."""

from __future__ import annotations

import math

from ftcc.airside.elements.filters import sliding_mode_differentiator_step
from ftcc.airside.elements.nonlinear import signed_power
from ftcc.link.compiled import compiled

__all__ = [
    "discrete_disturbance_observer_step",
    "discrete_disturbance_observer_steps",
    "disturbance_observer_rate",
    "finite_time_observer",
    "reference_system_step",
    "sliding_mode_observer",
    "unexplained_acceleration",
]


@compiled
def disturbance_observer_rate(gain, error, state, known, reference_rate):
    """Rate of the state xi of a first-order disturbance observer, eqs. (4.16), (5.20), (5.32), (5.36).

    For error' = known + d - reference_rate, with ``known`` = f + g u of the input that acts, the estimate
    d_hat = xi + gain error obeys d_hat' = gain (d - d_hat).
    """
    return -gain * (known + state + gain * error - reference_rate)


@compiled
def discrete_disturbance_observer_step(estimate, disturbance, measured, explained, w, h):
    """A sampled observer of d in x' = ``explained`` + d, with bandwidth ``w`` (rad/s; not in the monograph).

    The gains are 1 - z^2 and (1 - z)^2 with z = exp(-w h), close to which its two poles lie while w h is small. A
    constant d is found without error. Steps itself.

    Returns
    -------
    estimate of x and of d after the step
    """
    pole = math.exp(-w * h)
    error = measured - estimate
    after = estimate + h * (explained + disturbance) + (1.0 - pole * pole) * error
    return after, disturbance + (1.0 - pole) * (1.0 - pole) / h * error


@compiled
def discrete_disturbance_observer_steps(estimate, disturbance, measured, explained, w, h):
    """`discrete_disturbance_observer_step` of three axes."""
    x, d_x = discrete_disturbance_observer_step(estimate[0], disturbance[0], measured[0], explained[0], w, h)
    y, d_y = discrete_disturbance_observer_step(estimate[1], disturbance[1], measured[1], explained[1], w, h)
    z, d_z = discrete_disturbance_observer_step(estimate[2], disturbance[2], measured[2], explained[2], w, h)
    return (x, y, z), (d_x, d_y, d_z)


@compiled
def unexplained_acceleration(gain, rate, state, explained):
    """Estimate of the part of an acceleration that ``explained`` does not account for (not in the monograph).

    For rate' = explained + d, the estimate d_hat = gain (rate - state) obeys d_hat' = gain (d - d_hat).

    Returns
    -------
    d_hat, state' : float
    """
    estimate = gain * (rate - state)
    return estimate, explained + estimate


@compiled
def reference_system_step(model, gap, value, derivative, rate, explained, gain, bound, h):
    """Sliding-mode estimate of the part of an acceleration that a model does not explain: chapter 9 [R].

    The reference system model' = explained + gain gap, gap = rate - model, makes gap' = d - gain gap; a Levant
    differentiator of the gap with ``bound`` > abs(gap'') then gives d exactly after a finite time. Steps itself over
    the last ``h`` seconds, in which ``explained`` is the mean of the modelled acceleration.

    Returns
    -------
    d_hat, model, gap, value, derivative : float
        The estimate; then the states: reference system, gap, and the differentiator's two.
    """
    model += h * (explained + gain * gap)
    new_gap = rate - model
    value, derivative = sliding_mode_differentiator_step(
        value, derivative, new_gap, 1.5 * math.sqrt(bound), 1.1 * bound, h
    )
    return derivative + gain * gap, model, new_gap, value, derivative


@compiled
def sliding_mode_observer(disagreement, beta1, beta2, phi):
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
def finite_time_observer(rate, disagreement, rate_disagreement, beta1, beta2, beta3, beta4, exponent, kappa):
    """Rates of a distributed finite-time estimate of position and velocity, eqs. (6.22)-(6.23).

    ``rate`` is the velocity estimate, the disagreements are sum_j a_ij (own - neighbour's) of position and velocity;
    sign is smoothed to tanh(./kappa). ``beta4`` must exceed the leaders' acceleration (Lemma 6.6).

    Returns
    -------
    position', velocity' : float
    """
    return (
        rate - beta1 * signed_power(disagreement, exponent) - beta2 * math.tanh(disagreement / kappa),
        -beta3 * signed_power(rate_disagreement, exponent) - beta4 * math.tanh(rate_disagreement / kappa),
    )
