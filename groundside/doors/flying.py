"""Fly aircraft of a scenario behind doors, and leave a run with their true flight."""

from __future__ import annotations

import contextlib
import signal
import threading
import time
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import tomli_w

from ftcc.airside.process import columns as autopilot_columns
from ftcc.groundside.doors.preparing import DoorError
from ftcc.groundside.doors.programs import Programs, Px4Build, instance_of
from ftcc.link.home import Home
from ftcc.link.ports import PortError
from ftcc.link.recording import AIRCRAFT_LOST, EventLog, PartWriter, part_path
from ftcc.sim.doors import ardupilot, channels, px4
from ftcc.sim.doors.flight import Door, DoorFlight
from ftcc.sim.doors.sensors import Sizes
from ftcc.sim.doors.vehicle import DoorVehicle

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission

__all__ = ["DoorOutcome", "fly_behind_doors"]

Kind = Literal["px4", "ardupilot"]


@dataclass
class DoorOutcome:
    """Result of a flight behind doors."""

    lost: dict[int, str] = field(default_factory=dict)
    """UAVs that were lost, with the reason."""
    flown: float = 0.0
    """Time of the scenario that was flown, s."""
    stopped: bool = False
    """Whether it was ended early on request."""


def fly_behind_doors(
    mission: Mission,
    folder: Path,
    uavs: Sequence[int],
    kind: Kind,
    *,
    ports: Mapping[int, int] | None = None,
    build: Px4Build | None = None,
    speed: float = 1.0,
    sizes: Sizes | None = None,
    report: Callable[[str], None] = print,
) -> DoorOutcome:
    """Fly ``uavs`` of a mission by another autopilot until its duration has passed since the launch.

    Parameters
    ----------
    folder : of the run, which exists.
    ports : by UAV, where its autopilot is awaited; default: the port of the PX4 instance whose MAV_SYS_ID is the UAV.
    build : a PX4 to start for each UAV; None: users start their autopilots themselves.
    speed : largest number of simulated seconds per second; inf: as fast as the autopilots answer.
    sizes : of the sensors' errors.
    report : called with lines for the user.

    Ctrl-C and SIGTERM end the flight in an orderly way. Programs that were started here have ended afterwards.

    Raises
    ------
    DoorError
        If a port is in use, or PX4 cannot be started.
    """
    _begin_run(mission, folder, uavs)
    if ports is None:
        ports = {uav: px4.PORT + instance_of(uav) for uav in uavs}
    log = EventLog(folder / "events.jsonl")
    doors: list[Door] = []
    programs = Programs(build) if build is not None else None
    stop = threading.Event()

    def tell(text: str, uav: int | None = None) -> None:
        report(text if uav is None else f"UAV {uav}: {text}")
        flown = max((door.vehicle.flown_us for door in doors), default=0) / 1e6
        if text.startswith("lost: "):
            log.write(flown, AIRCRAFT_LOST + text.removeprefix("lost: "), uav, "error")
        else:
            log.write(flown, text, uav)

    def stopping() -> bool:
        for uav, how in (programs.ended() if programs is not None else {}).items():
            next(door for door in doors if door.vehicle.uav == uav).gone = how
        return stop.is_set()

    outcome = DoorOutcome()
    try:
        with _on_signals(stop.set):
            try:
                for uav in uavs:
                    doors.append(_door(mission, uav, kind, ports[uav], folder, sizes or Sizes(), tell))
                if programs is not None:
                    programs.start(uavs, folder / "px4")
                flight = DoorFlight(doors, speed, mission.timing.ticks * mission.timing.period_us, tell, stopping)
                flight.fly()
                outcome = DoorOutcome(flight.lost, flight.flown, stop.is_set())
            finally:
                if programs is not None:
                    programs.end()
                for door in doors:
                    door.close()
                    door.vehicle.close()
    finally:
        log.close()
    return outcome


def _begin_run(mission: Mission, folder: Path, uavs: Sequence[int]) -> None:
    """Write the scenario, without its claims: they are about our law, which does not fly.

    Parts without rows make the columns of its signals, so that reports find them, empty.
    """
    document = {key: value for key, value in tomllib.loads(mission.toml).items() if key != "claims"}
    flown = replace(mission, toml=tomli_w.dumps(document))
    (folder / "scenario.toml").write_text(flown.toml_of_run(time.time()), encoding="utf-8")
    for uav in uavs:
        PartWriter(part_path(folder, uav, "autopilot"), autopilot_columns(mission.signals)).close()


def _door(
    mission: Mission, uav: int, kind: Kind, port: int, folder: Path, sizes: Sizes, tell: Callable[..., None]
) -> Door:
    spec = next(spec for spec in mission.vehicles if spec.uav == uav)

    def about(text: str) -> None:
        tell(text, uav)

    vehicle = DoorVehicle(spec, mission.timing, Home(*mission.home), sizes, folder, about)
    try:
        if kind == "px4":
            return px4.Px4Door(vehicle, port, channels.PX4, about)
        return ardupilot.ArduPilotDoor(vehicle, port, channels.ARDUPILOT, about)
    except (PortError, OverflowError) as error:
        vehicle.close()
        raise DoorError(f"UAV {uav}: {error}") from None


@contextlib.contextmanager
def _on_signals(stop: Callable[[], None]) -> Iterator[None]:
    """Call ``stop`` on Ctrl-C and SIGTERM; do nothing outside of the main thread, which alone handles signals."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def handle(_number: int, _frame: Any) -> None:
        stop()

    before = {number: signal.signal(number, handle) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
