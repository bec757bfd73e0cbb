"""Control the simulated time of a running swarm: hold, step, resume, change the speed."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from typing import Any, Literal

from ftcc.link.gate import Limit, Pace

__all__ = ["START", "Flow", "FlowError"]

START = 0.05
"""Wall time between sending a pace and its first tick, where all processes run on this computer, s."""


class FlowError(ValueError):
    """A request that is not possible in the current state."""


class Flow:
    """Holds all vehicle processes before the same tick, and resumes them together.

    Parameters
    ----------
    period : control period, s.
    speed : largest number of simulated seconds per second; inf (only in ``lockstep``): as fast as possible.
    held : start held before tick 0.
    send : sends a message to all processes.
    flying : returns the names of the vehicle processes that still fly.
    start : wall time between sending a pace and its first tick, s: it must have arrived everywhere.
    """

    def __init__(
        self,
        period: float,
        speed: float,
        lockstep: bool,
        held: bool,
        send: Callable[[Any], None],
        flying: Callable[[], Iterable[str]],
        start: float = START,
    ) -> None:
        self.period = period
        self.speed = speed
        self.lockstep = lockstep
        self._send = send
        self._flying = flying
        self._start = start
        self._ticks: dict[str, int] = {}
        """Tick before which each process is held."""
        self._pace = Pace(0.0, 0, speed)
        self.state: Literal["flying", "holding", "held"] = "held" if held else "flying"
        self.tick = 0
        """Tick before which the swarm is held."""

    def begin(self) -> tuple[Pace, Limit]:
        """Start the clock and return pace and limit of the first ticks."""
        self._pace = Pace(time.monotonic() + self._start, 0, self.speed)
        return self._pace, Limit(-1 if self.state == "held" else None)

    def pause(self) -> None:
        """Hold all processes where they are; once all have answered, bring them to the same tick."""
        if self.state == "flying":
            self.state = "holding"
            self._ticks.clear()
            self._send(Limit(-1))

    def mark_held(self, name: str, tick: int) -> None:
        """Record that a process is held before a tick."""
        self._ticks[name] = tick
        flying = set(self._flying())
        if self.state != "holding" or not flying <= set(self._ticks):
            return
        ticks = {self._ticks[one] for one in flying}
        self.tick = max(ticks)
        if len(ticks) == 1:
            self.state = "held"
        else:
            self._continue_from(min(ticks), Limit(self.tick - 1))

    def step(self, ticks: int) -> None:
        """Fly a number of ticks and hold again.

        Raises
        ------
        FlowError
            If the swarm is not held.
        """
        self._require_held("step")
        self.state = "holding"
        self._continue_from(self.tick, Limit(self.tick + ticks - 1))

    def resume(self) -> None:
        """Resume a held swarm.

        Raises
        ------
        FlowError
            If the swarm is not held.
        """
        self._require_held("resume")
        self.state = "flying"
        self._continue_from(self.tick, Limit(None))

    def set_speed(self, speed: float) -> None:
        """Change the speed, at once or, if the swarm is held, when it resumes.

        Raises
        ------
        FlowError
            If the speed is infinite and the swarm is not in lockstep.
        """
        if math.isinf(speed) and not self.lockstep:
            raise FlowError(
                "a swarm on the wall clock needs a speed; only a swarm in lockstep can fly as fast as possible"
            )
        self.speed = speed
        if self.state != "flying":
            return
        if self.lockstep:
            # The current tick is not known here: each process continues from its own, and waits for the others.
            self._pace = Pace(time.monotonic() + self._start, None, speed)
        else:
            # All processes change at the same tick, which is due soon.
            begun = self._pace.tick or 0
            ahead = (time.monotonic() + self._start - self._pace.wall) * self._pace.speed / self.period
            tick = begun + max(0, int(ahead))
            due = self._pace.wall + (tick - begun) * self.period / self._pace.speed
            self._pace = Pace(due, tick, speed)
        self._send(self._pace)

    def _require_held(self, what: str) -> None:
        if self.state != "held":
            raise FlowError(f"the swarm is {self.state}: pause it before you {what} it")

    def _continue_from(self, tick: int, limit: Limit) -> None:
        self._ticks.clear()
        self._pace = Pace(time.monotonic() + self._start, tick, self.speed)
        self._send(self._pace)
        self._send(limit)
