"""Fly a swarm of processes with its station, recording and dashboard, and leave a complete run."""

from __future__ import annotations

import contextlib
import math
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import wait
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ftcc.groundside.dashboard import Event, Feed, Pace
from ftcc.groundside.swarm.in_progress import FlightInProgress, Progress
from ftcc.groundside.swarm.launcher import Elsewhere, Outcome, SwarmProcesses, automatic_pack
from ftcc.groundside.swarm.monitor import Monitor
from ftcc.groundside.swarm.open_files import provide_files
from ftcc.groundside.swarm.pace import Setup, usable_cores
from ftcc.groundside.swarm.pacing import Pacing
from ftcc.groundside.swarm.registry import ControlSocket, Entry, VehicleEntry
from ftcc.link.addresses import Address
from ftcc.link.gcs_sockets import LISTENERS
from ftcc.link.ports import PortBlock
from ftcc.link.recording import EventLog

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission

__all__ = ["Clock", "FlightOptions", "Viewer", "fly_swarm"]

Clock = Literal["lockstep", "wall"]
"""What a tick waits for: all processes and then the wall clock, or the wall clock alone."""
Viewer = Literal["web", "native", "none"]
"""Kind of viewer."""

_POLL_PERIOD = 0.02
"""Longest time between two readings of the telemetry, wall s."""
_START_TIMEOUT = 300.0
"""Time for all processes to get ready, wall s; the first start compiles."""
_END_TIMEOUT = 5.0
"""Time for all processes to end by themselves, wall s."""


@dataclass(frozen=True)
class FlightOptions:
    """How to fly a mission: clock, processes, viewer, links to the ground."""

    folder: Path
    lockstep: bool = True
    """Whether processes wait for each other; otherwise each follows the wall clock."""
    speed: float = 1.0
    """Largest number of simulated seconds per second; inf: as fast as possible."""
    pack: int = 1
    """Vehicles per process."""
    held: bool = False
    """Hold the swarm before the first tick."""
    viewer: Viewer = "none"
    open_browser: bool = False
    record_view: bool = True
    """Write ``swarm.rrd``."""
    listeners: tuple[Address, ...] = LISTENERS
    """Addresses to which telemetry for other ground stations is sent."""
    key: Path | None = None
    """Key file for signed MAVLink messages to the ground."""
    id_offset: int = 0
    """MAVLink system id of a UAV minus its id."""
    tls: Path | None = None
    """Folder of keys, with which the mesh is encrypted and speaks only to those who belong to it."""


def fly_swarm(
    mission: Mission,
    options: FlightOptions,
    ports: PortBlock,
    report: Callable[[Event], None],
    progress: Progress,
    started: Callable[[str | None], None],
    elsewhere: Elsewhere | None = None,
) -> Outcome:
    """Fly ``mission`` and leave a complete run in ``options.folder``.

    Parameters
    ----------
    report : called with every event.
    progress : called with the simulated time, the pace and the late ticks, up to ten times per second.
    started : called once when all processes are ready, with the viewer's address or None.
    elsewhere : the processes on other computers, which have joined.

    Ctrl-C and SIGTERM end the flight in an orderly way.

    Raises
    ------
    TooFewFilesError
        If the system does not allow enough open files; nothing has been started.
    TimeoutError
        If a process does not get ready.
    """
    provide_files(mission, options.pack, len(options.listeners))
    folder = options.folder
    folder.mkdir(parents=True, exist_ok=True)
    run_started = time.time()
    (folder / "scenario.toml").write_text(mission.toml_of_run(run_started), encoding="utf-8")
    flight: FlightInProgress

    def on_event(event: Event) -> None:
        flight.log_event(event)

    # The fork server must exist before this process opens anything.
    swarm = _start_swarm(mission, options, ports, run_started, on_event, elsewhere)
    station = _station(mission, options, ports, run_started)
    flight = FlightInProgress(
        mission, swarm, station, None, None, EventLog(folder / "events.jsonl"), report, _pacing(mission, options)
    )
    control = None
    wall_flown = 0.0
    """Duration of the flight, wall s."""
    with _stop_on_signals(swarm):
        try:
            flight.dashboard = _dashboard(mission, options, ports)
            address = flight.dashboard.address if flight.dashboard else None
            control = ControlSocket(_entry(mission, options, ports, address), flight.handle_command)
            flight.feed = Feed(folder.name)
            _wait_until_ready(flight, control)
            started(address)
            wall_flown = _fly(flight, control, progress)
        finally:
            _end_processes(flight)
            flight.judge_flight()
            if control:
                control.close()
            flight.close()
            ports.release()
    flight.log_end(wall_flown)
    return swarm.outcome


def _start_swarm(
    mission: Mission,
    options: FlightOptions,
    ports: PortBlock,
    run_started: float,
    on_event: Callable[[Event], None],
    elsewhere: Elsewhere | None,
) -> SwarmProcesses:
    """Start all processes of the swarm."""
    swarm = SwarmProcesses(
        mission,
        options.folder,
        ports,
        lockstep=options.lockstep,
        speed=options.speed,
        pack=options.pack,
        held=options.held,
        listeners=options.listeners,
        key=options.key,
        id_offset=options.id_offset,
        started=run_started,
        elsewhere=elsewhere,
        tls=options.tls,
        on_event=on_event,
    )
    swarm.start()
    return swarm


def _fly(flight: FlightInProgress, control: ControlSocket, progress: Progress) -> float:
    """Fly until every process has ended, and return the duration in wall s."""
    flight.swarm.go()
    begun = time.monotonic()
    while not flight.swarm.over:
        _poll(flight, control, progress)
    wall_flown = time.monotonic() - begun
    flight.station.read()
    flight.refreshed = 0.0
    flight.refresh(progress)
    return wall_flown


def _end_processes(flight: FlightInProgress) -> None:
    """Stop the processes that still fly, and wait until all have ended."""
    flight.swarm.stop()
    until = time.monotonic() + _END_TIMEOUT
    while not flight.swarm.over and time.monotonic() <= until:
        _poll(flight, None, _ignore_progress)
    flight.swarm.collect(lambda: _poll(flight, None, _ignore_progress))
    flight.swarm.release()


def _station(mission: Mission, options: FlightOptions, ports: PortBlock, run_started: float) -> Monitor:
    """Return the monitor that receives all telemetry and logs it."""
    signals = [signal_.name for signal_ in mission.signals]
    uavs = [spec.uav for spec in mission.vehicles]
    sources = [port for uav in uavs for port in (ports.of(uav).telemetry, ports.of(uav).truth)]
    tlog = options.folder / "telemetry.tlog"
    return Monitor(ports.station, sources, uavs, mission.plant, signals, tlog, options.id_offset, run_started)


def _pacing(mission: Mission, options: FlightOptions) -> Pacing:
    uavs = len(mission.vehicles)
    asked = None if math.isinf(options.speed) else options.speed
    return Pacing(Setup(asked, uavs, options.pack, automatic_pack(uavs), usable_cores()), options.lockstep)


def _wait_until_ready(flight: FlightInProgress, control: ControlSocket) -> None:
    """Wait until all processes are ready, or the swarm is stopped."""
    swarm = flight.swarm
    until = time.monotonic() + _START_TIMEOUT
    while not swarm.ready and swarm.stopping_since is None:
        if time.monotonic() > until:
            names = ", ".join(child.name for child in swarm.children if not child.ready)
            raise TimeoutError(f"not ready after {_START_TIMEOUT:.0f} s: {names}; see the logs in {swarm.folder}")
        _poll(flight, control, _ignore_progress)


def _poll(flight: FlightInProgress, control: ControlSocket | None, progress: Progress) -> None:
    """Wait briefly, then handle messages of processes, telemetry and commands, and update the dashboard."""
    # Telemetry arrives all the time: it does not end the wait.
    wait([flight.swarm.fileno(), *([control.fileno()] if control else [])], _POLL_PERIOD)
    flight.swarm.poll()
    flight.station.read()
    if control:
        control.serve()
    flight.refresh(progress)


def _ignore_progress(_t: float, _pace: Pace, _late: int) -> None:
    """Do nothing."""


def _entry(mission: Mission, options: FlightOptions, ports: PortBlock, address: str | None) -> Entry:
    folder = options.folder
    return Entry(
        name=folder.name,
        pid=os.getpid(),
        scenario=mission.name,
        folder=str(folder.resolve()),
        vehicles=tuple(
            VehicleEntry(
                spec.uav,
                spec.uav + options.id_offset,
                spec.role,
                ports.of(spec.uav).ground,
                tuple(n.uav for n in spec.neighbours),
            )
            for spec in mission.autopilots
        ),
        key=None if options.key is None else str(options.key.resolve()),
        ports=(ports.base, ports.base + ports.size - 1),
        viewer=address,
        started=time.time(),
    )


def _dashboard(mission: Mission, options: FlightOptions, ports: PortBlock) -> Any:
    """Return the dashboard, or None if nothing is to be shown or recorded."""
    recording = options.folder / "swarm.rrd" if options.record_view else None
    if options.viewer == "none" and recording is None:
        return None
    from ftcc.groundside.dashboard import Dashboard, Subject

    return Dashboard(
        Subject.of(mission),
        recording=recording,
        viewer=options.viewer,
        ports=ports.viewer,
        open_browser=options.open_browser,
    )


@contextlib.contextmanager
def _stop_on_signals(swarm: SwarmProcesses) -> Iterator[None]:
    """Stop the swarm on Ctrl-C and SIGTERM; do nothing outside of the main thread, which alone handles signals."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(_number: int, _frame: Any) -> None:
        swarm.stop()

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
