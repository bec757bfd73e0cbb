"""A flight in one process, written to a folder block by block: an hour takes as much memory as a minute."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil  # type: ignore[import-untyped]

from ftcc.airside.compiled_stages import stages_of
from ftcc.airside.spec import is_active
from ftcc.groundside.results import LIES_FILE, Run, TableWriter
from ftcc.groundside.scenario import Mission
from ftcc.groundside.simulation.flight import Flight, recorded_columns
from ftcc.groundside.simulation.one_process import LawError, Progress, defer_interrupt, fly_in_parts
from ftcc.groundside.simulation.space import recording_size, require_space
from ftcc.groundside.verdict import VERDICT_FILE, judge
from ftcc.link.recording import AIRCRAFT_LOST, LINK_COLUMNS, EventLog

__all__ = ["fly_to_disk"]

_BLOCK = 65536
"""Rows of all UAVs that `fly_to_disk` keeps in memory before it writes them."""
_LEAST_SHARE = 0.1
"""Least size on disk, as a share of the size in memory; only constant columns take less."""


def fly_to_disk(
    mission: Mission, folder: Path, progress: Progress | None = None, ready: Callable[[], None] | None = None
) -> Run:
    """Fly a mission in this process and record it in ``folder``, as the processes of a swarm would.

    Raises
    ------
    TooLargeError
        If the recording certainly does not fit on the disk.
    OSError
        If it cannot be written, for example on a full disk.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    require_space(
        mission, _LEAST_SHARE * recording_size(mission)[1], psutil.disk_usage(str(folder)).free / 1e9, "disk at least"
    )
    timing = mission.timing
    last = 0.0
    with (
        _nothing_left_of_an_error(folder),
        TableWriter(folder / "signals.parquet", recorded_columns(mission)) as signals,
        TableWriter(folder / "links.parquet", LINK_COLUMNS) as links,
        contextlib.ExitStack() as more,
    ):
        lies: TableWriter | None = None

        def take(part: Flight) -> None:
            nonlocal last, lies
            signals.write(part.table())
            links.write(part.link_table())
            if len(part.lies):
                # A file only where anybody lied.
                lies = lies or more.enter_context(TableWriter(folder / LIES_FILE, mission.lie_columns))
                lies.write(part.lie_table())
            last = float(part.t[-1]) if len(part.t) else last

        room = min(timing.ticks + 1, max(1, _BLOCK // len(mission.uavs)) * timing.record_every)
        rest = fly_in_parts(mission, room, take, progress, ready)
        with contextlib.suppress(KeyboardInterrupt), defer_interrupt():
            take(rest)
    return _conclude(mission, folder, last, rest)


@contextlib.contextmanager
def _nothing_left_of_an_error(folder: Path) -> Iterator[None]:
    """Remove what was recorded of a flight whose law raised an error: it is no run."""
    try:
        yield
    except LawError:
        for name in ("signals.parquet", "links.parquet", LIES_FILE):
            (folder / name).unlink(missing_ok=True)
        raise


def _conclude(mission: Mission, folder: Path, last: float, flight: Flight) -> Run:
    """Write scenario, events and verdict of a flight into ``folder``, which has its signals up to ``last`` (s)."""
    (folder / "scenario.toml").write_text(mission.toml_of_run(time.time()), encoding="utf-8")
    events = EventLog(folder / "events.jsonl")
    for t, uav, severity, text in mission.events:
        if t <= last:
            events.write(t, text, uav, severity)
    if refusal := stages_of(mission.scheme.name, is_active(mission.autopilots)).REFUSAL:
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
