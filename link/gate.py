"""The gate between the launcher and its processes: messages over one pipe per process.

A process reports `Ready`; the launcher answers `Go`. The same gate holds a swarm at a tick, sets its pace, reports that
a UAV is gone, and releases all processes at the end. A process whose launcher dies sees its pipe close, and ends.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from typing import Any

__all__ = [
    "Ended",
    "EventReport",
    "Gate",
    "Go",
    "Gone",
    "Held",
    "LauncherGoneError",
    "LawFailed",
    "Limit",
    "Lost",
    "NetworkReport",
    "Pace",
    "Ready",
    "Release",
    "Stop",
]


class LauncherGoneError(Exception):
    """The pipe from the launcher has closed: this process must end."""


@dataclass(frozen=True)
class Ready:
    """Process -> launcher: sockets open, neighbours subscribed, code compiled."""


@dataclass(frozen=True)
class Ended:
    """Process -> launcher: all ticks are flown, or the flight was stopped; the recording is written."""

    tick: int
    """The next tick, which was not flown."""
    late: int = 0
    """Ticks at which a vehicle had no command that answered its last state, summed over its UAVs."""
    ticks: int = 0
    """Ticks flown, summed over its UAVs."""


@dataclass(frozen=True)
class Lost:
    """Vehicle -> launcher: the aircraft of a UAV is lost."""

    uav: int
    at_us: int
    """Simulated time, us."""
    reason: str


@dataclass(frozen=True)
class EventReport:
    """Process -> launcher: an event, for the log and the dashboard."""

    severity: str
    """"info", "warning" or "error"."""
    text: str
    uav: int | None = None
    at_us: int | None = None
    """Simulated time, us."""
    who: str = ""
    """The sender of the request that caused it, as "system/component"; empty without one."""
    outcome: str = ""
    """The answer to that request, such as "accepted" or "denied"."""


@dataclass(frozen=True)
class NetworkReport:
    """Autopilot -> launcher: how the network between two computers has served one link of the mesh since the last one.

    What the emulated radio does to the same records is recorded elsewhere, see ``link.channel.LinkReport``.
    """

    receiver: int
    """First UAV of the receiving process."""
    sender: int
    """First UAV of the sending process."""
    at_us: int
    """Simulated time, us."""
    received: int
    """Transmissions that came."""
    missing: int
    """Transmissions that never came: a later one did."""
    delay: float
    """Mean time from sending to receiving by the clocks of the two computers, s; 0 where nothing came."""
    longest_delay: float
    """s."""
    silence: float
    """Longest wall time between two transmissions, s."""


@dataclass(frozen=True)
class LawFailed:
    """Autopilot -> launcher: the control law raised an error; the flight cannot go on."""

    text: str
    """File, line, error, UAV and time."""
    at_us: int
    """Simulated time, us."""


@dataclass(frozen=True)
class Pace:
    """Launcher -> vehicle: tick ``tick`` is due at ``wall`` (monotonic clock, s), later ticks at ``speed``."""

    wall: float
    tick: int | None
    """None: the next one, whichever that is."""
    speed: float
    """Simulated seconds per second."""


@dataclass(frozen=True)
class Limit:
    """Launcher -> vehicle: do not pass this tick; None = no limit."""

    tick: int | None


@dataclass(frozen=True)
class Held:
    """Vehicle -> launcher: it waits before this tick, which is beyond the limit."""

    tick: int


@dataclass(frozen=True)
class Go:
    """Launcher -> process: the flight begins."""

    pace: Pace
    limit: Limit


@dataclass(frozen=True)
class Gone:
    """Launcher -> autopilot: the process of a neighbour has died; nothing more will come from it."""

    uav: int


@dataclass(frozen=True)
class Stop:
    """Launcher -> process: end the flight now, and write the recording."""


@dataclass(frozen=True)
class Release:
    """Launcher -> process: all have ended; close what others may still have needed."""


@dataclass
class Gate:
    """A process's end of the pipe."""

    pipe: Connection
    pace: Pace | None = None
    limit: int | None = 0
    gone: set[int] = field(default_factory=set)
    stopping: bool = False
    released: bool = False
    _new_pace: Pace | None = None
    _held: int | None = None
    """The tick at which this process last reported that it is held."""

    def fileno(self) -> int:
        """For ``select``."""
        return self.pipe.fileno()

    def report(self, message: Any) -> None:
        """Send a message to the launcher.

        Raises
        ------
        LauncherGoneError
            If it has gone.
        """
        try:
            self.pipe.send(message)
        except (BrokenPipeError, ConnectionResetError) as error:
            raise LauncherGoneError from error

    def read(self) -> None:
        """Take in the launcher's messages.

        Raises
        ------
        LauncherGoneError
            If it has gone.
        """
        try:
            while self.pipe.poll():
                self._take(self.pipe.recv())
        except (EOFError, ConnectionResetError, BrokenPipeError) as error:
            raise LauncherGoneError from error

    def _take(self, message: Any) -> None:
        match message:
            case Go(pace, limit):
                self.pace, self.limit = pace, limit.tick
                self._new_pace = pace
            case Pace():
                self.pace = self._new_pace = message
            case Limit(tick):
                self.limit, self._held = tick, None
            case Gone(uav):
                self.gone.add(uav)
            case Stop():
                self.stopping = True
            case Release():
                self.released = True

    def take_pace(self) -> Pace | None:
        """The pace, if it has changed since the last call."""
        pace, self._new_pace = self._new_pace, None
        return pace

    def open(self, tick: int) -> bool:
        """Whether the swarm may pass this tick."""
        return self.limit is None or tick <= self.limit

    def is_held(self, tick: int) -> bool:
        """Whether this process has reported that it is held before a tick."""
        return self._held == tick

    def hold(self, tick: int) -> None:
        """Report, once, that the limit holds this process before a tick."""
        if not self.is_held(tick):
            self._held = tick
            self.report(Held(tick))

    def wait_until_go(self) -> None:
        """Block until the flight begins or is called off."""
        while self.pace is None and not self.stopping:
            self.pipe.poll(None)
            self.read()

    def wait_until_released(self, seconds: float) -> None:
        """Block until all processes have ended, at most for ``seconds`` (wall s)."""
        until = time.monotonic() + seconds
        while not self.released and time.monotonic() < until:
            self.pipe.poll(max(0.0, until - time.monotonic()))
            self.read()
