"""Limit cycles: sustained oscillations, distinguished from transients, noise and commanded oscillations.

A signal has a limit cycle if, in its last third,

- one line of the spectrum holds most of the power of all lines that are faster than a drift,
- the amplitude about the mean over one period exceeds a floor in each of the last periods, and
- the amplitude at the end is at least half of that at the beginning of the third.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["LEAST_PERIODS", "Oscillation", "is_forced", "oscillation"]

Array = NDArray[np.float64]

LEAST_PERIODS = 8
"""Fewest periods in the last third; anything slower is a drift or a manoeuvre. So many last periods must oscillate."""
SHARE = 0.5
"""Share of the power of all faster lines that the line and its neighbourhood must hold."""
WIDTH = 0.1
"""Half-width of the neighbourhood, as a share of the frequency; at least two lines of the spectrum."""
DECAY = 0.5
"""An oscillation decays if its last amplitude is less than this share of its first."""
STEADY = 0.3
"""Least amplitude of the last periods, as a share of the largest: several lines may beat."""

_HARMONICS = (1.0, 2.0, 3.0)
"""The response to a commanded oscillation has its frequency, or these multiples of it."""


class Oscillation(NamedTuple):
    """A sustained oscillation at the end of a signal."""

    frequency: float
    """rad/s."""
    amplitude: float
    """Half of peak to peak, in the unit of the signal: median of the last periods."""


def _spectrum(x: Array) -> Array:
    """Return the power of each line of ``x`` without its linear trend, with a Hann window."""
    n = len(x)
    s = np.arange(n) - (n - 1) / 2.0
    straight = x - x.mean() - s * ((s * x).sum() / (s * s).sum())
    found: Array = np.abs(np.fft.rfft(straight * np.hanning(n))) ** 2
    return found


def _swings(x: Array, period: int) -> Array:
    """Return half of peak to peak in each period (in rows), of ``x`` minus its moving mean over one period."""
    total = np.concatenate([[0.0], np.cumsum(x - x[0])])
    mean = (total[period:] - total[:-period]) / period + x[0]
    swinging = x[period // 2 :][: len(mean)] - mean
    count = len(swinging) // period
    found: Array = np.ptp(swinging[len(swinging) - count * period :].reshape(count, period), axis=1) / 2.0
    return found


def oscillation(t: Array, x: Array, floor: float = 0.0) -> Oscillation | None:
    """Return the oscillation at the end of a signal, None if there is none.

    Parameters
    ----------
    t, x : arrays (n,)
        Times (s), evenly spaced, and values; values at the end that are not finite are left out.
    floor : float
        Amplitudes up to this one are ignored, in the unit of ``x``.
    """
    known = np.flatnonzero(np.isfinite(x))
    rows = int(known[-1]) + 1 if len(known) else 0
    # A multiple of 64: its spectrum is fast to compute.
    n = rows // 3 - rows // 3 % 64
    x = np.ascontiguousarray(x[rows - n : rows])
    if n < 4 * LEAST_PERIODS or not np.isfinite(x).all() or np.ptp(x[-n // LEAST_PERIODS :]) <= 2.0 * floor:
        return None
    power = _spectrum(x)
    line = LEAST_PERIODS + int(np.argmax(power[LEAST_PERIODS:]))
    half = max(2.0, WIDTH * line)
    neighbourhood = power[max(0, round(line - half)) : round(line + half) + 1]
    # The flank of a slower line is not a line of its own.
    if power[line] <= power[line - 1] or neighbourhood.sum() < SHARE * power[LEAST_PERIODS:].sum():
        return None
    swings = _swings(x, round(n / line))
    last, quarter = swings[1 - LEAST_PERIODS :], max(1, len(swings) // 4)
    before, after = float(np.median(swings[:quarter])), float(np.median(swings[-quarter:]))
    if last.min() <= floor or last.min() < STEADY * last.max() or after < DECAY * before:
        return None
    return Oscillation(2.0 * np.pi * line / (float(t[1] - t[0]) * n), float(np.median(last)))


def is_forced(frequency: float, commanded: Iterable[float]) -> bool:
    """Return whether a frequency (rad/s) is one of the ``commanded`` frequencies (rad/s) or a multiple of one."""
    return any(abs(frequency - n * one) <= WIDTH * frequency for one in commanded for n in _HARMONICS)
