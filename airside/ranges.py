"""Which values a gain may take, and why no others: the ranges that schemes give their gains by what these do.

A scheme lists them as ``RANGES = {FEEDBACK: "k11 k12", SWITCH: "observers", ...}``. What depends on the flight too (its
graph, its periods) belongs into the scheme's ``check``, which is asked only for gains within their ranges.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

__all__ = [
    "ADAPTATION",
    "ALTITUDE",
    "ANGLE_LIMIT",
    "BANK",
    "COUPLING",
    "DAMPING",
    "EXPONENT",
    "FEEDBACK",
    "FILTER_TIME",
    "FINITE_TIME",
    "FREQUENCY",
    "INNER_SHARE",
    "LAYER",
    "LEAK",
    "LIMIT",
    "LIMIT_OR_OFF",
    "OPTIONAL_FREQUENCY",
    "OPTIONAL_TIME",
    "ORDER",
    "POLES",
    "SHARE",
    "STEPS",
    "SWITCH",
    "TIME",
    "WEIGHT",
    "Range",
]


class Range(NamedTuple):
    """From ``least`` to ``most``, without the ends where they are ``open``; ``why`` completes "else ..."."""

    least: float
    most: float
    why: str
    open: bool = False
    only: tuple[float, ...] = ()
    """If there are some: the values that there are."""
    whole: bool = False
    untried: float = math.inf
    """Factor beyond every value that was flown from which on a value is worth a warning."""

    def refusal(self, value: float) -> str:
        """What is wrong with a value, as the end of a sentence; empty if nothing is."""
        if math.isfinite(value) and self._holds(value):
            return ""
        return f"must be {self}, else {self.why}"

    def remark(self, value: float, flown: Iterable[float]) -> str:
        """What is worth saying of a value that is allowed, beside those that have been ``flown``; empty if nothing."""
        known = [abs(one) for one in flown if one != 0.0]
        if not known or value == 0.0:
            return ""
        if abs(value) > self.untried * max(known):
            return f"{abs(value) / max(known):.3g} times the largest value that was flown, {max(known):g}"
        if abs(value) < min(known) / self.untried:
            return f"1/{min(known) / abs(value):.3g} of the least value that was flown, {min(known):g}"
        return ""

    def _holds(self, value: float) -> bool:
        if self.only:
            return value in self.only
        if self.whole and value != int(value):
            return False
        return self.least < value < self.most if self.open else self.least <= value <= self.most

    def __str__(self) -> str:
        if self.only:
            return " or ".join(f"{one:g}" for one in self.only)
        number = "a whole number " if self.whole else ""
        if math.isinf(self.most):
            return number + (f"above {self.least:g}" if self.open else f"at least {self.least:g}")
        return number + (
            f"above {self.least:g} and below {self.most:g}" if self.open else f"from {self.least:g} to {self.most:g}"
        )


_FAR = 10.0

FEEDBACK = Range(
    0.0, 1e4, "the loop does not pull its error back, or is too fast for any aircraft", open=True, untried=_FAR
)
"""Of an error, or of an observer's error."""
COUPLING = Range(0.0, 1e4, "it drives its error away, or is too fast for any aircraft", untried=_FAR)
"""Of a term that may be left out with 0."""
FINITE_TIME = Range(
    0.0, 1e4, "the finite-time term drives its error away, or is too fast for any aircraft", untried=_FAR
)
WEIGHT = Range(0.0, 1e3, "the errors that it weighs cancel, or drown all others", open=True, untried=_FAR)
ADAPTATION = Range(0.0, 1e4, "the opposite is learnt, or it jumps at every step", untried=_FAR)
LEAK = Range(0.0, 1e2, "what is learnt grows by itself, or is forgotten at once", untried=_FAR)
FREQUENCY = Range(0.0, 1e4, "the filter runs away, or is too fast for any step", open=True, untried=_FAR)
OPTIONAL_FREQUENCY = Range(0.0, 1e4, "the filter runs away, or is too fast for any step; 0 is off", untried=_FAR)
FILTER_TIME = Range(0.0, 1e3, "the filter runs away, or lets nothing pass", open=True, untried=_FAR)
OPTIONAL_TIME = Range(0.0, 1e3, "the filter runs away, or lets nothing pass; 0 is off", untried=_FAR)
DAMPING = Range(0.0, 1e3, "the filter swings up, or stands still", open=True, untried=_FAR)
LAYER = Range(0.0, math.inf, "there is nothing to divide by", open=True, untried=_FAR)
"""Boundary layers, thresholds and widths, by which a law divides."""
LIMIT = Range(0.0, math.inf, "nothing is let through", open=True)
LIMIT_OR_OFF = Range(0.0, math.inf, "nothing is let through; 0 is no limit")
ANGLE_LIMIT = Range(0.0, 0.5 * math.pi, "it limits no angle; 0 is no limit")
TIME = Range(0.0, math.inf, "it is no span of time")
EXPONENT = Range(0.0, 1.0, "the term is no finite-time term", open=True)
INNER_SHARE = Range(0.0, 1.0, "there is nothing on one of its sides", open=True)
SHARE = Range(0.0, 1.0, "it is no fraction")
STEPS = Range(1.0, 100.0, "no tick can be divided so", whole=True)
SWITCH = Range(0.0, 1.0, "it is neither on nor off", only=(0.0, 1.0))
ORDER = Range(0.0, 0.99, "the order is none of an integral below the first")
POLES = Range(0.5, 20.0, "the operator is too coarse, or too large")
"""Per decade."""
BANK = Range(0.0, 0.5 * math.pi, "lift does not carry the aircraft", open=True)
ALTITUDE = Range(-1e3, 3e4, "no aircraft of this kind is there")
