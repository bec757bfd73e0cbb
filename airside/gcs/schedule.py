"""When telemetry is due: at its rate in simulated or in wall time, whichever is slower."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable

__all__ = ["SLOWEST", "Schedule"]

SLOWEST = 1e-3
"""Least rate of a stream that is not silent, Hz."""
_SLACK = 0.9
"""A message that is due a little early is sent: a tick that comes early must not halve the rate."""


class Schedule:
    """When which stream is due towards one peer.

    Parameters
    ----------
    rates : of each stream, Hz; 0 = silent.
    least : of each stream, Hz in simulated time alone, however fast that goes by; 0, or left out: none. The sender
        looks for them once a simulated second: `next_us` does not count them.
    """

    def __init__(self, rates: Iterable[float], least: Iterable[float] = ()) -> None:
        self._rates = list(rates)
        self._least = {n: int(_SLACK * 1e6 / rate) for n, rate in enumerate(least) if 0.0 < rate < self._rates[n]}
        """Simulated us after which those that have a least rate are due in any case."""
        self._last_us = [-(10**12)] * len(self._rates)
        self._last_wall = [-math.inf] * len(self._rates)
        self._next_us = 0
        self._next_wall = 0.0
        """Nothing is due before these times, simulated us and wall s (monotonic)."""

    @property
    def next_us(self) -> int:
        """Simulated time before which nothing is due."""
        return self._next_us

    @property
    def next_wall(self) -> float:
        """Wall time (monotonic, s) before which nothing is due either."""
        return self._next_wall

    def set(self, n: int, rate: float) -> None:
        """Set the rate of stream ``n``, Hz; 0 = silent."""
        self._rates[n] = rate
        self._next_us, self._next_wall = 0, 0.0

    def rate(self, n: int) -> float:
        """Rate of stream ``n``, Hz."""
        return self._rates[n]

    def due(self, now_us: int) -> list[int]:
        """The streams that are due at this tick."""
        if now_us < self._next_us:
            return []
        wall = time.monotonic()
        if wall < self._next_wall:
            return self._due_at_least(now_us, wall)
        found = []
        self._next_us, self._next_wall = now_us + 1_000_000, wall + 1.0
        for n, rate in enumerate(self._rates):
            if rate <= 0.0:
                continue
            interval_us = 1e6 / rate
            behind = now_us - self._last_us[n]
            late = n in self._least and behind >= self._least[n]
            if late or (behind >= _SLACK * interval_us and wall - self._last_wall[n] >= _SLACK / rate):
                # On the grid of the rate, so that a tick's length does not add up.
                self._last_us[n] += int(behind // interval_us * interval_us) or int(interval_us)
                self._last_wall[n] = wall
                found.append(n)
            self._next_us = min(self._next_us, max(now_us, int(self._last_us[n] + _SLACK * interval_us)))
            self._next_wall = min(self._next_wall, self._last_wall[n] + _SLACK / rate)
        return found

    def _due_at_least(self, now_us: int, wall: float) -> list[int]:
        """The streams that simulated time alone has come to."""
        found = [n for n, after in self._least.items() if self._rates[n] > 0.0 and now_us - self._last_us[n] >= after]
        for n in found:
            self._last_us[n], self._last_wall[n] = now_us, wall
        return found
