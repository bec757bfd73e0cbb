"""What each process writes while it flies: its part of the recording and the log of events.

A part is an Arrow IPC stream: readable to its last batch after ``kill -9``, unlike a Parquet file.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.link.compiled import compiled

__all__ = [
    "AIRCRAFT_LOST",
    "LINK_COLUMNS",
    "NETWORK_FILE",
    "ROWS",
    "SCHEMA_VERSION",
    "Column",
    "EventLog",
    "PartWriter",
    "Recorder",
    "Rows",
    "arrow_schema",
    "is_full",
    "new_rows",
    "part_path",
    "read_events",
    "read_part",
]

SCHEMA_VERSION = 1
"""Of parts, merged tables and event logs."""

ROWS = 500
"""Rows in a record batch: 5 s at 100 Hz is what a killed process loses at most."""

_SPARE = 256
"""Further rows, so that one tick always fits: one for each possible in-neighbour."""
_FLUSH = 0.9
"""Wall time after which rows are written although there is room for more, s."""

NETWORK_FILE = "network.jsonl"
"""Of a run on several computers: what the network between them did to the mesh, a JSON object a line."""
AIRCRAFT_LOST = "aircraft lost: "
"""How the text of an event begins that reports why a UAV was lost."""

_INTEGERS = ("uav", "sender", "receiver")


class Column(NamedTuple):
    """A column of a recording."""

    name: str
    unit: str
    meaning: str = ""


LINK_COLUMNS = (
    Column("t", "s", "simulated time"),
    Column("uav", "-", "id of the receiver"),
    Column("sender", "-", "id of the sender"),
    Column("sent", "-", "records that the sender sent so far"),
    Column("received", "-", "records that came so far"),
    Column("lost", "-", "records that the channel lost so far"),
    Column("age", "s", "mean age of what was heard last, since the row before"),
    Column("oldest", "s", "greatest age of what was heard last, since the row before"),
    Column("trust", "-", "share of its weight that the receiver's defences leave the sender; 1: not doubted"),
)
"""Of the links' part of the recording: a row per in-edge and second."""


def part_path(folder: Path, uav: int, role: str) -> Path:
    """The file for a UAV's ``role``: "vehicle", "autopilot", "links" or "lies"."""
    return Path(folder) / "parts" / f"{uav}-{role}.arrows"


def arrow_schema(columns: Iterable[Column], metadata: Mapping[str, str] | None = None) -> Any:
    """Arrow schema with unit and meaning of each column and the schema version: ``uav`` int32, all else float64."""
    import pyarrow as pa

    fields = [
        pa.field(
            column.name,
            pa.int32() if column.name in _INTEGERS else pa.float64(),
            nullable=False,
            metadata={"unit": column.unit, "meaning": column.meaning},
        )
        for column in columns
    ]
    return pa.schema(fields, metadata={"ftcc.schema": str(SCHEMA_VERSION), **(metadata or {})})


class Rows(NamedTuple):
    """Rows that the k UAVs of a process have filled and that are not written yet."""

    values: NDArray[np.float64]
    """(k, ROWS and some spare ones, c)."""
    filled: NDArray[np.int64]
    """(k,): rows in use."""


@compiled
def is_full(rows):
    """Whether a UAV has filled its rows: they must be written before the next tick."""
    most = 0
    for i in range(rows.filled.shape[0]):
        most = max(most, rows.filled[i])
    return most >= ROWS


def new_rows(uavs: int, columns: int) -> Rows:
    """Room for `ROWS` rows of each UAV and those that a tick adds, empty."""
    return Rows(np.zeros((uavs, ROWS + _SPARE, columns)), np.zeros(uavs, np.int64))


class PartWriter:
    """Appends rows to an Arrow IPC stream, a batch at a time.

    Parameters
    ----------
    path : Path
        File to write; its folder is created.
    columns : sequence of Column
    """

    def __init__(self, path: Path, columns: Sequence[Column]) -> None:
        import pyarrow as pa  # slow to load, and not needed where nothing is recorded

        self._pa = pa
        self.path = Path(path)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.columns = tuple(columns)
        self._schema = arrow_schema(self.columns)
        self._integer = [column.name in _INTEGERS for column in self.columns]
        self._file = self.path.open("wb", buffering=0)
        self._stream = pa.ipc.new_stream(self._file, self._schema)

    def write(self, rows: NDArray[np.float64]) -> None:
        """Write rows (n, c), in the order of the columns, as one batch."""
        if not len(rows):
            return
        arrays = [
            self._pa.array(rows[:, n].astype(np.int32) if integer else np.ascontiguousarray(rows[:, n]))
            for n, integer in enumerate(self._integer)
        ]
        self._stream.write_batch(self._pa.RecordBatch.from_arrays(arrays, schema=self._schema))

    def close(self) -> None:
        """End the stream; may be called twice."""
        if self._file.closed:
            return
        self._stream.close()
        self._file.close()


class Recorder:
    """The parts of the recording of a process's UAVs, each written from its `Rows`.

    Parameters
    ----------
    paths : the file of each UAV; None: it is not recorded.
    columns : of all of them.
    places : where each column stands in a row, ascending, the last one at its end; by default one after the other.
    on_trouble : called with the reason when a part cannot be written any further: it ends there, the flight goes on.
    """

    def __init__(
        self,
        paths: Sequence[Path | None],
        columns: Sequence[Column],
        places: Sequence[int] | None = None,
        *,
        on_trouble: Callable[[str], None],
    ) -> None:
        self._on_trouble = on_trouble
        self._places = list(range(len(columns)) if places is None else places)
        self.rows = new_rows(len(paths), self._places[-1] + 1)
        self._parts = {i: PartWriter(path, columns) for i, path in enumerate(paths) if path is not None}
        self._written = time.monotonic()

    def write(self) -> None:
        """Write all rows that have been filled."""
        self._written = time.monotonic()
        for i, part in tuple(self._parts.items()):
            try:
                part.write(self.rows.values[i, : self.rows.filled[i]][:, self._places])
            except OSError as error:
                self._give_up(i, error)
        self.rows.filled[:] = 0

    def _give_up(self, i: int, error: OSError) -> None:
        """Stop writing; readers of the part stop at its last complete batch."""
        path = self._parts.pop(i).path
        self._on_trouble(f"{path.name} is not written any further: {error.strerror or error}")

    def write_if_due(self) -> None:
        """Write the rows that have waited for about a second of wall time.

        Call it at the same ticks in all processes: then both parts of a UAV end at the same instant, while the swarm
        flies no faster than the clock.
        """
        if time.monotonic() - self._written > _FLUSH:
            self.write()

    def close(self) -> None:
        """Write the rest and end the files."""
        self.write()
        for i, part in tuple(self._parts.items()):
            try:
                part.close()
            except OSError as error:
                self._give_up(i, error)


def read_part(path: Path) -> Any:
    """The part as a ``pyarrow.Table`` up to the last batch that is whole; None if there is not even a schema."""
    import pyarrow as pa

    batches = []
    with open(path, "rb") as file:
        try:
            stream = pa.ipc.open_stream(file)
        except (pa.ArrowInvalid, OSError, EOFError):
            return None
        whole = True
        while whole:
            try:
                batches.append(stream.read_next_batch())
            except (StopIteration, pa.ArrowInvalid, OSError, EOFError):
                # The end, or a batch cut off when the writer was killed.
                whole = False
        return pa.Table.from_batches(batches, schema=stream.schema)


class EventLog:
    """Appends events to a file, a JSON object a line, each written through at once."""

    trouble = ""
    """Why events could not be written; empty where all are."""

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._file = self.path.open("a", encoding="utf-8", buffering=1)

    def write(self, t: float, text: str, uav: int | None = None, severity: str = "info", **more: Any) -> None:
        """Append an event at simulated time ``t`` (s); ``severity`` is "info", "warning" or "error"."""
        event = {"schema": SCHEMA_VERSION, "t": t, "uav": uav, "severity": severity, "text": text}
        event |= {"wall": round(time.time(), 3), **more}
        try:
            self._file.write(json.dumps(event) + "\n")
        except OSError as error:
            self.trouble = error.strerror or str(error)

    def close(self) -> None:
        """Close the file."""
        try:
            self._file.close()
        except OSError as error:
            self.trouble = error.strerror or str(error)


def read_events(path: Path) -> list[dict[str, Any]]:
    """The events of a log in order of simulated time; an incomplete last line is left out."""
    return read_lines(path) if Path(path).exists() else []


def read_lines(path: Path) -> list[dict[str, Any]]:
    """The objects of a file with a JSON object a line, in order of their ``t``; an incomplete last line is left out."""
    found = []
    for line in Path(path).read_text(encoding="utf-8").splitlines():
        try:
            one = json.loads(line)
        except json.JSONDecodeError:
            continue
        if "t" in one:
            found.append(one)
    return sorted(found, key=lambda one: float(one["t"]))
