"""From residuals to a decision with a clock: is something wrong, since when, and what.

Detection: a two-sided cumulative sum (Page, Biometrika 41, 1954) of the residual beyond a drift. The residual is the
smaller of two that must agree in sign: that of the motion as it is, which moving air disturbs, and that of the motion
less what the air does, which a disturbance of the flight path disturbs.

Isolation: hypotheses about the kind are compared by how well each explains the residual since the onset.
"""

from __future__ import annotations

import math

from ftcc.airside.diagnosis.beliefs import BIAS, FLOATING, LOSS, NO_KIND, SLOW, STUCK, WRONG
from ftcc.link.compiled import compiled

__all__ = ["SLEWS", "SUMS", "agreeing", "follow", "gather", "kind_of", "sum_up"]

SLEWS = (0.04, 0.12, 0.36, 1.1)
"""Slews of the bank of slow actuators, travels a second."""
SUMS = 6
"""Number of sums of `gather`."""

_FORGET = 6.0
"""Time constant of the sums, s."""
_N, _Y, _U, _YY, _UU, _UY = range(SUMS)
_TINY = 1e-12
_RELATIVE = 0.04
"""Error of the model, as a share of the position."""
_INDEPENDENT = 5.0
"""Independent samples of a residual a second: what the model leaves changes slowly."""
_COSTS = (0.0, 1.0, 1.0, 2.2, 1.6, 0.5, 2.2)
"""By kind: of its free numbers, in units of log-likelihood."""
_ALL = 0.8
"""Loss that counts as total."""
_CLEAR = 0.7
"""By how much the best kind must be better than the second."""


@compiled
def agreeing(calm, direct, slack):
    """Of the residual ``calm`` what ``direct`` confirms but for ``slack``, which is how much the air moves that one."""
    if calm > 0.0:
        return min(calm, max(direct + slack, 0.0))
    return max(calm, min(direct - slack, 0.0))


@compiled
def sum_up(total, residual, drift, most, dt):
    """One step of a one-sided cumulative sum: of the ``residual``, at most ``most``, beyond the ``drift``."""
    return max(total + dt * (min(residual, most) - drift), 0.0)


@compiled
def gather(sums, residual, position, dt):
    """Add a sample to the sums (6,) of residual y and position u that `kind_of` needs."""
    for n in range(sums.shape[0]):
        sums[n] *= 1.0 - dt / _FORGET
    y, u = residual, position
    sums[_N] += 1.0
    sums[_Y] += y
    sums[_U] += u
    sums[_YY] += y * y
    sums[_UU] += u * u
    sums[_UY] += u * y


@compiled
def follow(slow, lagging, off, square, residual, position, travel, bandwidth, dt):
    """Move a bank of slow actuators by a tick, and sum up how well each explains the ``residual``.

    ``slow`` (4,) are their positions, ``lagging`` (4,) by how much they are behind ``position``, through the filter of
    the residual, ``off`` and ``square`` (4,) weighted sums of what each leaves unexplained, and of its squares.
    """
    for n in range(slow.shape[0]):
        most = SLEWS[n] * travel * dt
        slow[n] += min(max(position - slow[n], -most), most)
        lagging[n] += min(bandwidth * dt, 1.0) * (slow[n] - position - lagging[n])
        away = residual - lagging[n]
        off[n] = off[n] * (1.0 - dt / _FORGET) + away
        square[n] = square[n] * (1.0 - dt / _FORGET) + away * away


@compiled
def kind_of(sums, off, square, floor, surprises, effectiveness, bias, dt):
    """The kind of fault that explains the data best, or `NO_KIND` while none is clearly best.

    Loss, bias, stuck and floating are special cases of loss *and* bias, y = a u + b in the position u: they explain the
    residual as well, less what the estimator says against them, see `Surprises`. A slow actuator is one of the bank.
    Mean squares are compared by log-likelihood, with a cost for each free number (minimum description length, Rissanen,
    Automatica 14, 1978). ``floor`` is the size of residual that errors of the model may leave, ``effectiveness`` the
    estimate over that of the healthy actuator, ``bias`` the additive effect.
    """
    n = max(sums[_N], 1.0)
    yy, uu, uy = sums[_YY] / n, sums[_UU] / n, sums[_UY] / n
    y, u = sums[_Y] / n, sums[_U] / n
    syy, suu, suy = max(yy - y * y, 0.0), max(uu - u * u, 0.0), uy - u * y
    lines = syy - suy * suy / suu if suu > _TINY else syy
    # Where a slow actuator was at the presumed onset is not known.
    slowest = math.inf
    for m in range(square.shape[0]):
        slowest = min(slowest, max(square[m] / n - off[m] / n * off[m] / n, 0.0))
    weight = 0.5 * n * dt * _INDEPENDENT
    least = floor * floor + _RELATIVE * _RELATIVE * uu
    line = weight * math.log(max(lines, 0.0) + least)
    slow = weight * math.log(slowest + least)
    scores = (
        0.0,
        line + surprises.loss + _COSTS[LOSS],
        line + surprises.bias + _COSTS[BIAS],
        line + _COSTS[WRONG],
        line + surprises.stuck + _COSTS[STUCK],
        line + surprises.floating + _COSTS[FLOATING],
        slow + _COSTS[SLOW],
    )
    # What is left of the effectiveness is not known better than the nominal effectiveness is.
    gone = effectiveness < 1.0 - _ALL
    held = FLOATING if abs(bias) < (1.0 - _ALL) * math.sqrt(uu) else STUCK
    names = (NO_KIND, FLOATING if gone else LOSS, BIAS, held if gone else WRONG, held, FLOATING, SLOW)
    best = math.inf
    for candidate in range(LOSS, SLOW + 1):
        best = min(best, scores[candidate])
    kind = NO_KIND
    for candidate in range(LOSS, SLOW + 1):
        if scores[candidate] - best <= _CLEAR:
            if kind != NO_KIND and kind != names[candidate]:
                return NO_KIND
            kind = names[candidate]
    return kind
