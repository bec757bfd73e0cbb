"""Control the simulated time of a running swarm from outside: pause, step, resume, change the speed, stop."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

from ftcc.groundside.swarm.conversation import RefusedError, StationError
from ftcc.groundside.swarm.registry import Entry, ask_swarm

__all__ = ["MAX_SPEED", "Control", "SwarmError", "speed_factor"]

MAX_SPEED = 1000.0
"""Speeds are below this number of simulated seconds per second, or infinite."""
_LOOK = 0.005
"""Wall time between two questions whether a swarm is held, s; it grows up to the next."""
_SELDOM = 0.05


class SwarmError(StationError):
    """A swarm that cannot fly as asked, or does not fly any more."""


def speed_factor(given: str | float, name: str) -> float:
    """Return a speed as simulated seconds per second; inf for "max".

    Raises
    ------
    SwarmError
        If it is no positive factor below `MAX_SPEED`; the text calls it ``name``.
    """
    try:
        factor = math.inf if given == "max" else float(given)
    except ValueError:
        factor = math.nan
    if not (given == "max" or 0.0 < factor < MAX_SPEED):
        raise SwarmError(f"{name} {given}: must be a positive factor below {MAX_SPEED:g}, or 'max'")
    return factor


class Control:
    """The flow of time of one running swarm.

    Every method raises `RefusedError` if the swarm refuses, and OSError if it does not answer.
    """

    def __init__(self, entry: Entry) -> None:
        self.entry = entry

    def _ask(self, command: str, **arguments: Any) -> Any:
        try:
            return ask_swarm(self.entry, command, **arguments)
        except RuntimeError as error:
            raise RefusedError(str(error)) from None

    def status(self) -> dict[str, Any]:
        """Return ``state`` ("flying", "holding", "held"), time ``t`` (s), pace, and the processes that ``died``."""
        return dict(self._ask("status"))

    def pause(self) -> None:
        """Ask the swarm to hold, all vehicles before the same tick; see `wait_until_held`."""
        self._ask("pause")

    def step(self, ticks: int) -> None:
        """Ask a held swarm to fly some ticks and hold again; see `wait_until_held`."""
        self._ask("step", ticks=ticks)

    def resume(self) -> None:
        """Let a held swarm fly on."""
        self._ask("resume")

    def speed(self, factor: float) -> None:
        """Set the largest number of simulated seconds per second; inf: as fast as possible."""
        self._ask("speed", factor=None if math.isinf(factor) else factor)

    def stop(self) -> None:
        """End the flight; its results up to now are kept."""
        self._ask("stop")

    def wait_until_held(self, timeout: float = math.inf, look: Callable[[dict[str, Any]], None] | None = None) -> float:
        """Wait until the swarm is held, and return its simulated time, s.

        Parameters
        ----------
        timeout : float
            Wall time, s.
        look : callable, optional
            Called with every status.

        Raises
        ------
        SwarmError
            If it is not held within ``timeout``.
        """
        until, pause = time.monotonic() + timeout, _LOOK
        while time.monotonic() < until:
            status = self.status()
            if look is not None:
                look(status)
            if status["state"] == "held":
                return float(status["t"])
            time.sleep(pause)
            pause = min(1.5 * pause, _SELDOM)
        raise SwarmError(f"the swarm was not paused within {timeout:g} s")
