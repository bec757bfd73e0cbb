"""The recording row by row in order of time, for logs that hold one message after the other."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.results.run import Run

__all__ = ["columns_by_uav", "nanoseconds", "recorded_rows"]


def columns_by_uav(run: Run) -> dict[int, tuple[str, ...]]:
    """Return the columns in which each UAV recorded a number, by its id: a leader has none of a law."""
    names = [name for name in run.names if name not in ("t", "uav")]
    kept: dict[int, list[str]] = {uav: [] for uav in run.uavs}
    for name in names:
        for uav in run.uavs:
            if np.isfinite(run.column(name, uav)).any():
                kept[uav].append(name)
    return {uav: tuple(columns) for uav, columns in kept.items()}


def recorded_rows(run: Run, columns: dict[int, tuple[str, ...]]) -> Iterator[tuple[float, int, NDArray[np.float64]]]:
    """Yield time (s), UAV and the values of its ``columns`` for every recorded row, by time, then UAV."""
    for block in run.blocks():
        names = [name for name in block if name not in ("t", "uav")]
        values = np.column_stack([block[name] for name in names])
        places = {uav: [names.index(name) for name in kept] for uav, kept in columns.items()}
        for t, uav, row in zip(block["t"].tolist(), block["uav"].tolist(), values, strict=True):
            yield t, uav, row[places[uav]]


def nanoseconds(run: Run, t: float) -> int:
    """Return the Unix time (ns) of the simulated time ``t`` (s)."""
    return round(run.started * 1e9) + round(t * 1e9)
