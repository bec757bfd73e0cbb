"""A run's folder: what was flown, what happened, and the recording.

``scenario.toml`` (as flown), ``parts/`` (what each process wrote), ``events.jsonl``, ``signals.parquet``, ``report/``.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.results.folders import NothingRecordedError, RunError
from ftcc.groundside.results.merging import merge_parts
from ftcc.link.recording import AIRCRAFT_LOST, LINK_COLUMNS, Column, arrow_schema, read_events, read_part

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission, Scenario
    from ftcc.groundside.verdict import Verdict

__all__ = ["Run"]


_MEMORY = 128 << 20
"""Bytes of columns that a run keeps in memory."""


class Run:
    """A recorded flight; of one that goes on, what there was when it was first looked at.

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
        self._cache: dict[tuple[str, int], NDArray[Any]] = {}
        """Columns by name and UAV, what was asked for last at the end."""
        self._cached_bytes = 0
        """Bytes of them."""
        if not (self.path / "scenario.toml").is_file():
            raise RunError(f"{self.path}: is not the folder of a run (it contains no scenario.toml)")

    @functools.cached_property
    def scenario(self) -> Scenario:
        """The scenario as flown."""
        from ftcc.groundside.scenario import load

        return load(self.path / "scenario.toml")

    @functools.cached_property
    def mission(self) -> Mission:
        """The scenario resolved: graph, scheme, timing, claims."""
        from ftcc.groundside.scenario import resolve

        return resolve(self.scenario)

    @property
    def started(self) -> float:
        """Unix time (s) of simulated time 0 in exported tracks: when the run started, or a simulation was recorded; of
        a run of an earlier version, when its folder was begun.
        """
        flown = self.scenario.plan.flown
        if flown is not None and flown.run is not None:
            return flown.run.started.timestamp()
        return (self.path / "scenario.toml").stat().st_mtime

    @property
    def events(self) -> list[dict[str, Any]]:
        """What happened, in order of simulated time: t, uav, severity, text."""
        return read_events(self.path / "events.jsonl")

    @property
    def lost(self) -> dict[int, tuple[float, str]]:
        """UAVs that did not end the flight: when (s), and what the log says of them."""
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
        """``signals.parquet``, merged from the parts where there is none or they have grown since."""
        path = self.path / "signals.parquet"
        merged = path.is_file() and path.stat().st_mtime_ns >= self._recorded_until
        return path if merged else self.merge()

    @property
    def _recorded_until(self) -> int:
        """When a process last wrote a part, ns; 0 without parts."""
        return max((part.stat().st_mtime_ns for part in (self.path / "parts").glob("*.arrows")), default=0)

    @functools.cached_property
    def signals(self) -> Any:
        """The recording as a ``pyarrow.Table``: a row per recorded tick and UAV; units in the columns' metadata.

        All of it, in memory: of a long flight, ask for one `column` after the other.
        """
        return self._readable(self._open.read)

    @functools.cached_property
    def _open(self) -> Any:
        """The file, kept open: a run that goes on may be merged anew meanwhile, and this one shows one state of it."""
        import pyarrow.parquet as pq

        return self._readable(lambda: pq.ParquetFile(self.file))

    @functools.cached_property
    def columns(self) -> dict[str, Column]:
        """Name, unit and meaning of every column."""
        found = {}
        for field in self._open.schema_arrow:
            notes = {key.decode(): value.decode() for key, value in (field.metadata or {}).items()}
            found[field.name] = Column(field.name, notes.get("unit", ""), notes.get("meaning", ""))
        return found

    @functools.cached_property
    def _rows(self) -> dict[int, int]:
        """How many rows there are of each UAV, by id, ascending."""
        rows: dict[int, int] = {}
        for group in range(self._open.num_row_groups):
            for uav, count in zip(*np.unique(self._group(group, ["uav"])[0], return_counts=True), strict=True):
                rows[int(uav)] = rows.get(int(uav), 0) + int(count)
        return dict(sorted(rows.items()))

    def _group(self, group: int, names: list[str]) -> list[NDArray[Any]]:
        """Columns of a group of rows, all UAVs together."""
        table = self._readable(lambda: self._open.read_row_group(group, columns=names))
        return [table.column(name).to_numpy() for name in names]

    def _read(self, name: str, uavs: Sequence[int]) -> dict[int, NDArray[Any]]:
        """A column of some UAVs, each in order of time. No more than a group of rows is there of the others."""
        found = {
            uav: np.empty(self._rows[uav], self._open.schema_arrow.field(name).type.to_pandas_dtype()) for uav in uavs
        }
        filled = dict.fromkeys(uavs, 0)
        everybody = np.array(list(self._rows))
        k = len(everybody)
        for group in range(self._open.num_row_groups):
            values, whose = self._group(group, [name, "uav"])
            if len(whose) % k == 0 and (whose.reshape(-1, k) == everybody).all():
                # As it mostly is: everybody has a row at every time.
                parts = [values[n::k] for n in range(k)]
            else:
                order = np.argsort(whose, kind="stable")
                parts = np.split(values[order], np.searchsorted(whose[order], everybody[1:]))
            for uav, part in zip(self._rows, parts, strict=True):
                if uav in found:
                    found[uav][filled[uav] : filled[uav] + len(part)] = part
                    filled[uav] += len(part)
        return found

    def _readable(self, read: Callable[[], Any]) -> Any:
        """What ``read`` gives, or a message that says which file is damaged and what may help."""
        import pyarrow as pa

        try:
            return read()
        except (pa.ArrowInvalid, pa.ArrowException, OSError) as error:
            what = str(error).splitlines()[0]
            raise RunError(
                f"{self.path / 'signals.parquet'}: cannot be read ({what}); a run with parts/ merges again without it"
            ) from None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self.columns)

    @property
    def uavs(self) -> tuple[int, ...]:
        """Ids of those of whom there are rows."""
        return tuple(self._rows)

    def column(self, name: str, uav: int) -> NDArray[np.float64]:
        """A column of one UAV in order of time; empty if the UAV has no rows.

        What was asked for lately is kept in memory, up to a limit.
        """
        if name not in self.columns:
            raise RunError(f"{self.path}: there is no column {name!r}; there are {', '.join(self.columns)}")
        if uav not in self._rows:
            return np.empty(0)
        if (name, uav) not in self._cache:
            # Of a short flight, others will be asked for next; of a long one, there is no room for theirs.
            small = 8 * self._open.metadata.num_rows <= _MEMORY / 4
            for one, values in self._read(name, list(self._rows) if small else [uav]).items():
                self._cache[name, one] = values
                self._cached_bytes += values.nbytes
        found = self._cache[name, uav] = self._cache.pop((name, uav))
        while self._cached_bytes > _MEMORY and len(self._cache) > 1:
            self._cached_bytes -= self._cache.pop(next(iter(self._cache))).nbytes
        return found

    def merge(self) -> Path:
        """Join what the processes wrote into ``signals.parquet``; what a killed one wrote counts to its last batch.

        Rows are joined on time and UAV; where one of a UAV's two processes wrote nothing, the value is nan.

        Raises
        ------
        RunError
            If no process wrote anything: `NothingRecordedError`.
        """
        # Taken before the parts are read: what is written to them meanwhile makes the table old.
        as_of = self._recorded_until
        target = self.path / "signals.parquet"
        if not merge_parts(self.path / "parts", target, as_of):
            raise NothingRecordedError(f"{self.path}: nothing was recorded")
        return target

    @functools.cached_property
    def links(self) -> dict[str, NDArray[Any]]:
        """What the UAVs told of their in-edges, a row per edge and second: the columns of ``LINK_COLUMNS``."""
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
