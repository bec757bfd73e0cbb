"""What was true and what was told, of UAVs that lied to their neighbours: tables beside the recording."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ftcc.link.recording import Column, arrow_schema, read_part

__all__ = ["LIES_FILE", "in_order", "read_lies"]

LIES_FILE = "lies.parquet"
"""In the folder of a simulation; processes write parts."""

_INTEGERS = ("uav", "receiver")
_ORDER = ("t", "uav", "receiver")


def in_order(columns: Sequence[Column], rows: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
    """Return rows (n, c) as columns by name, in order of time, then UAV, then receiver."""
    rows = rows.reshape(-1, len(columns))
    rows = rows[np.lexsort((rows[:, 2], rows[:, 1], rows[:, 0]))]
    return {
        column.name: rows[:, n].astype(np.int32) if column.name in _INTEGERS else rows[:, n].copy()
        for n, column in enumerate(columns)
    }


def read_lies(folder: Path, columns: Sequence[Column]) -> dict[str, NDArray[Any]]:
    """Return the columns of a run's folder by name, in order; empty ones where nobody lied."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    if (folder / LIES_FILE).is_file():
        table = pq.read_table(folder / LIES_FILE)
    else:
        read = (read_part(part) for part in sorted((folder / "parts").glob("*-lies.arrows")))
        tables = [table for table in read if table is not None]
        table = pa.concat_tables(tables) if tables else arrow_schema(columns).empty_table()
    table = table.sort_by([(name, "ascending") for name in _ORDER])
    return {name: table.column(name).to_numpy() for name in table.column_names}
