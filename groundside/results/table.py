"""Writes ``signals.parquet``."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from ftcc.groundside.scenario import LEADING
from ftcc.link.recording import Column, arrow_schema

__all__ = ["TableWriter", "arrow_table"]


def _ordered(columns: Sequence[Column]) -> list[Column]:
    """Return the columns without repetition, the leading ones first."""
    unique = {column.name: column for column in reversed(columns)}
    first = [unique[name] for name in LEADING if name in unique]
    rest = [column for column in dict.fromkeys(unique[c.name] for c in columns) if column.name not in LEADING]
    return first + rest


def arrow_table(columns: Sequence[Column], values: Mapping[str, NDArray[Any]]) -> Any:
    """Return a ``pyarrow.Table`` as `TableWriter` writes it: units in the fields' metadata, the leading columns first.

    Parameters
    ----------
    columns : sequence of Column
        Repetitions are allowed.
    values : mapping
        An array by column name, one entry per tick and UAV.
    """
    import pyarrow as pa

    ordered = _ordered(columns)
    return pa.Table.from_arrays([pa.array(values[column.name]) for column in ordered], schema=arrow_schema(ordered))


class TableWriter:
    """Writes a table block by block, as a Parquet file that appears only when it is complete.

    Parameters
    ----------
    path : Path
    columns : sequence of Column
        The columns of all parts; repetitions are allowed.
    as_of : int, optional
        The file's modification time, ns; default: now.
    """

    def __init__(self, path: Path, columns: Sequence[Column], as_of: int | None = None) -> None:
        import pyarrow.parquet as pq

        self._path, self._as_of = path, as_of
        self._unfinished = path.with_suffix(f".{os.getpid()}")
        self._columns = _ordered(columns)
        options = {"use_dictionary": False, "compression": "lz4", "write_statistics": ["t", "uav"]}
        self._file = pq.ParquetWriter(self._unfinished, arrow_schema(self._columns), **options)

    def write(self, values: Mapping[str, NDArray[Any]]) -> None:
        """Append rows: an array by column name, one entry per tick and UAV."""
        self._file.write_table(arrow_table(self._columns, values))

    def __enter__(self) -> TableWriter:
        return self

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        try:
            self._file.close()
            if kind is None:
                if self._as_of is not None:
                    os.utime(self._unfinished, ns=(self._as_of, self._as_of))
                self._unfinished.replace(self._path)
        finally:
            self._unfinished.unlink(missing_ok=True)
