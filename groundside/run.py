"""A run's folder: what was flown, what happened, and the recording.

``scenario.toml`` (as flown), ``parts/`` (what each process wrote), ``events.jsonl``, ``signals.parquet``, ``report/``.
"""

from __future__ import annotations

import contextlib
import functools
import itertools
import os
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.errors import UserError
from ftcc.groundside.sole_writer import keep
from ftcc.groundside.table import write_table
from ftcc.link.recording import AIRCRAFT_LOST, LINK_COLUMNS, Column, arrow_schema, read_events, read_part

if TYPE_CHECKING:
    from ftcc.groundside.mission import Mission
    from ftcc.groundside.scenario import Scenario
    from ftcc.groundside.verdict import Verdict

__all__ = ["NothingRecordedError", "Run", "RunError", "new_folder"]


class RunError(UserError):
    """A folder that is no run, or a run that cannot be read."""


_HELD = ("scenario.toml", "study.parquet")
"""What shows that a folder has a run or a study in it."""


def new_folder(name: str, out: str | Path | None = None, kind: str = "runs") -> Path:
    """Create the folder of a new run: ``out``, or ``runs/<name>-<time>`` in the present folder.

    No other process gets it before this one ends.

    Parameters
    ----------
    name : str
    out : Path, optional
    kind : str
        Instead of ``runs``.

    Raises
    ------
    RunError
        If it cannot be written, or ``out`` already holds a run or a study.
    BusyFolderError
        If another process writes into it.
    """
    folder = Path(kind) if out is None else Path(out)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK | os.X_OK):
            raise PermissionError(f"no permission to write into {folder}")
        if out is None:
            folder = _first_free(folder / f"{name}-{datetime.now():%Y%m%d-%H%M%S}")
        keep(folder)
        held = [file for file in _HELD if (folder / file).exists()]
    except OSError as error:
        instead = "; name a folder that can be with --out" if out is None else ""
        option = "" if out is None else "--out "
        raise RunError(f"{option}{folder}: cannot be written: {error.strerror or error}{instead}") from None
    if held:
        raise RunError(f"--out {folder}: already holds {held[0]}; give a folder that is empty or does not exist")
    return folder


def _first_free(stem: Path) -> Path:
    """Create the folder, or, where there is one already, that with the first free number."""
    for n in itertools.count(2):
        folder = stem if n == 2 else stem.with_name(f"{stem.name}-{n - 1}")
        with contextlib.suppress(FileExistsError):
            folder.mkdir()
            return folder
    raise AssertionError("numbers do not end")


class NothingRecordedError(RunError):
    """A run that ended before anything was recorded."""


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
        if not (self.path / "scenario.toml").is_file():
            raise RunError(f"{self.path}: is no run's folder (there is no scenario.toml in it)")

    @functools.cached_property
    def scenario(self) -> Scenario:
        """The scenario as flown."""
        from ftcc.groundside.scenario import load

        return load(self.path / "scenario.toml")

    @functools.cached_property
    def mission(self) -> Mission:
        """The scenario resolved: graph, scheme, timing, claims."""
        from ftcc.groundside.mission import resolve

        return resolve(self.scenario)

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
        """The recording as a ``pyarrow.Table``: a row per recorded tick and UAV; units in the columns' metadata."""
        return self._table(None)

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
    def _rows(self) -> tuple[NDArray[np.int64], dict[int, slice]]:
        """Order that sorts the rows by UAV, and where each UAV's rows then are."""
        uavs = self._read("uav")
        order = np.argsort(uavs, kind="stable")
        ids, starts = np.unique(uavs[order], return_index=True)
        ends = np.append(starts[1:], len(uavs))
        return order, {int(uav): slice(int(a), int(b)) for uav, a, b in zip(ids, starts, ends, strict=True)}

    def _read(self, name: str) -> NDArray[Any]:
        if name not in self.columns:
            raise RunError(f"{self.path}: there is no column {name!r}; there are {', '.join(self.columns)}")
        return self._table([name]).column(0).to_numpy()  # type: ignore[no-any-return]

    def _table(self, names: list[str] | None) -> Any:
        """Columns of the recording, or all."""
        return self._readable(lambda: self._open.read(columns=names))

    def _readable(self, read: Callable[[], Any]) -> Any:
        """What ``read`` gives, or a message that says which file is damaged and what may help."""
        import pyarrow as pa

        try:
            return read()
        except (pa.ArrowInvalid, pa.ArrowException, OSError) as error:
            what = str(error).splitlines()[0]
            raise RunError(
                f"{self.path / 'signals.parquet'}: cannot be read ({what}); a run with parts/ is merged anew without it"
            ) from None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self.columns)

    @property
    def uavs(self) -> tuple[int, ...]:
        """Ids of those of whom there are rows."""
        return tuple(self._rows[1])

    @functools.cache  # noqa: B019 (a run is short-lived, its columns are read again and again)
    def _sorted(self, name: str) -> NDArray[Any]:
        return self._read(name)[self._rows[0]]  # type: ignore[no-any-return]

    def column(self, name: str, uav: int) -> NDArray[np.float64]:
        """A column of one UAV in order of time; empty if the UAV has no rows."""
        place = self._rows[1].get(uav)
        return self._sorted(name)[place] if place is not None else np.empty(0)

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
        tables: dict[int, list[Any]] = {}
        for path in sorted((self.path / "parts").glob("*.arrows")):
            table = read_part(path) if not path.stem.endswith("-links") else None
            if table is not None:
                # The vehicle's part first: its columns lead.
                tables.setdefault(int(path.name.split("-")[0]), []).append((path.stem.endswith("autopilot"), table))
        if not any(table.num_rows for pairs in tables.values() for _, table in pairs):
            raise NothingRecordedError(f"{self.path}: nothing was recorded")
        parts = {uav: [table for _, table in sorted(pairs, key=lambda p: p[0])] for uav, pairs in tables.items()}
        columns = [
            Column(f.name, f.metadata[b"unit"].decode(), f.metadata[b"meaning"].decode())
            for after in (False, True)
            for pairs in tables.values()
            for autopilot, table in pairs
            if autopilot == after
            for f in table.schema
        ]
        joined = [_joined(uav, parts[uav], [c.name for c in columns]) for uav in sorted(parts)]
        values = {name: np.concatenate([one[name] for one in joined]) for name in joined[0]}
        order = np.lexsort((values["uav"], values["t"]))
        target = self.path / "signals.parquet"
        write_table(target, columns, {name: column[order] for name, column in values.items()}, as_of)
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

    def export_csv(self, file: Path) -> None:
        """Write the recording as comma-separated values, names in the first line."""
        import pyarrow.csv as pc

        pc.write_csv(self.signals, file)

    def export_mat(self, file: Path) -> None:
        """Write the recording for MATLAB: a struct ``uavN`` per UAV with a field per column, and a struct ``units``."""
        from scipy.io import savemat

        contents: dict[str, Any] = {
            f"uav{uav}": {name: self.column(name, uav) for name in self.names if name != "uav"} for uav in self.uavs
        }
        contents["units"] = {column.name: column.unit for column in self.columns.values() if column.name != "uav"}
        savemat(file, contents, do_compression=True, oned_as="column")


def _joined(uav: int, tables: Sequence[Any], names: Sequence[str]) -> dict[str, NDArray[Any]]:
    """The parts of one UAV side by side, a row for every time that occurs."""
    times = [table.column("t").to_numpy() for table in tables]
    t = np.unique(np.concatenate(times))
    joined: dict[str, NDArray[Any]] = {name: np.full(len(t), np.nan) for name in names}
    joined["t"], joined["uav"] = t, np.full(len(t), uav, np.int32)
    for table, own in zip(tables, times, strict=True):
        rows = np.searchsorted(t, own)
        for name in table.column_names:
            if name not in ("t", "uav"):
                joined[name][rows] = table.column(name).to_numpy()
    return joined
