"""Stopping rules: when a study knows enough, such as ``P(lost) < 1e-3 at 95 %``."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass

from ftcc.groundside.errors import UserError
from ftcc.groundside.statistics.intervals import lower_bound, share, upper_bound

__all__ = ["LOST", "Until", "until_of"]

LOST = "lost"
"""`Until.claim` of aircraft lost."""

_GROWTH = 1.25
"""Each look has so many times the flights of the one before."""

_NUMBER = r"(?P<limit>[-+.\w]+)"
_LEVEL = r"(?:\s+at\s+(?P<level>[-+.\w]+)\s*%)?"
_NAME = r'(?:"(?P<claim>[^"]+)"|(?P<lost>lost))'
_WIDTH = re.compile(rf"\s*width(?:\s+of\s+{_NAME})?\s*<\s*{_NUMBER}{_LEVEL}\s*")
_PROBABILITY = re.compile(rf"\s*P\s*\(\s*{_NAME}\s*\)\s*(?P<sign>[<>])\s*{_NUMBER}{_LEVEL}\s*")
_RIGHT = 'must be such as: width < 0.01, width of "CLAIM" < 0.01, P(lost) < 1e-3 at 95 %, P("CLAIM") > 0.9 at 95 %'


@dataclass(frozen=True)
class Until:
    """When a study stops.

    ``P(...)`` is a statement that shall hold with its confidence although it is tested at every look: look k spends 6 /
    (pi^2 k^2) of the error, which adds up to the whole over all looks (Bonferroni). It holds however many looks there
    are, if their sizes are those of `looks`, fixed before. ``width`` is about the size of an interval, and is not
    corrected for the looks: the interval is the usual one for the flights that were flown.
    """

    text: str
    claim: str | None
    """Name of the claim whose share is asked; "lost": flights with lost aircraft; None: the study's headline."""
    sign: str
    """"width", or "<" or ">" of a probability."""
    limit: float
    confidence: float

    def looks(self, first: int = 64) -> Iterator[int]:
        """Yield the numbers of flights at which to look, each a quarter more than the one before, without end."""
        size = first
        while True:
            yield size
            size = math.ceil(size * _GROWTH)

    def reached(self, count: int, of: int, look: int) -> bool:
        """Return whether ``count`` of ``of`` flights are answer enough at a look, numbered from 1.

        Raises
        ------
        UserError
            ``count`` is not from 0 to ``of``, or ``look`` not from 1 on.
        """
        if look < 1:
            raise UserError(f"look {look}: looks are numbered from 1")
        if self.sign == "width":
            found = share(count, of, self.confidence)
            return found.high - found.low < self.limit
        confidence = 1.0 - (1.0 - self.confidence) * 6.0 / (math.pi * look) ** 2
        if self.sign == "<":
            return upper_bound(count, of, confidence) < self.limit
        return lower_bound(count, of, confidence) > self.limit


def until_of(text: str) -> Until:
    """Read a stopping rule: the width of an interval, or a bound of a probability.

    ``width < 0.01`` (of the study's headline), ``width of "CLAIM" < 0.01``, ``P(lost) < 1e-3 at 95 %``, ``P("CLAIM") >
    0.9 at 95 %``; without ``at`` it is 95 %.

    Raises
    ------
    UserError
        The text is no such rule, or its limit not between 0 and 1, or its confidence not between 0 and 100 %.
    """
    found = _WIDTH.fullmatch(text) or _PROBABILITY.fullmatch(text)
    if found is None:
        raise UserError(f"until {text!r}: {_RIGHT}")
    parts = found.groupdict()
    if parts["claim"] == LOST:
        raise UserError(f"until {text!r}: lost without quotes asks for lost aircraft; no claim can have this name here")
    limit = _number(parts["limit"], text)
    if not 0.0 < limit < 1.0:
        raise UserError(f"until {text!r}: {parts['limit']} must be between 0 and 1")
    level = _number(parts["level"] or "95", text)
    if not 0.0 < level < 100.0:
        raise UserError(f"until {text!r}: at {parts['level']} % must be between 0 and 100 %")
    return Until(text.strip(), parts["claim"] or parts["lost"], parts.get("sign") or "width", limit, level / 100.0)


def _number(word: str, text: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise UserError(f"until {text!r}: {word} is no number; {_RIGHT}") from None
