"""``signals.parquet`` read column by column: a long flight takes no more memory than a short one."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.results.folders import RunError
from ftcc.groundside.results.merging import up_to_date_table
from ftcc.link.recording import Column

__all__ = ["ColumnReader"]

_MEMORY = 128 << 20
"""Bytes of columns that a reader keeps in memory."""


class ColumnReader:
    """The columns of a recording, read when they are first needed.

    Parameters
    ----------
    run : Path
        The run's folder; its parts are merged at the first access if that is necessary.
    """

    def __init__(self, run: Path) -> None:
        self._run = run
        self._cache: dict[tuple[str, int], NDArray[Any]] = {}
        """Columns by name and UAV, the latest use last."""
        self._cached_bytes = 0
        """Bytes of these columns."""

    def read_all(self) -> Any:
        """The whole recording as a ``pyarrow.Table``."""
        return self._readable(self._open.read)

    @functools.cached_property
    def _open(self) -> Any:
        """The file, kept open: a run in progress may be merged again, but this reader shows one state of it."""
        import pyarrow.parquet as pq

        return self._readable(lambda: pq.ParquetFile(up_to_date_table(self._run)))

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
        """Number of rows of each UAV, by id, ascending."""
        rows: dict[int, int] = {}
        for group in range(self._open.num_row_groups):
            for uav, count in zip(*np.unique(self._group(group, ["uav"])[0], return_counts=True), strict=True):
                rows[int(uav)] = rows.get(int(uav), 0) + int(count)
        return dict(sorted(rows.items()))

    def blocks(self) -> Iterator[dict[str, NDArray[Any]]]:
        """All columns by name, block by block in order of time, then UAV: a long flight takes no more memory."""
        names = list(self.columns)
        for group in range(self._open.num_row_groups):
            yield dict(zip(names, self._group(group, names), strict=True))

    def _group(self, group: int, names: list[str]) -> list[NDArray[Any]]:
        """Read columns of one row group, for all UAVs together."""
        table = self._readable(lambda: self._open.read_row_group(group, columns=names))
        return [table.column(name).to_numpy() for name in names]

    def _read(self, name: str, uavs: Sequence[int]) -> dict[int, NDArray[Any]]:
        """Read a column of some UAVs, each in order of time. At most one row group of other UAVs is in memory."""
        found = {
            uav: np.empty(self._rows[uav], self._open.schema_arrow.field(name).type.to_pandas_dtype()) for uav in uavs
        }
        filled = dict.fromkeys(uavs, 0)
        all_uavs = np.array(list(self._rows))
        k = len(all_uavs)
        for group in range(self._open.num_row_groups):
            values, whose = self._group(group, [name, "uav"])
            if len(whose) % k == 0 and (whose.reshape(-1, k) == all_uavs).all():
                # The usual case: every UAV has a row at every time.
                parts = [values[n::k] for n in range(k)]
            else:
                order = np.argsort(whose, kind="stable")
                parts = np.split(values[order], np.searchsorted(whose[order], all_uavs[1:]))
            for uav, part in zip(self._rows, parts, strict=True):
                if uav in found:
                    found[uav][filled[uav] : filled[uav] + len(part)] = part
                    filled[uav] += len(part)
        return found

    def _readable(self, read: Callable[[], Any]) -> Any:
        """Return what ``read`` returns; raise `RunError`, which names the damaged file, if it fails."""
        import pyarrow as pa

        try:
            return read()
        except (pa.ArrowInvalid, pa.ArrowException, OSError) as error:
            what = str(error).splitlines()[0]
            raise RunError(
                f"{self._run / 'signals.parquet'}: cannot be read ({what}); a run with parts/ merges again without it"
            ) from None

    @property
    def uavs(self) -> tuple[int, ...]:
        """Ids of the UAVs that have rows."""
        return tuple(self._rows)

    def column(self, name: str, uav: int) -> NDArray[np.float64]:
        """A column of one UAV in order of time; empty if the UAV has no rows.

        Columns used lately stay in memory, up to a limit.
        """
        if name not in self.columns:
            raise RunError(f"{self._run}: there is no column {name!r}; there are {', '.join(self.columns)}")
        if uav not in self._rows:
            return np.empty(0)
        if (name, uav) not in self._cache:
            # In a short flight, read all UAVs: they are needed next. In a long one they do not fit.
            small = 8 * self._open.metadata.num_rows <= _MEMORY / 4
            for one, values in self._read(name, list(self._rows) if small else [uav]).items():
                self._cache[name, one] = values
                self._cached_bytes += values.nbytes
        found = self._cache[name, uav] = self._cache.pop((name, uav))
        while self._cached_bytes > _MEMORY and len(self._cache) > 1:
            self._cached_bytes -= self._cache.pop(next(iter(self._cache))).nbytes
        return found
