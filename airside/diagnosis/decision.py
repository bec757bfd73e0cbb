"""From residuals to a decision with a clock: is something wrong, since when, and what.

Detection: a two-sided cumulative sum (Page, Biometrika 41, 1954) of the residual beyond a drift. The residual is the
smaller of two that must agree in sign: that of the motion as it is, which moving air disturbs, and that of the motion
less what the air does, which a disturbance of the flight path disturbs.

Isolation: Wald statistics of the filter's estimates after the alarm, which the filter's covariances scale: is there a
bias, is there a loss; and a regression that asks whether the actuator lags.
"""

from __future__ import annotations

from ftcc.airside.diagnosis.beliefs import (
    BIAS,
    FLOATING,
    LOSS,
    NO_KIND,
    STUCK,
    WRONG,
)
from ftcc.link.compiled import compiled, fill

__all__ = ["SLUGGISH", "agreeing", "forget", "gather", "kind_of", "lags", "sum_up"]

SLUGGISH = 0.3
"""Time constant of the lag that a slow actuator is compared with, s."""

_FORGET = 2.0
"""Time constant of the sums, s."""
_N, _Y, _U, _W, _YY, _UU, _WW, _UY, _WY, _UW = range(10)
_CERTAIN = 9.0
"""Wald statistic of an effect that is there: 3 standard deviations."""
_ABSENT = 4.0
"""Of one that is not: 2 standard deviations."""
_FLOOR_EFFECTIVENESS = 0.04
"""Below this a loss is not told from errors of the model."""
_NOTHING = 0.15
"""Effectiveness that counts as none."""


@compiled
def agreeing(first, second):
    """The smaller one in size where both have one sign, else 0 (minmod)."""
    if first > 0.0 and second > 0.0:
        return min(first, second)
    if first < 0.0 and second < 0.0:
        return max(first, second)
    return 0.0


@compiled
def sum_up(total, residual, drift, most, dt):
    """One step of a one-sided cumulative sum: of the ``residual``, at most ``most``, beyond the ``drift``."""
    return max(total + dt * (min(residual, most) - drift), 0.0)


@compiled
def gather(sums, residual, position, lagging, dt):
    """Add a sample to the sums (10,) of residual y, position u, and w, by which u is ahead of a sluggish actuator."""
    for n in range(10):
        sums[n] *= 1.0 - dt / _FORGET
    y, u, w = residual, position, lagging
    sums[_N] += 1.0
    sums[_Y] += y
    sums[_U] += u
    sums[_W] += w
    sums[_YY] += y * y
    sums[_UU] += u * u
    sums[_WW] += w * w
    sums[_UY] += u * y
    sums[_WY] += w * y
    sums[_UW] += u * w


@compiled
def _explained(syy, sxx, sxy):
    """Share of the spread of y that a regression on x explains, and its slope."""
    if sxx <= 1e-12 or syy <= 1e-12:
        return 0.0, 0.0
    return sxy * sxy / (sxx * syy), sxy / sxx


@compiled
def lags(sums, least_spread):
    """Whether the actuator lags: w explains the residual with a negative slope, and far better than u does.

    ``least_spread`` is the standard deviation of w from which on there is anything to see.
    """
    n = sums[_N]
    if n < 2.0:
        return False
    syy = sums[_YY] - sums[_Y] * sums[_Y] / n
    suu, sww = sums[_UU] - sums[_U] * sums[_U] / n, sums[_WW] - sums[_W] * sums[_W] / n
    suy, swy = sums[_UY] - sums[_U] * sums[_Y] / n, sums[_WY] - sums[_W] * sums[_Y] / n
    if sww < n * least_spread * least_spread:
        return False
    by_w, slope = _explained(syy, sww, swy)
    by_u, _ = _explained(syy, suu, suy)
    return slope < -0.3 and by_w > 0.5 and 1.0 - by_w < 0.5 * (1.0 - by_u)


@compiled
def forget(sums):
    """Begin the sums anew."""
    fill(sums, 0.0)


@compiled
def kind_of(loss, bias, P_loss, P_bias, effectiveness, floor):
    """The kind of fault that estimates speak for; `NO_KIND` while they do not.

    ``loss`` and ``bias`` are the changes of effectiveness and additive effect, ``P_loss`` and ``P_bias`` their
    variances, ``floor`` the additive effect (unit) that errors of the model may have.
    """
    by_loss = loss * loss / (P_loss + _FLOOR_EFFECTIVENESS * _FLOOR_EFFECTIVENESS)
    by_bias = bias * bias / (P_bias + floor * floor)
    if effectiveness < _NOTHING and P_loss < 0.01:
        return STUCK if by_bias > _CERTAIN else FLOATING
    if by_loss > _CERTAIN and by_bias < _ABSENT:
        return LOSS
    if by_bias > _CERTAIN and by_loss < _ABSENT:
        return BIAS
    if by_loss > _CERTAIN and by_bias > _CERTAIN:
        return WRONG
    return NO_KIND
