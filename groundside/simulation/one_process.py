"""A whole flight in one process: the same functions in the same order as between processes, and the same recording.

`fly` keeps it in memory, `simulate` writes it while it flies, block by block: an hour takes as much memory as a
minute.
"""

from __future__ import annotations

import contextlib
import functools
import signal
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import psutil  # type: ignore[import-untyped]
from numpy.typing import NDArray

from ftcc.airside.compiled_stages import stages_of
from ftcc.airside.leader import drain_leader_events
from ftcc.groundside.errors import UserError
from ftcc.groundside.results import Run, TableWriter
from ftcc.groundside.scenario import Mission
from ftcc.groundside.verdict import VERDICT_FILE, Verdict, judge
from ftcc.link.actuators import SLOT
from ftcc.link.channel import LINK_REPORT
from ftcc.link.compiled import instantiate, uncompile
from ftcc.link.events import drain_events
from ftcc.link.recording import AIRCRAFT_LOST, LINK_COLUMNS, EventLog
from ftcc.sim.obstacles import clearance, entered_text, zones_of
from ftcc.sim.plant import LOST, TRUTH
from ftcc.sim.plants import conditions_of, cycle_of, find

__all__ = ["Flight", "PlainPython", "TooLargeError", "fly_in_memory", "loop_of", "simulate"]

_CHUNKS = 100
"""A flight is flown in so many pieces, between which progress is shown and Ctrl-C is heard."""

_BLOCK = 65536
"""Rows, of all UAVs together, that `simulate` has in memory and then writes."""
_LEAST_SHARE = 0.1
"""Of what rows take in memory, what they take on disk at the very least: only what never changes takes less."""

Progress = Callable[[float], None]


class TooLargeError(UserError):
    """A flight whose recording does not fit into memory, or not on the disk."""


class PlainPython(UserWarning):
    """A scheme flies as plain Python, because numba cannot compile it."""


@dataclass(frozen=True)
class Flight:
    """A flight, or a part of one, in memory; offers its columns as a `Run` does."""

    mission: Mission
    truth: NDArray[np.float64]
    """(n, k, 13): recorded tick, UAV in the order of the mission, in the order of ``TRUTH``; nan once a UAV is lost."""
    command: NDArray[np.float64]
    """(n, k, 4): in force, by the actuators' slots."""
    acting: NDArray[np.float64]
    """(n, k, 4): what acts on the airframe."""
    conditions: NDArray[np.float64]
    """(n, k, c): what only the simulator knows, see ``sim.plants.conditions_of``."""
    signals: NDArray[np.float64]
    """(n, k, s): in the order of the scheme's ``SIGNALS``."""
    links: NDArray[np.float64]
    """(m, k, e, 5): a row per report and in-edge, in the order of the neighbours; see ``link.channel.LINK_REPORT``."""
    t: NDArray[np.float64]
    """(n,): s."""
    lost: dict[int, tuple[float, str]]
    """When (s) and why a UAV was lost."""
    events: tuple[tuple[float, int, str, str], ...] = ()
    """What happened otherwise: time s, UAV, severity, text."""
    first_report: int = 0
    """Number of the first one in ``links``."""

    @property
    def uavs(self) -> tuple[int, ...]:
        """Ids, ascending."""
        return tuple(sorted(self.mission.uavs))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self._places)

    @property
    def _places(self) -> dict[str, tuple[NDArray[np.float64], int]]:
        places = {name: (self.truth, n) for n, name in enumerate(TRUTH)}
        actuators = find(self.mission.plant).ACTUATORS
        places |= {f"{name}_command": (self.command, SLOT[name]) for name in actuators}
        places |= {name: (self.acting, SLOT[name]) for name in actuators}
        places |= {name: (self.conditions, n) for n, (name, _) in enumerate(conditions_of(self.mission.plant))}
        if self.mission.obstacles:
            places["clearance"] = (self.clearance, 0)
        return places | {quantity.name: (self.signals, n) for n, quantity in enumerate(self.mission.scheme.signals)}

    @functools.cached_property
    def clearance(self) -> NDArray[np.float64]:
        """(n, k, 1): height above the obstacle below, m."""
        zones = zones_of(self.mission.obstacles)
        x, z = self.truth[:, :, TRUTH.index("x")], self.truth[:, :, TRUTH.index("z")]
        heights = [clearance(zones, *place) for place in zip(x.ravel().tolist(), z.ravel().tolist(), strict=True)]
        return np.array(heights).reshape(*x.shape, 1)

    @functools.cached_property
    def verdict(self) -> Verdict:
        """How it went."""
        return judge(self, self.mission, self.lost)

    @functools.cached_property
    def _flown(self) -> list[int]:
        """Rows of each UAV, in the order of the mission."""
        return [int(rows) for rows in np.isfinite(self.truth[:, :, 0]).sum(axis=0)]

    def column(self, name: str, uav: int) -> NDArray[np.float64]:
        """A column of one UAV in order of time, as far as it flew."""
        i = self.mission.uavs.index(uav)
        rows = self._flown[i]
        if name == "t":
            return self.t[:rows]
        values, n = self._places[name]
        return values[:rows, i, n]

    def link_table(self) -> dict[str, NDArray[Any]]:
        """A row per report and in-edge, by time, then receiver; the columns of ``link.recording.LINK_COLUMNS``."""
        timing = self.mission.timing
        numbers = np.arange(self.first_report, self.first_report + len(self.links))
        times = numbers * (timing.report_every * timing.period_us / 1e6)
        edges = [
            (i, edge, spec.uav, neighbour.uav)
            for i, spec in sorted(enumerate(self.mission.autopilots), key=lambda pair: pair[1].uav)
            for edge, neighbour in enumerate(spec.neighbours)
        ]
        values = [self.links[:, i, edge] for i, edge, _, _ in edges]
        rows = np.stack(values, axis=1) if values else np.empty(0)
        rows = rows.reshape(len(times) * len(edges), len(LINK_REPORT))
        table: dict[str, NDArray[Any]] = {
            "t": np.repeat(times, len(edges)),
            "uav": np.tile(np.array([edge[2] for edge in edges], np.int32), len(times)),
            "sender": np.tile(np.array([edge[3] for edge in edges], np.int32), len(times)),
        }
        table |= {name: rows[:, n] for n, name in enumerate(LINK_REPORT)}
        reported = np.isfinite(table["sent"])
        return {name: column[reported] for name, column in table.items()}

    def table(self) -> dict[str, NDArray[Any]]:
        """All columns, a row per recorded tick and UAV, by time, then UAV."""
        order = np.argsort(self.mission.uavs)
        flown = np.isfinite(self.truth[:, order, 0]).ravel()
        table: dict[str, NDArray[Any]] = {
            "t": np.repeat(self.t, len(order))[flown],
            "uav": np.tile(np.array(self.mission.uavs, np.int32)[order], len(self.t))[flown],
        }
        for name, (values, n) in self._places.items():
            table[name] = values[:, order, n].ravel()[flown]
        return table


def _recording_size(mission: Mission) -> tuple[int, float]:
    """Rows of each UAV, and the GB that all of them take."""
    timing, uavs = mission.timing, len(mission.uavs)
    rows = timing.ticks // timing.record_every + 1
    columns = 2 + len(TRUTH) + 2 * 4 + len(conditions_of(mission.plant)) + len(mission.scheme.signals)
    return rows, 8 * rows * uavs * columns / 1e9


def _require_space(mission: Mission, needed: float, free: float, of: str) -> None:
    """Refuse a flight whose recording takes more GB than are free."""
    if needed > free:
        what = f"{_recording_size(mission)[0]} rows of {len(mission.uavs)} UAVs"
        raise TooLargeError(
            f"duration = {mission.timing.duration:g}: {what} take {needed:.1f} GB of {of}, {free:.1f} GB are free; "
            "shorten the flight, or lower record_rate"
        )


def loop_of(scheme: str, plant: str) -> ModuleType:
    """The flight of a scheme on a plant, see `flight_loop`: compiled, or plain Python if numba refuses the scheme."""
    stages = stages_of(scheme)
    loop = instantiate(
        "ftcc.groundside.simulation.flight_loop", f"{scheme},{plant}", stages=stages, cycle=cycle_of(plant)
    )
    if stages.REFUSAL:
        uncompile([loop])
    return loop


def fly_in_memory(
    mission: Mission, progress: Progress | None = None, ready: Callable[[], None] | None = None
) -> Flight:
    """Fly a mission in memory.

    Parameters
    ----------
    mission : Mission
    progress : callable, optional
        Called with the simulated time, s.
    ready : callable, optional
        Called once when everything is compiled, before the first tick.

    Raises
    ------
    TooLargeError
        If the recording does not fit into memory.
    """
    # What is made of it takes as much again.
    _require_space(mission, 2 * _recording_size(mission)[1], psutil.virtual_memory().available / 1e9, "memory")
    return _fly(mission, mission.timing.ticks + 1, lambda _: None, progress, ready)


def _fly(
    mission: Mission,
    room: int,
    take: Callable[[Flight], None],
    progress: Progress | None,
    ready: Callable[[], None] | None,
) -> Flight:
    """Fly a mission; ``take`` is given what was recorded after every ``room`` ticks, and the last part comes back."""
    timing = mission.timing
    loop = loop_of(mission.scheme.name, mission.plant)
    if loop.stages.REFUSAL:
        warnings.warn(loop.stages.REFUSAL, PlainPython, stacklevel=3)
    world = loop.new_world(mission.vehicles, mission.autopilots, timing, len(conditions_of(mission.plant)), room)
    loop.fly_ticks(world, timing, mission.wire, 0, 0)
    if ready is not None:
        ready()
    end = timing.ticks + 1
    chunk = min(room, max(1, -(-end // _CHUNKS)))
    flown = taken = 0
    interrupted = False
    events: list[tuple[float, int, str, str]] = []
    while flown < end and not interrupted:
        try:
            if flown == taken + room:
                with _defer_interrupt():
                    take(_flight_so_far(mission, world.recording, taken, flown, events))
                    taken = flown
                    world.recording.begin(-(-taken // timing.record_every), -(-taken // timing.report_every))
            until = min(end, flown + chunk, taken + room)
            loop.fly_ticks(world, timing, mission.wire, flown, until)
            events += _drain_all_events(mission, world.fleet, world.autopilots)
            flown = until
            if progress is not None:
                progress((flown - 1) * timing.period)
        except KeyboardInterrupt:
            # What has been flown is recorded; a shorter flight than was asked for is not hidden.
            interrupted = True
    return _flight_so_far(mission, world.recording, taken, flown, events)


@contextlib.contextmanager
def _defer_interrupt() -> Iterator[None]:
    """Ctrl-C that comes meanwhile is heard afterwards: no block is written by half. It only reaches the main thread."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if came:
            signal.raise_signal(signal.SIGINT)


def _flight_so_far(
    mission: Mission, recording: Any, begin: int, end: int, events: list[tuple[float, int, str, str]]
) -> Flight:
    """What ticks ``begin`` .. ``end`` - 1 have recorded, and what has happened up to then."""
    timing = mission.timing
    row, report = (int(first) for first in recording.first)
    rows = ((end - 1) // timing.record_every + 1 if end > begin else row) - row
    reports = ((end - 1) // timing.report_every + 1 if end > begin else report) - report
    return Flight(
        mission=mission,
        truth=recording.truth[:rows],
        command=recording.command[:rows],
        acting=recording.acting[:rows],
        conditions=recording.conditions[:rows],
        signals=recording.signals[:rows],
        links=recording.links[:reports],
        t=np.arange(row, row + rows) * timing.record_every * timing.period_us / 1e6,
        lost={
            uav: (float(recording.lost_us[i] / 1e6), LOST[int(recording.lost[i])])
            for i, uav in enumerate(mission.uavs)
            if recording.lost[i] > 0
        },
        events=tuple(events),
        first_report=report,
    )


def _drain_all_events(mission: Mission, fleet: Any, autopilots: Any) -> list[tuple[float, int, str, str]]:
    """What vehicles and autopilots have noted: time s, UAV, severity, text."""
    entries = [(at, mission.uavs[i], number) for at, i, _, number in drain_events(fleet.events)]
    events = [(at, uav, "warning", entered_text(uav, number)) for at, uav, number in entries]
    events += drain_leader_events(autopilots, mission.autopilots)
    return [(at / 1e6, uav, severity, text) for at, uav, severity, text in sorted(events)]


def simulate(
    mission: Mission, folder: Path, progress: Progress | None = None, ready: Callable[[], None] | None = None
) -> Run:
    """Fly a mission in this process and record it in ``folder``, as the processes of a swarm would.

    Raises
    ------
    TooLargeError
        If the recording surely does not fit on the disk.
    OSError
        If it cannot be written, as on a disk that is full.
    """
    # What the columns' descriptions pull in is not needed where nothing is recorded.
    from ftcc.airside.process import columns as autopilot_columns
    from ftcc.sim.process import columns as vehicle_columns

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    _require_space(
        mission, _LEAST_SHARE * _recording_size(mission)[1], psutil.disk_usage(str(folder)).free / 1e9, "disk at least"
    )
    timing = mission.timing
    columns = (*vehicle_columns(mission.plant, bool(mission.obstacles)), *autopilot_columns(mission.scheme.name))
    last = 0.0
    with (
        TableWriter(folder / "signals.parquet", columns) as signals,
        TableWriter(folder / "links.parquet", LINK_COLUMNS) as links,
    ):

        def take(part: Flight) -> None:
            nonlocal last
            signals.write(part.table())
            links.write(part.link_table())
            last = float(part.t[-1]) if len(part.t) else last

        room = min(timing.ticks + 1, max(1, _BLOCK // len(mission.uavs)) * timing.record_every)
        rest = _fly(mission, room, take, progress, ready)
        with contextlib.suppress(KeyboardInterrupt), _defer_interrupt():
            take(rest)
    return _conclude(mission, folder, last, rest)


def _conclude(mission: Mission, folder: Path, last: float, flight: Flight) -> Run:
    """The run of a flight whose signals up to ``last`` (s) are in ``folder``: with scenario, events and verdict."""
    (folder / "scenario.toml").write_text(mission.toml_of_run(time.time()), encoding="utf-8")
    events = EventLog(folder / "events.jsonl")
    for t, uav, severity, text in mission.events:
        if t <= last:
            events.write(t, text, uav, severity)
    if refusal := stages_of(mission.scheme.name).REFUSAL:
        events.write(0.0, refusal, severity="warning")
    for uav, (t, why) in flight.lost.items():
        events.write(t, f"{AIRCRAFT_LOST}{why}", uav, "error")
    for t, uav, severity, text in flight.events:
        events.write(t, text, uav, severity)
    if last < mission.timing.duration - mission.timing.period * mission.timing.record_every:
        events.write(last, "interrupted", severity="warning")
    run = Run(folder)
    run.mission = mission
    run.verdict = judge(run, mission, flight.lost)
    events.write(last, run.verdict.text, severity=run.verdict.severity)
    events.close()
    if events.trouble:
        raise OSError(f"{events.path}: {events.trouble}")
    (folder / VERDICT_FILE).write_text(run.verdict.dumps(), encoding="utf-8")
    return run
