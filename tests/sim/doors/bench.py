"""Aircraft of a scenario behind doors, and the players that fly them, for tests."""

from __future__ import annotations

import functools
import math
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ftcc.groundside.scenario import Mission, load, resolve
from ftcc.link.home import Home
from ftcc.sim.doors.ardupilot import ArduPilotDoor
from ftcc.sim.doors.channels import ARDUPILOT, PX4
from ftcc.sim.doors.flight import Door, DoorFlight
from ftcc.sim.doors.px4 import Px4Door
from ftcc.sim.doors.sensors import Sizes
from ftcc.sim.doors.vehicle import DoorVehicle
from tests.support.ports import free_port

ROOT = Path(__file__).parents[3]
EXACT = Sizes(*(0.0,) * 14)
"""Sensors without errors."""


@functools.cache
def mission(*settings: str) -> Mission:
    """Chapter 7's aircraft without faults, and what ``settings`` change."""
    return resolve(load("attitude_synchronization", variants="healthy", settings=list(settings)))


def a_vehicle(*settings: str, uav: int = 1, sizes: Sizes = EXACT) -> DoorVehicle:
    """One of them, not recorded."""
    flown = mission(*settings)
    spec = next(spec for spec in flown.vehicles if spec.uav == uav)
    return DoorVehicle(spec, flown.timing, Home(*flown.home), sizes, None, pytest_fails)


def pytest_fails(text: str) -> None:
    raise AssertionError(text)


@contextmanager
def player(module: str, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """A player in its own process. One of PX4 must end without an error once its door is closed."""
    process = subprocess.Popen([sys.executable, "-m", f"tests.support.{module}", *arguments], cwd=ROOT)
    try:
        yield process
        if module == "px4_player":
            assert process.wait(20.0) == 0
        assert process.poll() in (None, 0)
    finally:
        process.kill()
        process.wait()


@dataclass
class Flown:
    """A flight and what was seen of it."""

    flight: DoorFlight
    said: list[tuple[str, int | None]]
    truth: dict[int, np.ndarray] = field(default_factory=dict)
    """By UAV, (n, 13): the true states from the launcher's end on."""
    acting: dict[int, np.ndarray] = field(default_factory=dict)
    """Likewise, (n, 4): what acts on the airframe."""
    command: dict[int, np.ndarray] = field(default_factory=dict)


def fly(doors: Sequence[Door], seconds: float, said: list[tuple[str, int | None]] | None = None) -> Flown:
    """Fly to the end, as fast as the players answer, and close the doors."""
    said = [] if said is None else said
    rows: dict[int, list[tuple[np.ndarray, ...]]] = {door.vehicle.uav: [] for door in doors}
    for door in doors:
        _watch(door.vehicle, rows[door.vehicle.uav])
    flight = DoorFlight(
        doors, math.inf, round(seconds * 1e6), lambda text, uav: said.append((text, uav)), lambda: False
    )
    flight.fly()
    for door in doors:
        door.close()
        door.vehicle.close()
    flown = Flown(flight, said)
    for uav, own in rows.items():
        if own:
            flown.truth[uav], flown.acting[uav], flown.command[uav] = map(np.array, zip(*own))
    return flown


def _watch(vehicle: DoorVehicle, rows: list[tuple[np.ndarray, ...]]) -> None:
    advance = vehicle.advance

    def and_note(controls: np.ndarray) -> None:
        advance(controls)
        if vehicle.flying:
            fleet = vehicle.fleet
            rows.append((vehicle.true.copy(), fleet.acting[0].copy(), fleet.command[0].copy()))

    vehicle.advance = and_note  # type: ignore[method-assign]


def by_px4(seconds: float, *settings: str, sizes: Sizes | None = None, arguments: Sequence[str] = ()) -> Flown:
    """Fly UAV 1 by a player of PX4."""
    said: list[tuple[str, int | None]] = []
    door = Px4Door(a_vehicle(*settings, sizes=sizes or Sizes()), free_port(), PX4, lambda text: said.append((text, 1)))
    with player("px4_player", "--port", str(door.port), *arguments):
        return fly([door], seconds, said)


def by_ardupilot(seconds: float, *arguments: str) -> tuple[Flown, ArduPilotDoor]:
    """Fly UAV 1 by a player of ArduPilot."""
    door = ArduPilotDoor(a_vehicle(), free_port(), ARDUPILOT, pytest_fails)
    with player("ardupilot_player", "--port", str(door.port), *arguments):
        return fly([door], seconds), door
