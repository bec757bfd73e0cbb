"""Events that compiled functions note, in a short list that their caller drains."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.link.compiled import compiled, store

__all__ = ["CAPACITY", "EventList", "drain_events", "new_events", "note"]

CAPACITY = 1024
"""Rows of a list."""


class EventRow(NamedTuple):
    """Columns of ``EventList.rows`` (integers)."""

    time_us: int
    """Simulated time, us."""
    uav: int
    """Index of the UAV in its process."""
    kind: int
    """What it is, a code of the module that notes it."""
    number: int
    """Which one of its kind: an obstacle, a trigger, a direction."""


class EventList(NamedTuple):
    """Events since the list was last drained, in order of time."""

    rows: NDArray[np.int64]
    """(n, 4): a row per event, see `EventRow`."""
    used: NDArray[np.int64]
    """(1,): rows in use."""


def new_events() -> EventList:
    """An empty list."""
    return EventList(np.zeros((CAPACITY, len(EventRow._fields)), np.int64), np.zeros(1, np.int64))


@compiled
def note(events, now_us, i, kind, number):
    """Append an event of UAV ``i`` (index) at ``now_us``; a full list keeps its first events and drops the new one."""
    n = events.used[0]
    if n < events.rows.shape[0]:
        store(EventRow(now_us, i, kind, number), events.rows[n])
        events.used[0] = n + 1


def drain_events(events: EventList) -> list[tuple[int, ...]]:
    """Return all events, a tuple in the order of `EventRow` each, and empty the list."""
    rows = [tuple(row) for row in events.rows[: events.used[0]].tolist()]
    events.used[0] = 0
    return rows
