"""A whole flight in one process: the same functions in the same order as between processes, and the same recording."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import psutil  # type: ignore[import-untyped]
from numpy.typing import NDArray

from ftcc.airside.autopilots import tick_of, told
from ftcc.groundside.errors import UserError
from ftcc.groundside.mission import Mission
from ftcc.groundside.run import Run
from ftcc.groundside.table import write_table
from ftcc.groundside.verdict import FILE, Verdict, judge
from ftcc.link.actuators import SLOT
from ftcc.link.channel import LINK_REPORT
from ftcc.link.compiled import instantiate, uncompile
from ftcc.link.happenings import drained
from ftcc.link.recording import AIRCRAFT_LOST, LINK_COLUMNS, EventLog
from ftcc.sim.obstacles import clearance, entered_text, zones_of
from ftcc.sim.plant import LOST, TRUTH
from ftcc.sim.plants import conditions_of, cycle_of, find

__all__ = ["Flight", "PlainPython", "TooLargeError", "fly", "loop_of", "record", "simulate"]

_CHUNKS = 100
"""A flight is flown in so many pieces, between which progress is shown and Ctrl-C is heard."""

Progress = Callable[[float], None]


class TooLargeError(UserError):
    """A flight whose recording does not fit into memory."""


class PlainPython(UserWarning):
    """A scheme flies as plain Python, because numba cannot compile it."""


@dataclass(frozen=True)
class Flight:
    """A flight in memory; offers its columns as a `Run` does."""

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

    def column(self, name: str, uav: int) -> NDArray[np.float64]:
        """A column of one UAV in order of time, as far as it flew."""
        i = self.mission.uavs.index(uav)
        rows = int(np.isfinite(self.truth[:, i, 0]).sum())
        if name == "t":
            return self.t[:rows]
        values, n = self._places[name]
        return values[:rows, i, n]

    def link_table(self) -> dict[str, NDArray[Any]]:
        """A row per report and in-edge, by time, then receiver; the columns of ``link.recording.LINK_COLUMNS``."""
        timing = self.mission.timing
        times = np.arange(len(self.links)) * (timing.report_every * timing.period_us / 1e6)
        edges = [
            (i, edge, spec.uav, neighbour.uav)
            for i, spec in sorted(enumerate(self.mission.autopilots), key=lambda pair: pair[1].uav)
            for edge, neighbour in enumerate(spec.neighbours)
        ]
        values = [self.links[:, i, edge] for i, edge, _, _ in edges]
        rows = (
            np.stack(values, axis=1).reshape(len(times) * len(edges), -1) if values else np.empty((0, len(LINK_REPORT)))
        )
        table: dict[str, NDArray[Any]] = {
            "t": np.repeat(times, len(edges)),
            "uav": np.tile(np.array([edge[2] for edge in edges], np.int32), len(times)),
            "sender": np.tile(np.array([edge[3] for edge in edges], np.int32), len(times)),
        }
        table |= {name: rows[:, n] for n, name in enumerate(LINK_REPORT)}
        told = np.isfinite(table["sent"])
        return {name: column[told] for name, column in table.items()}

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


def _require_memory(mission: Mission) -> None:
    """Refuse a flight whose recording does not fit into the free memory; while it is written it is there twice."""
    timing, uavs = mission.timing, len(mission.uavs)
    rows = timing.ticks // timing.record_every + 1
    columns = 2 + len(TRUTH) + 2 * 4 + len(conditions_of(mission.plant)) + len(mission.scheme.signals)
    needed, free = 2 * 8 * rows * uavs * columns, psutil.virtual_memory().available
    if needed > free:
        raise TooLargeError(
            f"duration = {timing.duration:g}: {rows} rows of {uavs} UAVs take {needed / 1e9:.1f} GB of memory, "
            f"{free / 1e9:.1f} GB are free; fly shorter, or lower record_rate"
        )


def loop_of(scheme: str, plant: str) -> ModuleType:
    """The flight of a scheme on a plant, see `flight_loop`: compiled, or plain Python if numba refuses the scheme."""
    tick = tick_of(scheme)
    loop = instantiate("ftcc.groundside.flight_loop", f"{scheme},{plant}", tick=tick, cycle=cycle_of(plant))
    if tick.REFUSAL:
        uncompile([loop])
    return loop


def fly(mission: Mission, progress: Progress | None = None, ready: Callable[[], None] | None = None) -> Flight:
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
    _require_memory(mission)
    timing = mission.timing
    loop = loop_of(mission.scheme.name, mission.plant)
    if loop.tick.REFUSAL:
        warnings.warn(loop.tick.REFUSAL, PlainPython, stacklevel=2)
    world = loop.new_world(mission.vehicles, mission.autopilots, timing, len(conditions_of(mission.plant)))
    loop.fly(world, timing, mission.wire, 0, 0)
    if ready is not None:
        ready()
    end = timing.ticks + 1
    chunk = max(1, -(-end // _CHUNKS))
    flown = 0
    interrupted = False
    events: list[tuple[float, int, str, str]] = []
    while flown < end and not interrupted:
        try:
            loop.fly(world, timing, mission.wire, flown, min(end, flown + chunk))
            events += _happened(mission, world.fleet, world.autopilots)
            flown = min(end, flown + chunk)
            if progress is not None:
                progress((flown - 1) * timing.period)
        except KeyboardInterrupt:
            # What has been flown is recorded; a shorter flight than was asked for is not hidden.
            interrupted = True
    recording = world.recording
    rows = (flown - 1) // timing.record_every + 1 if flown else 0
    return Flight(
        mission=mission,
        truth=recording.truth[:rows],
        command=recording.command[:rows],
        acting=recording.acting[:rows],
        conditions=recording.conditions[:rows],
        signals=recording.signals[:rows],
        links=recording.links[: (flown - 1) // timing.report_every + 1 if flown else 0],
        t=np.arange(rows) * timing.record_every * timing.period_us / 1e6,
        lost={
            uav: (float(recording.lost_us[i] / 1e6), LOST[int(recording.lost[i])])
            for i, uav in enumerate(mission.uavs)
            if recording.lost[i] > 0
        },
        events=tuple(events),
    )


def _happened(mission: Mission, fleet: Any, autopilots: Any) -> list[tuple[float, int, str, str]]:
    """What vehicles and autopilots have noted: time s, UAV, severity, text."""
    entries = [(at, mission.uavs[i], number) for at, i, _, number in drained(fleet.happenings)]
    events = [(at, uav, "warning", entered_text(uav, number)) for at, uav, number in entries]
    events += told(autopilots, mission.autopilots)
    return [(at / 1e6, uav, severity, text) for at, uav, severity, text in sorted(events)]


def simulate(
    mission: Mission, folder: Path, progress: Progress | None = None, ready: Callable[[], None] | None = None
) -> Run:
    """Fly a mission in this process and record it in ``folder``, as the processes of a swarm would."""
    return record(fly(mission, progress, ready), folder)


def record(flight: Flight, folder: Path) -> Run:
    """Write a flight into ``folder``, as the processes of a swarm would."""
    # Arrow, and what the columns' descriptions pull in, are not needed before the flight.
    from ftcc.airside.process import columns as autopilot_columns
    from ftcc.sim.process import columns as vehicle_columns

    mission = flight.mission
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scenario.toml").write_text(mission.toml, encoding="utf-8")
    events = EventLog(folder / "events.jsonl")
    for t, uav, severity, text in mission.events:
        if len(flight.t) and t <= flight.t[-1]:
            events.write(t, text, uav, severity)
    if refusal := tick_of(mission.scheme.name).REFUSAL:
        events.write(0.0, refusal, severity="warning")
    for uav, (t, why) in flight.lost.items():
        events.write(t, f"{AIRCRAFT_LOST}{why}", uav, "error")
    for t, uav, severity, text in flight.events:
        events.write(t, text, uav, severity)
    last = float(flight.t[-1]) if len(flight.t) else 0.0
    if last < mission.timing.duration - mission.timing.period * mission.timing.record_every:
        events.write(last, "interrupted", severity="warning")
    events.write(last, flight.verdict.text, severity=flight.verdict.severity)
    events.close()
    (folder / FILE).write_text(flight.verdict.dumps(), encoding="utf-8")
    columns = (*vehicle_columns(mission.plant, bool(mission.obstacles)), *autopilot_columns(mission.scheme.name))
    write_table(folder / "signals.parquet", columns, flight.table())
    write_table(folder / "links.parquet", LINK_COLUMNS, flight.link_table())
    return Run(folder)
