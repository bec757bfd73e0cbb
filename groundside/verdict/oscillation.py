"""Limit cycles: oscillations that go on, told from transients, noise and what somebody commands.

The criterion is spectral. In the last third of a signal, one line above the slowest that counts must hold most of the
power, and its amplitude, followed through three overlapping halves of that third, must not decay.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["LEAST_PERIODS", "Oscillation", "is_driven", "oscillation"]

Array = NDArray[np.float64]

LEAST_PERIODS = 8
"""In the last third: what is slower is taken for a drift or a manoeuvre."""
_SHARE = 0.5
"""Of the power at `LEAST_PERIODS` and faster that the line and its neighbourhood must hold."""
_WIDTH = 0.1
"""Half-width of that neighbourhood, as a share of the frequency; two lines of the spectrum at least."""
_DECAY = 0.7
"""An amplitude that in the end is less than this share of the largest decays."""
_HARMONICS = (1.0, 2.0, 3.0)
"""What answers a commanded oscillation comes at its frequency or at these multiples of it."""


class Oscillation(NamedTuple):
    """A line that dominates the end of a signal."""

    frequency: float
    """rad/s."""
    amplitude: float
    """At the end, in the unit of the signal."""


def _spectrum(x: Array) -> Array:
    """Power of each line of ``x`` without its straight trend, under a Hann window; their sum is the mean power."""
    n = len(x)
    s = np.arange(n) - (n - 1) / 2.0
    window = np.hanning(n)
    straight = x - x.mean() - s * ((s * x).sum() / (s * s).sum())
    found: Array = 2.0 * np.abs(np.fft.rfft(straight * window)) ** 2 / (n * (window * window).sum())
    return found


def _around(line: float) -> slice:
    """The neighbourhood of a line."""
    half = max(2.0, _WIDTH * line)
    return slice(max(0, round(line - half)), round(line + half) + 1)


def oscillation(t: Array, x: Array, floor: float = 0.0) -> Oscillation | None:
    """The oscillation in which a signal ends, None if there is none.

    Parameters
    ----------
    t, x : arrays (n,)
        Times (s), evenly spaced, and values.
    floor : float
        Least amplitude that matters.
    """
    # Rows at the end may lack what one of two processes has not written.
    x = x[: int(np.flatnonzero(np.isfinite(x))[-1]) + 1] if np.isfinite(x).any() else x[:0]
    # A length of many factors two, of which a spectrum is quickly made.
    n = len(x) // 3
    n -= n % 64
    third = np.ascontiguousarray(x[len(x) - n :])
    if n < 4 * LEAST_PERIODS or not np.isfinite(third).all() or np.ptp(third[n // 2 :]) <= 2.0 * floor:
        return None
    power = _spectrum(third)
    line = LEAST_PERIODS + int(np.argmax(power[LEAST_PERIODS:]))
    all_of_it = float(power[LEAST_PERIODS:].sum())
    # The flank of something slower is no line.
    if power[line] <= power[line - 1] or power[_around(line)].sum() < _SHARE * all_of_it:
        return None
    half = n // 2
    parts = (third[start : start + half] for start in (0, (n - half) // 2, n - half))
    amplitudes = [float(np.sqrt(2.0 * _spectrum(part)[_around(line * half / n)].sum())) for part in parts]
    if amplitudes[-1] <= floor or amplitudes[-1] < _DECAY * max(amplitudes):
        return None
    duration = float(t[-1] - t[-2]) * n
    return Oscillation(2.0 * np.pi * line / duration, amplitudes[-1])


def is_driven(frequency: float, given: Iterable[float]) -> bool:
    """Whether an oscillation answers one of ``given`` frequencies (rad/s), or is a multiple of it."""
    return any(abs(frequency - n * one) <= _WIDTH * frequency for one in given for n in _HARMONICS)
