"""Metrics by name: each computes one number from the values of an expression within a window."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.claims.expressions import CLOSE

__all__ = ["METRICS", "Metric"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Metric:
    """A number from the rows of one UAV, and how the numbers of several UAVs are combined."""

    function: Callable[[Array, Array, float], float]
    """(times (n,) in s, values (n,), threshold) -> number, from the rows within the window."""
    across: str
    """"max" or "min" over the UAVs, or "farthest": that of the UAV farthest from the expected value."""
    meaning: str
    threshold: bool = False
    """Whether the metric needs a threshold."""
    survives_loss: bool = False
    """Whether the metric is also defined for a UAV that is lost within the window."""


def _time_until_below(t: Array, x: Array, threshold: float) -> float:
    above = np.flatnonzero(~(np.abs(x) <= threshold))
    if len(above) == 0:
        return 0.0
    return math.inf if above[-1] == len(x) - 1 else float(t[above[-1]] - t[0])


def _first_time(t: Array, x: Array, threshold: float) -> float:
    there = np.flatnonzero(np.abs(x) >= threshold)
    return float(t[there[0]]) if len(there) else math.inf


def _first_time_within(t: Array, x: Array, threshold: float) -> float:
    there = np.flatnonzero(np.abs(x) <= threshold)
    return float(t[there[0]]) if len(there) else math.inf


def _duration_above(t: Array, x: Array, threshold: float) -> float:
    spacing = float(t[1] - t[0]) if len(t) > 1 else 0.0
    return float((x >= threshold).sum()) * spacing


def _rms_change(t: Array, x: Array, seconds: float) -> float:
    spacing = float(t[1] - t[0]) if len(t) > 1 else math.inf
    rows = max(1, round(seconds / spacing)) if spacing < math.inf else 1
    change = x[rows:] - x[:-rows]
    return float(np.sqrt((change * change).mean())) if len(change) else math.nan


def _departure(t: Array, x: Array, seconds: float) -> float:
    return float(np.abs(x - x[t <= t[0] + seconds + CLOSE].mean()).max())


def _time_until_settled(t: Array, x: Array, threshold: float) -> float:
    last_fifth = t >= t[-1] - 0.2 * (t[-1] - t[0]) - CLOSE
    return _time_until_below(t, x - x[last_fifth].mean(), threshold)


METRICS = {
    "value_at": Metric(lambda t, x, _: float(x[-1]), "farthest", "value at the end of the window"),
    "max_abs": Metric(lambda t, x, _: float(np.abs(x).max()), "max", "largest absolute value"),
    "max": Metric(lambda t, x, _: float(x.max()), "max", "largest value"),
    "min": Metric(lambda t, x, _: float(x.min()), "min", "smallest value"),
    "mean": Metric(lambda t, x, _: float(x.mean()), "farthest", "mean"),
    "std": Metric(lambda t, x, _: float(x.std()), "max", "standard deviation"),
    "peak_to_peak": Metric(lambda t, x, _: float(np.ptp(x)), "max", "largest minus smallest value"),
    "rms": Metric(lambda t, x, _: float(np.sqrt((x * x).mean())), "max", "root mean square"),
    "integral_of_square": Metric(
        lambda t, x, _: float(np.trapezoid(x * x, t)), "max", "integral of the square over the window"
    ),
    "time_until_below": Metric(
        _time_until_below, "max", "time from the window's beginning until abs(x) stays within the threshold, s", True
    ),
    "time_until_settled": Metric(
        _time_until_settled,
        "max",
        "time from the window's beginning until x stays within the threshold of the mean of the last fifth, s",
        True,
    ),
    "departure": Metric(
        _departure, "max", "largest distance from the mean over the window's first seconds, threshold of them", True
    ),
    "rms_change": Metric(
        _rms_change, "max", "root mean square of the change in so many seconds, threshold of them", True
    ),
    "first_time": Metric(_first_time, "max", "time at which abs(x) first reaches the threshold, s", True),
    "first_time_within": Metric(
        _first_time_within, "max", "time at which abs(x) is first within the threshold, s", True
    ),
    "mean_change": Metric(
        lambda t, x, _: float(np.abs(np.diff(x)).mean()), "max", "mean absolute change from row to row"
    ),
    "last_time": Metric(
        lambda t, x, _: float(t[-1]), "min", "time of the last row, also of a UAV that is lost, s", survives_loss=True
    ),
    "duration_above": Metric(_duration_above, "max", "time for which x is at or above the threshold, s", True),
}
