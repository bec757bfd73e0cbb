"""Parquet files that appear when they are whole; tables that grow by a file at a time."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = ["Parts", "write_parquet"]


def write_parquet(table: pa.Table, path: Path) -> Path:
    """Write a table into a file that is there when it is complete, and return its path."""
    import pyarrow.parquet as pq

    unfinished = path.with_suffix(".unfinished")
    try:
        pq.write_table(table, unfinished)
        unfinished.replace(path)
    except OSError:
        with contextlib.suppress(OSError):
            unfinished.unlink(missing_ok=True)
        raise
    return path


class Parts:
    """A folder ``flights/`` with a file for all rows that were written together."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / "flights"
        self._next: int | None = None
        """Number of the next file; None before this object has written one: who only reads changes nothing."""

    def append(self, table: pa.Table) -> None:
        """Write rows into a file of their own."""
        if self._next is None:
            self._next = self._prepare()
        write_parquet(table, self._folder / f"{self._next:06d}.parquet")
        self._next += 1

    def _prepare(self) -> int:
        """Create the folder, remove what an earlier process left unfinished, and return the number of the next file."""
        self._folder.mkdir(parents=True, exist_ok=True)
        for left in self._folder.glob("*.unfinished"):
            left.unlink()
        return max((int(path.stem) for path in self._folder.glob("*.parquet")), default=-1) + 1

    def read(self) -> list[pa.Table]:
        """Return the tables in the order in which they were written."""
        import pyarrow.parquet as pq

        return [pq.read_table(path) for path in sorted(self._folder.glob("*.parquet"))]
