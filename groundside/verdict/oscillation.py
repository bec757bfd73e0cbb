"""Limit cycles: oscillations that go on, told from transients, noise and what somebody commands.

In the last third of a signal, one line of the spectrum must hold most of the power of all that is faster than a drift;
and, period by period, the signal must swing about its mean over a period by more than what matters, in each of the
last periods, and in the end by no less than half of what it did in the beginning of that third.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["LEAST_PERIODS", "Oscillation", "is_forced", "oscillation"]

Array = NDArray[np.float64]

LEAST_PERIODS = 8
"""In the last third: what is slower is taken for a drift or a manoeuvre. In all of the last so many it must swing."""
SHARE = 0.5
"""Of the power of what is not slower that the line and its neighbourhood must hold."""
WIDTH = 0.1
"""Half-width of that neighbourhood, as a share of the frequency; two lines of the spectrum at least."""
DECAY = 0.5
"""An amplitude that in the end is less than this share of the one before decays."""
STEADY = 0.3
"""The least of the last periods must be this share of the largest of them: several lines may beat."""

_HARMONICS = (1.0, 2.0, 3.0)
"""What answers a commanded oscillation comes at its frequency or at these multiples of it."""


class Oscillation(NamedTuple):
    """What a signal does in the end, over and over."""

    frequency: float
    """rad/s."""
    amplitude: float
    """Half of what it swings from peak to peak, in the unit of the signal: median of the last periods."""


def _spectrum(x: Array) -> Array:
    """Power of each line of ``x`` without its straight trend, under a Hann window."""
    n = len(x)
    s = np.arange(n) - (n - 1) / 2.0
    straight = x - x.mean() - s * ((s * x).sum() / (s * s).sum())
    found: Array = np.abs(np.fft.rfft(straight * np.hanning(n))) ** 2
    return found


def _swings(x: Array, period: int) -> Array:
    """Half of peak to peak in each period of so many rows, of ``x`` less its mean over a period around it."""
    total = np.concatenate([[0.0], np.cumsum(x - x[0])])
    mean = (total[period:] - total[:-period]) / period + x[0]
    swinging = x[period // 2 :][: len(mean)] - mean
    count = len(swinging) // period
    found: Array = np.ptp(swinging[len(swinging) - count * period :].reshape(count, period), axis=1) / 2.0
    return found


def oscillation(t: Array, x: Array, floor: float = 0.0) -> Oscillation | None:
    """The oscillation in which a signal ends, None if there is none.

    Parameters
    ----------
    t, x : arrays (n,)
        Times (s), evenly spaced, and values; what is not finite in the end is left out.
    floor : float
        Least amplitude that matters.
    """
    known = np.flatnonzero(np.isfinite(x))
    rows = int(known[-1]) + 1 if len(known) else 0
    # A length of many factors two, of which a spectrum is quickly made.
    n = rows // 3 - rows // 3 % 64
    x = np.ascontiguousarray(x[rows - n : rows])
    if n < 4 * LEAST_PERIODS or not np.isfinite(x).all() or np.ptp(x[-n // LEAST_PERIODS :]) <= 2.0 * floor:
        return None
    power = _spectrum(x)
    line = LEAST_PERIODS + int(np.argmax(power[LEAST_PERIODS:]))
    half = max(2.0, WIDTH * line)
    neighbourhood = power[max(0, round(line - half)) : round(line + half) + 1]
    # The flank of something slower is no line.
    if power[line] <= power[line - 1] or neighbourhood.sum() < SHARE * power[LEAST_PERIODS:].sum():
        return None
    swings = _swings(x, round(n / line))
    last, quarter = swings[1 - LEAST_PERIODS :], max(1, len(swings) // 4)
    before, after = float(np.median(swings[:quarter])), float(np.median(swings[-quarter:]))
    if last.min() <= floor or last.min() < STEADY * last.max() or after < DECAY * before:
        return None
    return Oscillation(2.0 * np.pi * line / (float(t[1] - t[0]) * n), float(np.median(last)))


def is_forced(frequency: float, commanded: Iterable[float]) -> bool:
    """Whether an oscillation answers one of ``commanded`` frequencies (rad/s), or is a multiple of it."""
    return any(abs(frequency - n * one) <= WIDTH * frequency for one in commanded for n in _HARMONICS)
