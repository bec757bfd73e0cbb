"""The flight of aircraft behind their doors: one clock steps them all, and a step waits for every autopilot."""

from __future__ import annotations

import math
import select
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ftcc.link.actuators import THRUST
from ftcc.sim.doors.vehicle import LAUNCH_US, DoorVehicle

__all__ = ["LAUNCH_THROTTLE", "Companion", "Door", "DoorFlight"]

LAUNCH_THROTTLE = 0.5
"""The launch begins above this throttle, 0..1."""
_LOOK = 0.05
"""Longest wait without a look at whether the flight is to end, wall s."""
_PATIENCE, _REPEAT = 2.0, 10.0
"""Wait after which it is reported who is waited for, and again, wall s."""
_BEHIND = 0.1
"""Lag behind the pace that is caught up, wall s."""
_ANSWER = 0.02
"""Longest wait of a step for the answers of companions, wall s."""

Report = Callable[[str, "int | None"], None]
"""Called with a text and the UAV that it is about."""


class Door(Protocol):
    """What a door is to the flight."""

    vehicle: DoorVehicle
    port: int
    autopilot: str
    controls: NDArray[np.float64]
    armed: bool
    gone: str

    @property
    def connected(self) -> bool: ...
    @property
    def running_free(self) -> bool: ...
    @property
    def answered(self) -> bool: ...
    def fileno(self) -> int: ...
    def read(self) -> None: ...
    def send(self) -> None: ...
    def close(self) -> None: ...


class Companion(Protocol):
    """What commands an autopilot over another link, beside its door."""

    @property
    def sockets(self) -> tuple[Any, ...]: ...
    @property
    def waiting(self) -> bool: ...
    def serve(self) -> None: ...
    def close(self) -> None: ...


class DoorFlight:
    """Aircraft behind doors.

    Parameters
    ----------
    doors : of vehicles with one period.
    speed : simulated seconds per second; inf: as fast as autopilots answer. Until they do, 1 at most.
    duration_us : of the scenario, us, from the end of the launch on.
    report : called with what the user should know.
    stopping : asked often; true ends the flight.
    companions : by UAV; served after each step and when something has come, closed when the UAV is lost.
    """

    def __init__(
        self,
        doors: Sequence[Door],
        speed: float,
        duration_us: int,
        report: Report,
        stopping: Callable[[], bool],
        companions: Mapping[int, Companion] | None = None,
    ) -> None:
        self.doors, self.speed, self.duration_us = list(doors), speed, duration_us
        self._report, self._stopping = report, stopping
        self._companions = dict(companions or {})
        self.lost: dict[int, str] = {}
        """UAVs that were lost, with the reason."""
        self._ready: set[int] = set()
        self._due = 0.0
        """When the next step is due, wall s."""

    @property
    def alive(self) -> list[Door]:
        """The doors whose vehicles fly or wait."""
        return [door for door in self.doors if door.vehicle.uav not in self.lost]

    @property
    def flown(self) -> float:
        """Time of the scenario, s."""
        return max(door.vehicle.flown_us for door in self.doors) / 1e6

    def fly(self) -> None:
        """Wait for all autopilots, launch, and fly to the end of the scenario, to the last loss, or until stopped."""
        for door in self.doors:
            self._report(f"waits for {door.autopilot} at port {door.port}", door.vehicle.uav)
        if not self._wait(lambda door: door.connected, "to connect"):
            return
        self._due = time.monotonic()
        while self.alive and not self._stopping():
            for door in self.alive:
                door.send()
            self._lose_the_gone()
            if not self._wait(lambda door: door.answered, "to answer"):
                return
            self._prepare_launch()
            for door in self.alive:
                door.vehicle.advance(door.controls)
                if door.vehicle.lost:
                    self._lose(door, door.vehicle.lost)
            if any(door.vehicle.flown_us >= self.duration_us for door in self.alive):
                return
            self._serve_companions()
            self._pace()

    def _wait(self, done: Callable[[Door], bool], what: str) -> bool:
        """Read until that is true of all living doors; false if the flight ended instead. Reports long waits."""
        remind = time.monotonic() + _PATIENCE
        while self.alive and not self._stopping():
            missing = [door for door in self.alive if not done(door)]
            if not missing:
                return True
            self._listen(missing, _LOOK)
            self._lose_the_gone()
            if time.monotonic() > remind:
                remind = time.monotonic() + _REPEAT
                for door in missing:
                    if not done(door) and not door.gone:
                        self._report(f"still waits for {door.autopilot} {what}", door.vehicle.uav)
        return False

    def _serve_companions(self) -> None:
        """Let all companions do what is due; time waits for their answers, though not for long."""
        for companion in self._companions.values():
            companion.serve()
        until = time.monotonic() + _ANSWER
        while any(companion.waiting for companion in self._companions.values()):
            left = until - time.monotonic()
            if left <= 0.0 or self._stopping():
                return
            self._listen((), left)

    def _listen(self, doors: Sequence[Door], seconds: float) -> None:
        """Wait for doors and companions, and take in what has come."""
        beside = [one for companion in self._companions.values() for one in companion.sockets]
        readable, _, _ = select.select([*doors, *beside], [], [], seconds)
        for door in doors:
            if door in readable:
                door.read()
        if any(one in readable for one in beside):
            for companion in self._companions.values():
                companion.serve()

    def _lose_the_gone(self) -> None:
        for door in self.alive:
            if door.gone:
                self._lose(door, f"{door.autopilot}: {door.gone}")

    def _lose(self, door: Door, why: str) -> None:
        self.lost[door.vehicle.uav] = why
        door.close()
        companion = self._companions.pop(door.vehicle.uav, None)
        if companion is not None:
            companion.close()
        self._report(f"lost: {why}", door.vehicle.uav)

    def _prepare_launch(self) -> None:
        """Launch all together, once every living autopilot is armed and gives thrust."""
        waiting = [door for door in self.alive if door.vehicle.launched_us is None]
        if not waiting:
            return
        for door in waiting:
            ready = door.armed and door.controls[THRUST] > LAUNCH_THROTTLE
            if ready and door.vehicle.uav not in self._ready:
                self._ready.add(door.vehicle.uav)
                self._report("is armed and gives thrust", door.vehicle.uav)
            elif not ready:
                self._ready.discard(door.vehicle.uav)
        if len(self._ready) >= len(waiting):
            self._report(f"launch: the scenario begins in {LAUNCH_US / 1e6:g} s", None)
            for door in waiting:
                door.vehicle.launch()

    def _pace(self) -> None:
        """Wait until the next step is due; without answers time passes no faster than the clock."""
        free = any(door.running_free for door in self.alive)
        speed = min(self.speed, 1.0) if free else self.speed
        period = self.doors[0].vehicle.period_us / 1e6
        now = time.monotonic()
        self._due = now if math.isinf(speed) else max(self._due + period / speed, now - _BEHIND)
        while free or self._due > now:
            self._listen(self.alive, max(0.0, self._due - now))
            self._lose_the_gone()
            now = time.monotonic()
            if now >= self._due:
                return
