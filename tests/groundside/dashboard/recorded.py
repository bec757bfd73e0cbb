"""Record a dashboard of the synthetic swarm, and read the recording back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ftcc.groundside.dashboard import Dashboard
from tests.groundside.dashboard.synthetic_swarm import SUBJECT
from tests.support import rrd

DURATION = 32.0
"""Of the flight in the fixture ``recording``, s."""


def make(recording: Path | None, viewer: Any = "none", **others: Any) -> Dashboard:
    return Dashboard(SUBJECT, recording=recording, viewer=viewer, **others)


def rows(path: Path, entity: str, component: str) -> tuple[np.ndarray, list[Any]]:
    """Times, s (nan where it holds always), and values of a component of an entity."""
    times: list[float] = []
    values: list[Any] = []
    for chunk in rrd.chunks(path):
        batch = chunk.to_record_batch()
        if str(chunk.entity_path) != entity or component not in batch.schema.names:
            continue
        some = batch[component].to_pylist()
        static = [np.nan] * len(some)
        some_times = static if chunk.is_static else [ns / 1e9 for ns in batch["t"].cast("int64").to_pylist()]
        for t, value in zip(some_times, some, strict=True):
            if value is not None:
                times.append(t)
                values.append(value)
    order = np.argsort(times, kind="stable")
    return np.array(times)[order], [values[i] for i in order]


def at(path: Path, entity: str, component: str, t: float) -> Any:
    """The value in force at ``t``."""
    times, values = rows(path, entity, component)
    return values[int(np.searchsorted(times, t + 1e-6)) - 1]
