"""A run's folder: the scenario, the events and the recording.

``scenario.toml`` (as flown), ``parts/`` (one file per process), ``events.jsonl``, ``signals.parquet``, ``report/``.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.results.column_reader import ColumnReader
from ftcc.groundside.results.folders import RunError
from ftcc.groundside.results.lies import read_lies
from ftcc.groundside.results.merging import merge_run, up_to_date_table
from ftcc.groundside.results.recording import Recording
from ftcc.link.recording import (
    AIRCRAFT_LOST,
    LINK_COLUMNS,
    NETWORK_FILE,
    Column,
    arrow_schema,
    read_events,
    read_lines,
    read_part,
)

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission, Scenario
    from ftcc.groundside.verdict import Verdict

__all__ = ["Run"]


class Run(Recording):
    """A recorded flight; for a flight in progress, its state at the first access.

    Parameters
    ----------
    path : str or Path
        The run's folder.

    Raises
    ------
    RunError
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._columns = ColumnReader(self.path)
        if not (self.path / "scenario.toml").is_file():
            raise RunError(f"{self.path}: is not the folder of a run (it contains no scenario.toml)")

    @functools.cached_property
    def scenario(self) -> Scenario:
        """The scenario as flown."""
        from ftcc.groundside.scenario import load

        return load(self.path / "scenario.toml")

    @functools.cached_property
    def mission(self) -> Mission:  # type: ignore[override]
        """The scenario resolved: graph, scheme, timing, claims."""
        from ftcc.groundside.scenario import resolve

        return resolve(self.scenario)

    @property
    def started(self) -> float:
        """Unix time (s) of simulated time 0 in exported tracks.

        It is the start of the run or the time at which a simulation was recorded; for a run of an earlier version, the
        time of its scenario file.
        """
        flown = self.scenario.plan.flown
        if flown is not None and flown.run is not None:
            return flown.run.started.timestamp()
        return (self.path / "scenario.toml").stat().st_mtime

    @property
    def events(self) -> list[dict[str, Any]]:
        """The events in order of simulated time: t (s), uav, severity, text."""
        return read_events(self.path / "events.jsonl")

    @property
    def lost(self) -> dict[int, tuple[float, str]]:
        """UAVs that were lost, by id: time (s), and cause from the event log."""
        found: dict[int, tuple[float, str]] = {}
        for event in self.events:
            if event["severity"] == "error" and event["uav"] is not None:
                why = str(event["text"]).removeprefix(AIRCRAFT_LOST)
                found.setdefault(int(event["uav"]), (float(event["t"]), why))
        return found

    @functools.cached_property
    def verdict(self) -> Verdict:
        """How the flight went, from the recording."""
        from ftcc.groundside.verdict import judge

        return judge(self, self.mission, self.lost)

    @property
    def end(self) -> float:
        """Time of the last recorded row, s."""
        return max(float(self.column("t", uav)[-1]) for uav in self.uavs)

    @property
    def file(self) -> Path:
        """``signals.parquet``, merged from the parts if it is missing or older than they are."""
        return up_to_date_table(self.path)

    @functools.cached_property
    def signals(self) -> Any:
        """The recording as a ``pyarrow.Table``: a row per recorded tick and UAV; units in the columns' metadata.

        The whole table is in memory; for a long flight, read one `column` after the other.
        """
        return self._columns.read_all()

    def to_arrow(self) -> Any:
        """All columns as a ``pyarrow.Table``: `signals`."""
        return self.signals

    @property
    def columns(self) -> dict[str, Column]:
        """Name, unit and meaning of every column."""
        return self._columns.columns

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self.columns)

    @property
    def uavs(self) -> tuple[int, ...]:
        """Ids of the UAVs that have rows."""
        return self._columns.uavs

    def column(self, name: str, uav: int) -> NDArray[np.float64]:
        """A column of one UAV in order of time; empty if the UAV has no rows.

        Columns used lately stay in memory, up to a limit.

        Raises
        ------
        RunError
            If there is no such column.
        """
        return self._columns.column(name, uav)

    def blocks(self) -> Iterator[dict[str, NDArray[Any]]]:
        """All columns by name, block by block in order of time, then UAV: a long flight takes no more memory."""
        return self._columns.blocks()

    def merge(self) -> Path:
        """Merge the processes' parts into ``signals.parquet``; a killed process counts up to its last complete batch.

        Rows are joined on time and UAV. A value that a UAV's process did not write is nan.

        Raises
        ------
        RunError
            If no process wrote anything: `NothingRecordedError`.
        """
        return merge_run(self.path)

    @functools.cached_property
    def network(self) -> list[dict[str, Any]]:
        """What the network between computers did to the mesh, about a row per link and second of wall time.

        Empty where all processes ran on one computer. See `ftcc.link.gate.NetworkReport`.
        """
        path = self.path / NETWORK_FILE
        return read_lines(path) if path.is_file() else []

    @functools.cached_property
    def lies(self) -> dict[str, NDArray[Any]]:
        """What UAVs that lied told their neighbours, and what was true: a row per false record, by time.

        Columns: t (s), uav (whose record it is), receiver (who alone heard the lie; 0: everybody), then ``true_X`` and
        ``told_X`` of every quantity X that UAVs share; nan: this one shares none. Empty where nobody lied.
        """
        return read_lies(self.path, self.mission.lie_columns)

    @functools.cached_property
    def links(self) -> dict[str, NDArray[Any]]:
        """The UAVs' reports on their in-edges, a row per edge and second: the columns of ``LINK_COLUMNS``."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        path = self.path / "links.parquet"
        if path.is_file():
            table = pq.read_table(path)
        else:
            read = (read_part(part) for part in sorted((self.path / "parts").glob("*-links.arrows")))
            tables = [table for table in read if table is not None]
            table = pa.concat_tables(tables) if tables else arrow_schema(LINK_COLUMNS).empty_table()
            table = table.sort_by([("t", "ascending"), ("uav", "ascending"), ("sender", "ascending")])
        return {name: table.column(name).to_numpy() for name in table.column_names}
