"""Joins the parts that the processes of a swarm wrote into one table, block by block, in bounded memory."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.results.folders import NothingRecordedError
from ftcc.groundside.results.table import TableWriter
from ftcc.link.recording import Column

__all__ = ["merge_parts", "merge_run", "up_to_date_table"]

_BLOCK = 65536
"""Rows of all UAVs that are joined at a time."""


def up_to_date_table(run: Path) -> Path:
    """``signals.parquet`` in a run's folder, merged from the parts if it is missing or older than they are.

    Raises
    ------
    NothingRecordedError
        If no process wrote anything.
    """
    path = run / "signals.parquet"
    merged = path.is_file() and path.stat().st_mtime_ns >= _last_write(run)
    return path if merged else merge_run(run)


def merge_run(run: Path) -> Path:
    """Merge the parts in a run's folder into its ``signals.parquet``.

    Raises
    ------
    NothingRecordedError
        If no process wrote anything.
    """
    # Read before the parts: if they grow during the merge, the table is out of date.
    as_of = _last_write(run)
    target = run / "signals.parquet"
    if not merge_parts(run / "parts", target, as_of):
        raise NothingRecordedError(f"{run}: nothing was recorded")
    return target


def _last_write(run: Path) -> int:
    """When a process last wrote a part, ns; 0 without parts."""
    return max((part.stat().st_mtime_ns for part in (run / "parts").glob("*.arrows")), default=0)


class _Part:
    """A part of the recording, read batch by batch up to the last complete batch; closed between reads."""

    def __init__(self, path: Path) -> None:
        import pyarrow as pa

        self._path = path
        self.uav = int(path.name.split("-")[0])
        self.is_autopilot = path.stem.endswith("autopilot")
        self.ended = False
        self._batches: list[Any] = []
        self._rows = 0
        with path.open("rb") as file:
            self.schema = pa.ipc.open_stream(file).schema
            self._at = file.tell()

    def fill(self, rows: int) -> None:
        """Read until ``rows`` rows are in memory, or the part ends."""
        import pyarrow as pa

        if self._rows >= rows or self.ended:
            return
        with self._path.open("rb") as file:
            file.seek(self._at)
            messages = pa.ipc.MessageReader.open_stream(file)
            while self._rows < rows and not self.ended:
                try:
                    batch = pa.ipc.read_record_batch(messages.read_next_message(), self.schema)
                except (StopIteration, pa.ArrowInvalid, OSError, EOFError):
                    # The end, or an incomplete batch: its writer was killed.
                    self.ended = True
                else:
                    self._at = file.tell()
                    self._batches.append(batch)
                    self._rows += len(batch)

    @property
    def until(self) -> float:
        """Time up to which rows are in memory, s."""
        return math.inf if self.ended else float(self._batches[-1].column("t")[-1].as_py())

    def take(self, until: float) -> Any:
        """Remove the rows up to ``until`` (s) from memory and return them, as a ``pyarrow.Table``."""
        import pyarrow as pa

        table = pa.Table.from_batches(self._batches, schema=self.schema)
        count = int(np.searchsorted(table.column("t").to_numpy(), until, side="right"))
        rest = table.slice(count)
        self._batches, self._rows = rest.to_batches(), len(rest)
        return table.slice(0, count)


def merge_parts(folder: Path, target: Path, as_of: int) -> bool:
    """Join the parts in ``folder`` on time and UAV, and write them into ``target``; return False if there is no row.

    A value that a UAV's process did not write is nan.

    Parameters
    ----------
    folder : Path
    target : Path
    as_of : int
        Modification time of the file, ns.
    """
    import pyarrow as pa

    parts = []
    for path in sorted(folder.glob("*.arrows")):
        if not path.stem.endswith(("-links", "-lies")):
            try:
                parts.append(_Part(path))
            except (pa.ArrowInvalid, OSError, EOFError):
                continue  # no schema: the process was killed at its start
    # Each vehicle's part first: its columns come first.
    parts.sort(key=lambda part: (part.uav, part.is_autopilot))
    columns = [
        Column(f.name, f.metadata[b"unit"].decode(), f.metadata[b"meaning"].decode())
        for part in sorted(parts, key=lambda part: part.is_autopilot)
        for f in part.schema
    ]
    blocks = _blocks(parts, [column.name for column in columns])
    first = next(blocks, None)
    if first is None:
        return False
    with TableWriter(target, columns, as_of) as table:
        table.write(first)
        for block in blocks:
            table.write(block)
    return True


def _blocks(parts: Sequence[_Part], names: Sequence[str]) -> Iterator[dict[str, NDArray[Any]]]:
    """Yield all rows in order of time, then UAV, block by block."""
    uavs = sorted({part.uav for part in parts})
    while parts and not all(part.ended for part in parts):
        for part in parts:
            part.fill(max(1, _BLOCK // len(uavs)))
        until = min(part.until for part in parts)
        tables = {uav: [part.take(until) for part in parts if part.uav == uav] for uav in uavs}
        joined = [_join(uav, tables[uav], names) for uav in uavs]
        values = {name: np.concatenate([one[name] for one in joined]) for name in joined[0]}
        if len(values["t"]):
            order = np.lexsort((values["uav"], values["t"]))
            yield {name: column[order] for name, column in values.items()}


def _join(uav: int, tables: Sequence[Any], names: Sequence[str]) -> dict[str, NDArray[Any]]:
    """Join the parts of one UAV: a row for every time in any part."""
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
