"""A flight with processes: swarm, station, recording and dashboard together, from ready to the merged run."""

from __future__ import annotations

import contextlib
import math
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from multiprocessing.connection import wait
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ftcc.groundside.dashboard import Event, Feed, Pace
from ftcc.groundside.results import Run, RunError
from ftcc.groundside.swarm.launcher import Outcome, Swarm, automatic_pack
from ftcc.groundside.swarm.monitor import Monitor
from ftcc.groundside.swarm.open_files import provide_files
from ftcc.groundside.swarm.pace import Setup, usable_cores
from ftcc.groundside.swarm.pacing import Pacing
from ftcc.groundside.swarm.registry import Card, Control, Entry
from ftcc.groundside.verdict import VERDICT_FILE, judge
from ftcc.link.addresses import Address
from ftcc.link.ground import LISTENERS
from ftcc.link.ports import PortBlock
from ftcc.link.recording import EventLog

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission

__all__ = ["Clock", "FlightOptions", "Viewer", "fly_swarm"]

Progress = Callable[[float, Pace], None]
"""Called with the simulated time (s) that a flight has come to, and its pace."""
Clock = Literal["lockstep", "wall"]
"""What a tick waits for: for everybody, then for the wall clock; or for the wall clock alone."""
Viewer = Literal["web", "native", "none"]
"""Where a swarm is shown."""

_REFRESH = 0.1
"""Least period of the dashboard and of progress, wall s."""
_LISTENING = 0.02
"""Longest wall time between two readings of the telemetry, s."""
_FIRST_START = 300.0
"""Wall time that processes may need to get ready: the first start compiles, s."""


@dataclass(frozen=True)
class FlightOptions:
    """How to fly, as opposed to what."""

    folder: Path
    lockstep: bool = True
    """All wait for each other; otherwise each flies by the wall clock."""
    speed: float = 1.0
    """Simulated seconds per second, at most; inf: as fast as the computer can."""
    pack: int = 1
    held: bool = False
    viewer: Viewer = "none"
    open_browser: bool = False
    record_view: bool = True
    """Write ``swarm.rrd``."""
    listeners: tuple[Address, ...] = LISTENERS
    """Where other ground stations may listen."""
    key: Path | None = None
    """Key file for signed links to the ground."""
    id_offset: int = 0
    """What UAVs' ids have added as MAVLink systems towards the ground."""


@dataclass
class _Flight:
    """What the loop of a flight holds together."""

    mission: Mission
    swarm: Swarm
    station: Monitor
    dashboard: Any
    feed: Feed | None
    log: EventLog
    say: Callable[[Event], None]
    pacing: Pacing
    next_event: int = 0
    refreshed: float = 0.0

    def note(self, event: Event) -> None:
        """An event to the log, the dashboard and the caller; at the present simulated time if it has none."""
        stamped = event if event.t >= 0.0 else replace(event, t=self.station.t)
        more = {"who": event.who, "outcome": event.outcome} if event.who or event.outcome else {}
        self._write(stamped, more)
        self.station.note(stamped)
        self.say(stamped)

    def _write(self, event: Event, more: dict[str, str]) -> None:
        fine = not self.log.trouble
        self.log.write(event.t, event.text, event.uav, event.severity, **more)
        if fine and self.log.trouble:
            self.note(Event(event.t, "error", f"events are not logged any further: {self.log.trouble}"))

    def scheduled_events(self) -> None:
        """Note the scenario's own events as their time comes."""
        while self.next_event < len(self.mission.events) and self.mission.events[self.next_event][0] <= self.station.t:
            t, uav, severity, text = self.mission.events[self.next_event]
            self.note(Event(t, severity, text, uav))
            self.next_event += 1

    def watch_pace(self) -> None:
        """Measure how fast the swarm flies, and say where it is too slow."""
        flown = round(self.station.t / self.mission.timing.period) * len(self.mission.vehicles)
        text = self.pacing.look(
            time.monotonic(),
            self.station.t,
            (self.station.late, flown),
            [(child.name, child.process.pid or 0, child.kind) for child in self.swarm.flying],
            self.dashboard.pids if self.dashboard is not None else [],
        )
        if text:
            self.note(Event(-1.0, "warning", text))

    def refresh(self, progress: Progress) -> None:
        """Draw the swarm, at most ten times a second."""
        if time.monotonic() - self.refreshed < _REFRESH:
            return
        self.refreshed = time.monotonic()
        if trouble := self.station.take_trouble():
            self.note(Event(-1.0, "error", trouble))
        self.scheduled_events()
        if self.swarm.flow.state == "flying" and self.station.t > 0.0:
            self.watch_pace()
        progress(self.station.t, self.pacing.pace)
        # The first picture sets the scale: it waits for everybody, but not for ever.
        if not (self.station.complete or self.station.t > 1.0):
            return
        snapshot = replace(self.station.snapshot(), pace=self.pacing.pace)
        if self.feed is not None:
            self.feed.offer(snapshot)
        if self.dashboard is not None:
            self.dashboard.log(snapshot)
            for problem in self.dashboard.take_problems():
                self.note(problem)


def fly_swarm(
    mission: Mission,
    options: FlightOptions,
    ports: PortBlock,
    say: Callable[[Event], None],
    progress: Progress,
    started: Callable[[str | None], None],
) -> Outcome:
    """Fly ``mission`` and leave a complete run in ``options.folder``.

    Parameters
    ----------
    say : called with every event.
    progress : called with the simulated time and the pace, up to ten times a second.
    started : called once everybody is ready, with the viewer's address or None.

    Ctrl-C and SIGTERM end the flight in order.

    Raises
    ------
    TooFewFilesError
        If processes may not open as many files as they need: nothing is started.
    TimeoutError
        If not all processes get ready.
    """
    provide_files(mission, options.pack, len(options.listeners))
    folder = options.folder
    folder.mkdir(parents=True, exist_ok=True)
    run_started = time.time()
    (folder / "scenario.toml").write_text(mission.toml_of_run(run_started), encoding="utf-8")
    flight: _Flight

    def on_event(event: Event) -> None:
        flight.note(event)

    swarm = Swarm(
        mission,
        folder,
        ports,
        lockstep=options.lockstep,
        speed=options.speed,
        pack=options.pack,
        held=options.held,
        listeners=options.listeners,
        key=options.key,
        id_offset=options.id_offset,
        started=run_started,
        on_event=on_event,
    )
    # The fork server must exist before this process opens anything.
    swarm.start()
    signals = [signal_.name for signal_ in mission.scheme.signals]
    uavs = [spec.uav for spec in mission.vehicles]
    sources = [port for uav in uavs for port in (ports.of(uav).telemetry, ports.of(uav).truth)]
    tlog = folder / "telemetry.tlog"
    station = Monitor(ports.station, sources, uavs, mission.plant, signals, tlog, options.id_offset, run_started)
    log = EventLog(folder / "events.jsonl")
    asked = None if math.isinf(options.speed) else options.speed
    setup = Setup(asked, len(uavs), options.pack, automatic_pack(len(uavs)), usable_cores())
    pacing = Pacing(setup, options.lockstep)
    flight = _Flight(mission, swarm, station, None, None, log, say, pacing)
    control = None
    flown_for = 0.0
    """Wall time of the flight, s."""
    with _stopping_on_signals(swarm):
        try:
            flight.dashboard = _dashboard(mission, options, ports)
            address = flight.dashboard.address if flight.dashboard else None
            control = Control(_entry(mission, options, ports, address), lambda what, how: _obey(flight, what, how))
            flight.feed = Feed(folder.name)
            _loop(flight, lambda: swarm.ready, control, _FIRST_START, _unseen)
            started(address)
            swarm.go()
            begun = time.monotonic()
            _loop(flight, lambda: swarm.over, control, None, progress)
            flown_for = time.monotonic() - begun
            station.read()
            flight.refreshed = 0.0
            flight.refresh(progress)
        finally:
            swarm.stop()
            _loop(flight, lambda: swarm.over, None, 5.0, _unseen)
            swarm.release()
            _conclude(flight)
            station.close()
            if control:
                control.close()
            if flight.feed:
                flight.feed.close()
            if flight.dashboard:
                flight.dashboard.close()
            ports.release()
    if station.strangers:
        log.write(station.t, f"dropped {station.strangers} datagrams of strangers at the station")
    log.write(
        station.t,
        f"flight over: {swarm.outcome.late} of {swarm.outcome.ticks} ticks late",
        late=swarm.outcome.late,
        ticks=swarm.outcome.ticks,
        factor=round(swarm.outcome.flown * mission.timing.period / flown_for, 3) if flown_for else None,
        asked=pacing.pace.asked,
        limit=pacing.pace.limit,
        advice=pacing.pace.advice,
        late_of={str(uav): state.late for uav, state in station.snapshot().uavs.items()},
    )
    log.close()
    return swarm.outcome


def _loop(
    flight: _Flight,
    done: Callable[[], bool],
    control: Control | None,
    seconds: float | None,
    progress: Progress,
) -> None:
    """Attend to everybody until ``done`` or, at most, for ``seconds``; a stop ends the wait for readiness too."""
    until = None if seconds is None else time.monotonic() + seconds
    waiting_for_ready = done() is False and seconds == _FIRST_START
    while not done():
        if until is not None and time.monotonic() > until:
            if waiting_for_ready:
                names = ", ".join(child.name for child in flight.swarm.children if not child.ready)
                raise TimeoutError(f"not ready after {seconds:.0f} s: {names}; see the logs in {flight.swarm.folder}")
            return
        if waiting_for_ready and flight.swarm.stopping_since is not None:
            return
        # The station hears something all the time: it is read now and then.
        wait([flight.swarm.fileno(), *([control.fileno()] if control else [])], _LISTENING)
        flight.swarm.attend()
        flight.station.read()
        if control:
            control.serve()
        flight.refresh(progress)


def _conclude(flight: _Flight) -> None:
    """Say how the flight went, in its log, its folder and the dashboard, where anything was recorded."""
    run = Run(flight.swarm.folder)
    try:
        verdict = judge(run, flight.mission, run.lost)
    except RunError:
        # What has been recorded cannot be read, or is nothing: the log says why.
        return
    except OSError as error:
        what = f"not merged into signals.parquet: {error.strerror or error}; `ftcc report` does it once there is room"
        flight.note(Event(-1.0, "error", f"the processes' recordings are {what}"))
        return
    flight.swarm.outcome.verdict = verdict
    try:
        (run.path / VERDICT_FILE).write_text(verdict.dumps(), encoding="utf-8")
    except OSError as error:
        flight.note(Event(-1.0, "error", f"{VERDICT_FILE} could not be written: {error.strerror}"))
    flight.log.write(run.end, verdict.text, severity=verdict.severity)
    flight.station.note(Event(run.end, verdict.severity, verdict.text))
    if not flight.station.complete:
        return
    snapshot = flight.station.snapshot()
    if flight.feed is not None:
        flight.feed.offer(snapshot)
    if flight.dashboard is not None:
        flight.dashboard.log(snapshot)


def _unseen(_t: float, _pace: Pace) -> None:
    """Nobody looks at the progress."""


def _obey(flight: _Flight, command: str, arguments: Mapping[str, Any]) -> dict[str, Any] | None:
    """A command from the control socket.

    Raises
    ------
    ValueError
        With what is wrong with it.
    """
    flow, text = flight.swarm.flow, ""
    match command:
        case "status":
            t = flow.tick * flow.period if flow.state == "held" else flight.station.t
            pace = flight.pacing.pace
            reached = None if math.isnan(pace.factor) else pace.factor
            told = {"speed": pace.asked, "factor": reached, "limit": pace.limit, "advice": pace.advice}
            return {"state": flow.state, "t": t, **told}
        case "stop":
            flight.swarm.stop()
        case "pause":
            flow.pause()
            text = "paused"
        case "step":
            flow.step(max(1, int(arguments["ticks"])))
        case "resume":
            flow.resume()
            flight.pacing.restart()
            text = "resumed"
        case "speed":
            factor = arguments["factor"]
            flow.set_speed(math.inf if factor is None else float(factor))
            flight.pacing.ask(flow.speed)
            text = "speed max" if factor is None else f"speed {flow.speed:g}"
        case _:
            raise ValueError(f"unknown command {command!r}")
    if text:
        flight.note(Event(-1.0, "info", text, who="command line", outcome="accepted"))
    return None


def _entry(mission: Mission, options: FlightOptions, ports: PortBlock, address: str | None) -> Entry:
    folder = options.folder
    return Entry(
        name=folder.name,
        pid=os.getpid(),
        scenario=mission.name,
        folder=str(folder.resolve()),
        vehicles=tuple(
            Card(
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
    """The dashboard, or None where nothing is to be shown or recorded."""
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
def _stopping_on_signals(swarm: Swarm) -> Iterator[None]:
    """Ctrl-C and SIGTERM end the flight in order; elsewhere than in the main thread signals are not ours."""
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
