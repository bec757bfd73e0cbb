"""Monitor the pace of a flight: measure it once per second, and warn once if it is too slow, with the cause."""

from __future__ import annotations

import collections
import dataclasses
import math
import os
from collections.abc import Iterable

from ftcc.groundside.dashboard import Pace
from ftcc.groundside.swarm.pace import Kind, PaceMeter, Sample, Setup, judge

__all__ = ["LATE_SHARE", "Pacing"]

_PERIOD = 1.0
"""Wall time between two measurements, s."""
_MISSES_BEFORE_WARNING = 5
"""Consecutive slow measurements before a warning, so that the start or a short delay causes none."""
LATE_SHARE = 0.05
"""Share of late ticks from which a flight on the wall clock counts as overloaded."""
_LATE_WINDOW = 2.0
"""Wall time over which the share of late ticks is measured, s."""


class Pacing:
    """The pace of one flight.

    Parameters
    ----------
    setup : how the swarm is flown.
    lockstep : whether a slow computer slows the flight; otherwise ticks are late.
    """

    def __init__(self, setup: Setup, lockstep: bool) -> None:
        self.pace = Pace(math.nan, setup.asked)
        """Latest measurement; its factor is nan during the first half second."""
        self._meter = PaceMeter(setup)
        self._lockstep = lockstep
        self._measured = -math.inf
        self._misses = 0
        """Consecutive slow measurements."""
        self._ticks: collections.deque[tuple[float, int, int, Sample]] = collections.deque()
        """Wall time, late ticks, all ticks and processor times, of the last seconds."""
        self._overloaded = False

    def set_speed(self, speed: float) -> None:
        """Set the requested speed, times real time; inf: as fast as possible."""
        asked = None if math.isinf(speed) else speed
        self._meter.setup = dataclasses.replace(self._meter.setup, asked=asked)
        self.restart()

    def restart(self) -> None:
        """Restart the measurement, after a start, a pause, a step or a change of speed."""
        self._meter.restart()
        self._ticks.clear()
        self._misses = 0
        self.pace = Pace(math.nan, self._meter.setup.asked)

    def measure(
        self,
        wall: float,
        t: float,
        ticks: tuple[int, int],
        processes: Iterable[tuple[str, int, Kind]],
        viewers: Iterable[int],
    ) -> str:
        """Measure the pace if a second has passed; return a warning, or an empty text.

        Parameters
        ----------
        wall, t : current monotonic and simulated time, s.
        ticks : late ticks of all vehicles so far, and all ticks.
        processes : name, pid and kind of each process that flies.
        viewers : pids of the dashboard's viewer.
        """
        if wall - self._measured < _PERIOD:
            return ""
        self._measured = wall
        processes, viewers = list(processes), list(viewers)
        self.pace = self._meter.measure(wall, t, processes, viewers, os.getpid())
        if self._lockstep:
            return self._check_lockstep()
        sample = self._meter.sample(wall, t, processes, viewers, os.getpid())
        return self._check_wall_clock(wall, *ticks, sample)

    def _check_lockstep(self) -> str:
        """Return a warning if a flight in lockstep misses the requested speed."""
        self._misses = self._misses + 1 if self.pace.asked is not None and self.pace.limit else 0
        if self._misses != _MISSES_BEFORE_WARNING:
            return ""
        text = f"{self.pace.factor:.2g} times real time instead of {self.pace.asked:g}: {self.pace.limit}"
        return f"{text}; {self.pace.advice} would help" if self.pace.advice else text

    def _check_wall_clock(self, wall: float, late: int, ticks: int, sample: Sample) -> str:
        """Return a warning if too many ticks of a flight on the wall clock are late."""
        self._ticks.append((wall, late, ticks, sample))
        while len(self._ticks) > 1 and self._ticks[1][0] <= wall - _LATE_WINDOW:
            self._ticks.popleft()
        begun, late_before, ticks_before, earlier = self._ticks[0]
        if wall - begun < _LATE_WINDOW or ticks == ticks_before:
            return ""
        share = (late - late_before) / (ticks - ticks_before)
        before, self._overloaded = self._overloaded, share > LATE_SHARE
        if before or not self._overloaded:
            return ""
        # Judge as if flying as fast as possible: that limit makes the ticks late.
        cause = judge(earlier, sample, dataclasses.replace(self._meter.setup, asked=None))
        text = f"{share:.0%} of the ticks were late in the last {wall - begun:.0f} s: {cause.limit}"
        advice = " or ".join(filter(None, (cause.advice, "--clock lockstep, which loses none")))
        return f"{text}; {advice} would help"
