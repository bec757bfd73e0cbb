"""``signals.parquet``: which columns come first, and how it is written."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from ftcc.link.recording import Column, arrow_schema
from ftcc.sim.plant import TRUTH

__all__ = ["LEADING", "leading", "write_table"]

_SHOWN = ("thrust", "elevator", "aileron", "rudder", "load_factor", "bank")

LEADING = ("t", "uav", *TRUTH, *(f"{name}_command" for name in _SHOWN), *_SHOWN)
"""The first columns of ``signals.parquet``, of all plants; the scheme's SIGNALS follow."""


def leading(actuators: Collection[str]) -> list[str]:
    """Those of an aircraft with these actuators."""
    lacking = {name for name in _SHOWN if name not in actuators}
    return [name for name in LEADING if name.removesuffix("_command") not in lacking]


def _ordered(columns: Sequence[Column]) -> list[Column]:
    """Columns without repetition, the leading ones first."""
    unique = {column.name: column for column in reversed(columns)}
    first = [unique[name] for name in LEADING if name in unique]
    rest = [column for column in dict.fromkeys(unique[c.name] for c in columns) if column.name not in LEADING]
    return first + rest


def write_table(
    path: Path, columns: Sequence[Column], values: Mapping[str, NDArray[Any]], as_of: int | None = None
) -> None:
    """Write a table: a Parquet file that appears when it is complete.

    Parameters
    ----------
    path : Path
    columns : sequence of Column
        Of all parts, repetitions allowed.
    values : mapping of arrays by column name, one row per tick and UAV.
    as_of : int, optional
        The file's time of change, ns; default: now.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    ordered = _ordered(columns)
    table = pa.Table.from_arrays([pa.array(values[c.name]) for c in ordered], schema=arrow_schema(ordered))
    unfinished = path.with_suffix(f".{os.getpid()}")
    pq.write_table(table, unfinished, use_dictionary=False, compression="lz4", write_statistics=["t", "uav"])
    if as_of is not None:
        os.utime(unfinished, ns=(as_of, as_of))
    unfinished.replace(path)
