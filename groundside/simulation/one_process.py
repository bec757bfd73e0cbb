"""A whole flight in one process: the same functions in the same order as between processes, and the same recording.

`fly_in_memory` keeps the recording; `to_disk.fly_to_disk` writes it to disk part by part.
"""

from __future__ import annotations

import contextlib
import functools
import signal
import threading
import warnings
from collections.abc import Callable, Collection, Iterator
from types import ModuleType
from typing import Any

import numpy as np
import psutil  # type: ignore[import-untyped]
from numpy.typing import NDArray

from ftcc.airside.attacks.arrays import LOG_FULL
from ftcc.airside.attacks.recording import drain_lies
from ftcc.airside.compiled_stages import stages_of
from ftcc.airside.law_errors import describe_error, describe_not_finite
from ftcc.airside.leader import drain_leader_events
from ftcc.airside.spec import is_active
from ftcc.groundside.errors import UserError
from ftcc.groundside.scenario import Mission
from ftcc.groundside.simulation.columns import places_kept
from ftcc.groundside.simulation.flight import Flight
from ftcc.groundside.simulation.flight_arrays import new_world
from ftcc.groundside.simulation.space import recording_size, require_space
from ftcc.link.compiled import entry_of, instantiate, uncompile
from ftcc.link.events import drain_events
from ftcc.sim.jsbsim.flight import lost_text
from ftcc.sim.obstacles import entered_text
from ftcc.sim.plant import DIVERGED
from ftcc.sim.plants import conditions_of, cycle_of

__all__ = ["LawError", "PlainPython", "Progress", "defer_interrupt", "fly_in_memory", "fly_in_parts", "loop_of"]

_CHUNKS = 100
"""Number of pieces of a flight; progress is reported and Ctrl-C takes effect between them."""

Progress = Callable[[float], None]


class PlainPython(UserWarning):
    """A scheme flies as plain Python because it is not compiled, or numba cannot compile it."""


class LawError(UserError):
    """A control law raised an error in flight; the text says in which file and line, of which UAV, and when."""


def loop_of(scheme: str, plant: str, active: bool = False) -> ModuleType:
    """Return `flight_loop` for a scheme and a plant, with active fault tolerance or without.

    It is compiled, or plain Python if numba cannot compile the scheme.
    """
    stages = stages_of(scheme, active)
    name = f"{scheme},{plant},active" if active else f"{scheme},{plant}"
    loop = instantiate("ftcc.groundside.simulation.flight_loop", name, stages=stages, cycle=cycle_of(plant))
    if stages.REFUSAL:
        uncompile([loop])
    return loop


def fly_in_memory(
    mission: Mission,
    progress: Progress | None = None,
    ready: Callable[[], None] | None = None,
    columns: Collection[str] | None = None,
) -> Flight:
    """Fly a mission in memory.

    Parameters
    ----------
    mission : Mission
    progress : callable, optional
        Called with the simulated time, s.
    ready : callable, optional
        Called once when everything is compiled, before the first tick.
    columns : collection of str, optional
        What is recorded, such as `columns_needed(mission)`; by default all. The flight is the same.

    Raises
    ------
    TooLargeError
        If the recording does not fit into memory.
    UserError
        If the mission has no such column, or, as `LawError`, if the law raises an error.
    """
    # Results that are computed from it need the same space again.
    require_space(mission, 2 * recording_size(mission, columns)[1], psutil.virtual_memory().available / 1e9, "memory")
    return fly_in_parts(mission, mission.timing.ticks + 1, lambda _: None, progress, ready, columns)


def fly_in_parts(
    mission: Mission,
    room: int,
    take: Callable[[Flight], None],
    progress: Progress | None,
    ready: Callable[[], None] | None,
    columns: Collection[str] | None = None,
) -> Flight:
    """Fly a mission; pass the recording of every ``room`` ticks to ``take``, and return the last part."""
    timing = mission.timing
    loop = loop_of(mission.scheme.name, mission.plant, is_active(mission.autopilots))
    kept = list(places_kept(mission, columns).values())
    world = new_world(mission.vehicles, mission.autopilots, timing, len(conditions_of(mission.plant)), room, kept)
    flight_so_far = functools.partial(_flight_so_far, mission, columns, world.recording, world.fleet.model)
    fly_ticks = loop.fly_by_wire if mission.wire else loop.fly_ideally
    fly_ticks(world, timing, 0, 0)
    fly_ticks = entry_of(fly_ticks, world, timing, 0, 0)
    if ready is not None:
        ready()
    end = timing.ticks + 1
    chunk = min(room, max(1, -(-end // _CHUNKS)), _until_lies_are_full(mission))
    flown = taken = 0
    interrupted = False
    events: list[tuple[float, int, str, str]] = []
    told = [np.empty((0, len(mission.lie_columns)))]
    diverged: set[int] = set()
    while flown < end and not interrupted:
        try:
            if flown == taken + room:
                with defer_interrupt():
                    take(flight_so_far(taken, flown, events, told))
                    taken = flown
                    told = told[:1]
                    world.recording.begin(-(-taken // timing.record_every), -(-taken // timing.report_every))
            # A law that has just been written fails at the first tick, if ever: then that is all there is to say of it.
            until = min(end, flown + chunk, taken + room) if flown else 1
            fly_ticks(world, timing, flown, until)
            if not flown and loop.stages.REFUSAL:
                warnings.warn(loop.stages.REFUSAL, PlainPython, stacklevel=3)
            events += _drain_all_events(mission, world.fleet, world.autopilots)
            events += _describe_divergence(mission, world, diverged)
            told.append(drain_lies(world.attacks, mission.scheme))
            flown = until
            if progress is not None:
                progress((flown - 1) * timing.period)
        except Exception as error:
            if text := describe_error(error, mission.scheme, world.autopilots, mission.autopilots):
                raise LawError(text) from error
            raise
        except KeyboardInterrupt:
            # The flight so far is recorded, and its verdict says that it ended early.
            interrupted = True
    return flight_so_far(taken, flown, events, told)


def _until_lies_are_full(mission: Mission) -> int:
    """Return for how many ticks what attacked UAVs tell can wait to be recorded."""
    attacks = sum(len(spec.attacks) for spec in mission.autopilots)
    return max(1, LOG_FULL // max(1, attacks)) * mission.timing.exchange_every


@contextlib.contextmanager
def defer_interrupt() -> Iterator[None]:
    """Delay Ctrl-C to the end of the ``with`` block, so that data is written whole.

    Only the main thread receives Ctrl-C; other threads need no delay.
    """
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
    mission: Mission,
    columns: Collection[str] | None,
    recording: Any,
    models: NDArray[np.int64],
    begin: int,
    end: int,
    events: list[tuple[float, int, str, str]],
    told: list[NDArray[np.float64]],
) -> Flight:
    """Return the recording of ticks ``begin`` .. ``end`` - 1, with all events so far."""
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
            uav: (float(recording.lost_us[i] / 1e6), lost_text(models, i, int(recording.lost[i])))
            for i, uav in enumerate(mission.uavs)
            if recording.lost[i] > 0
        },
        events=tuple(events),
        lies=np.concatenate(told),
        first_report=report,
        columns=None if columns is None else frozenset(columns),
    )


def _describe_divergence(mission: Mission, world: Any, known: set[int]) -> list[tuple[float, int, str, str]]:
    """Return events of UAVs whose law has diverged since the last call, which ``known`` holds: which number did."""
    events = []
    for i in map(int, np.flatnonzero(world.recording.lost == DIVERGED)):
        if i not in known:
            known.add(i)
            text = describe_not_finite(mission.scheme, world.autopilots, i)
            events.append((float(world.recording.lost_us[i]) / 1e6, mission.uavs[i], "warning", text))
    return events


def _drain_all_events(mission: Mission, fleet: Any, autopilots: Any) -> list[tuple[float, int, str, str]]:
    """Remove and return the events of vehicles and autopilots: time s, UAV, severity, text."""
    entries = [(at, mission.uavs[i], number) for at, i, _, number in drain_events(fleet.events)]
    events = [(at, uav, "warning", entered_text(uav, number)) for at, uav, number in entries]
    events += drain_leader_events(autopilots, mission.autopilots)
    return [(at / 1e6, uav, severity, text) for at, uav, severity, text in sorted(events)]
