"""Watches over the pace of a flight: measures it once a second and says, once, where it falls short and why."""

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
"""Measurements in a row that fall short before that is said: a start, or a moment, is no reason."""
LATE_SHARE = 0.05
"""Share of late ticks from which on the wall clock is overloaded."""
_LATE_WINDOW = 2.0
"""Wall time for which it must have been, s."""


class Pacing:
    """The pace of one flight.

    Parameters
    ----------
    setup : how the swarm is flown.
    lockstep : whether a slow computer slows the flight down; otherwise ticks are late.
    """

    def __init__(self, setup: Setup, lockstep: bool) -> None:
        self.pace = Pace(math.nan, setup.asked)
        """As it was measured last; its factor is nan until half a second was seen."""
        self._meter = PaceMeter(setup)
        self._lockstep = lockstep
        self._measured = -math.inf
        self._misses = 0
        """Measurements in a row that fell short."""
        self._ticks: collections.deque[tuple[float, int, int, Sample]] = collections.deque()
        """Wall time, late ticks, all ticks and who used how much, of the last seconds."""
        self._overloaded = False

    def set_speed(self, speed: float) -> None:
        """Another speed is asked for; inf: as fast as possible."""
        asked = None if math.isinf(speed) else speed
        self._meter.setup = dataclasses.replace(self._meter.setup, asked=asked)
        self.restart()

    def restart(self) -> None:
        """Begin anew: after a start, a pause, a step or a change of speed."""
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
        """Measure, if a second has passed; what is to be said, else empty.

        Parameters
        ----------
        wall, t : the present instant, monotonic and simulated, s.
        ticks : late ticks of all vehicles so far, and all ticks.
        processes : name, pid and kind of those that fly.
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
        """Lockstep: the speed asked for is not reached."""
        self._misses = self._misses + 1 if self.pace.asked is not None and self.pace.limit else 0
        if self._misses != _MISSES_BEFORE_WARNING:
            return ""
        text = f"{self.pace.factor:.2g} times real time instead of {self.pace.asked:g}: {self.pace.limit}"
        return f"{text}; {self.pace.advice} would help" if self.pace.advice else text

    def _check_wall_clock(self, wall: float, late: int, ticks: int, sample: Sample) -> str:
        """The wall clock: too many ticks are late."""
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
        # As fast as possible: whatever limits it makes the ticks late.
        cause = judge(earlier, sample, dataclasses.replace(self._meter.setup, asked=None))
        text = f"{share:.0%} of the ticks were late in the last {wall - begun:.0f} s: {cause.limit}"
        advice = " or ".join(filter(None, (cause.advice, "--clock lockstep, which loses none")))
        return f"{text}; {advice} would help"
