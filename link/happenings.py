"""What compiled functions have to tell people: a short list that whoever called them empties."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.link.compiled import compiled

__all__ = ["Happenings", "drained", "new_happenings", "note"]

_ROOM = 256


class Happenings(NamedTuple):
    """What happened since the list was last emptied, in order of time."""

    rows: NDArray[np.int64]
    """(n, 4): simulated time us, index of the UAV in its process, kind, number; the kinds belong to who notes them."""
    used: NDArray[np.int64]
    """(1,): rows in use."""


def new_happenings() -> Happenings:
    """An empty list."""
    return Happenings(np.zeros((_ROOM, 4), np.int64), np.zeros(1, np.int64))


@compiled
def note(happenings, now_us, i, kind, number):
    """Append what happened to UAV ``i``; a list that nobody empties keeps what came first."""
    n = happenings.used[0]
    if n < happenings.rows.shape[0]:
        happenings.rows[n, 0], happenings.rows[n, 1] = now_us, i
        happenings.rows[n, 2], happenings.rows[n, 3] = kind, number
        happenings.used[0] = n + 1


def drained(happenings: Happenings) -> list[tuple[int, ...]]:
    """All rows; the list is empty afterwards."""
    rows = [tuple(row) for row in happenings.rows[: happenings.used[0]].tolist()]
    happenings.used[0] = 0
    return rows
