"""Compare a run with the monograph: with values that its text and its axes give."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ftcc.groundside.report.curves import Flown, curves_of, has_columns, last_time
from ftcc.groundside.report.definitions import Reading, Sheet

__all__ = ["Compared", "compare"]

_NEAR = 0.25
"""Allowed difference from a value read off a plot, as a share of the span of values."""
_INSIDE = 0.02
"""Allowed excess beyond an axis, as a share of its span; ticks are rounded."""


@dataclass(frozen=True)
class Compared:
    """A reading compared with a run."""

    figure: str
    what: str
    unit: str
    monograph: str
    measured: str
    agrees: bool | None
    """None if the run has no such value."""
    difference: str


def compare(sheet: Sheet, flight: Flown) -> Iterator[Compared]:
    """Compare all readings of a sheet with a flight."""
    for figure in sheet.figures:
        for reading in figure.readings:
            yield _compared(figure.number, reading, flight)


def _compared(number: str, reading: Reading, flight: Flown) -> Compared:
    low, high = reading.monograph
    sense = {"extremes": "", "within": "within ", "lowest": "lowest ", "highest": "highest "}[reading.kind]
    monograph = f"{sense}{_span(low, high)}"

    def result(measured: str, agrees: bool | None, difference: str) -> Compared:
        parts = [part for part in (difference, reading.remark) if part]
        return Compared(number, reading.what, reading.unit, monograph, measured, agrees, "; ".join(parts))

    if not has_columns(flight, [reading.y], reading.pairs):
        return result("-", None, "not recorded")
    if reading.window is not None and last_time(flight) < reading.window[1] - 1e-6:
        return result("-", None, "not flown")
    values = [c.y for c in curves_of(reading.y, flight, reading.uavs, reading.pairs, reading.window)]
    values = [y[np.isfinite(y)] for y in values]
    values = [y for y in values if len(y)]
    if not values:
        return result("-", None, "nothing recorded in the window")
    least, greatest = min(float(y.min()) for y in values), max(float(y.max()) for y in values)
    span = high - low or abs(high) or 1.0
    if reading.kind != "extremes":
        one = {"lowest": (least, least), "highest": (greatest, greatest)}
        least, greatest = one.get(reading.kind, (least, greatest))
        beyond = max(low - least, greatest - high)
        agrees = beyond <= _INSIDE * span
        difference = "" if agrees else f"{beyond:.2g} {reading.unit} beyond"
    else:
        worst = max((least - low, "lowest"), (greatest - high, "highest"), key=lambda pair: abs(pair[0]))
        agrees = abs(worst[0]) <= _NEAR * span
        difference = "" if agrees else f"the {worst[1]} value differs by {worst[0]:+.2g} {reading.unit}"
    return result(_span(least, greatest), agrees, difference)


def _span(low: float, high: float) -> str:
    """Format an interval with digits that suit its width."""
    width = high - low
    if width <= 1e-12 * max(abs(low), abs(high), 1.0):
        return f"{low:.5g}"
    digits = max(0, min(6, 2 - math.floor(math.log10(width))))
    return f"{low:.{digits}f} to {high:.{digits}f}"
