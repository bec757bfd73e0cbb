"""The clocks of two computers: their offset, measured by round trips, and instants carried from one to the other."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

from ftcc.link.gate import Go, Pace

__all__ = ["Offset", "measure", "with_monotonic", "with_unix"]

_ROUNDS = 20
_TIMEOUT = 2.0
"""Longest wait for one answer, wall s."""


class Offset(NamedTuple):
    """Another computer's clock minus this one's."""

    seconds: float
    uncertainty: float
    """Half the shortest round trip, s: the offset may be wrong by so much."""

    def __str__(self) -> str:
        """Return it in ms."""
        return f"{1e3 * self.seconds:+.3f} ms, to within {1e3 * self.uncertainty:.3f} ms"


def measure(ask: Callable[[float], int | None], rounds: int = _ROUNDS) -> Offset | None:
    """Return the offset of the clock that ``ask(timeout)`` reads (Unix time, ns); None if it gives no answer.

    The shortest of several round trips counts: its halves differ least.
    """
    best = None
    for _ in range(rounds):
        before = time.time_ns()
        theirs = ask(_TIMEOUT)
        after = time.time_ns()
        if theirs is not None:
            found = Offset((theirs - (before + after) / 2.0) / 1e9, (after - before) / 2e9)
            best = found if best is None or found.uncertainty < best.uncertainty else best
    return best


def with_unix(message: object) -> object:
    """Return a message of the gate with the instant of its pace as Unix time, for another computer."""
    return _shifted(message, time.time() - time.monotonic())


def with_monotonic(message: object, offset: float) -> object:
    """Return a message from a computer whose clock is ``offset`` s ahead, with its instant by this monotonic clock."""
    return _shifted(message, time.monotonic() - time.time() - offset)


def _shifted(message: object, by: float) -> object:
    match message:
        case Pace(wall, tick, speed):
            return Pace(wall + by, tick, speed)
        case Go(pace, limit):
            return Go(Pace(pace.wall + by, pace.tick, pace.speed), limit)
    return message
