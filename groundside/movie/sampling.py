"""A recording at the times of a film's frames."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["Recorded", "Sampled"]

Array = NDArray[np.float64]


class Recorded(Protocol):
    """What a film needs of a recording."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""

    @property
    def uavs(self) -> tuple[int, ...]:
        """Ids of the UAVs that have rows."""

    def column(self, name: str, uav: int) -> Array:
        """A column of one UAV in order of time."""


class Sampled:
    """Columns of all UAVs at given times; nan before a UAV's first row and after its last one.

    Parameters
    ----------
    recorded : Recorded
    uavs : sequence of int
        In this order they are the second axis of `column`.
    times : (n,) array
        s, ascending.
    """

    def __init__(self, recorded: Recorded, uavs: Sequence[int], times: Array) -> None:
        self._recorded = recorded
        self.uavs = tuple(uavs)
        self.times = times
        self._rows: dict[int, tuple[NDArray[np.intp], NDArray[np.bool_]]] = {}
        for uav in self.uavs:
            t = recorded.column("t", uav) if uav in recorded.uavs else np.empty(0)
            if len(t) == 0:
                continue
            spacing = float(t[1] - t[0]) if len(t) > 1 else 0.0
            rows = np.searchsorted(t, times + 1e-6, side="right") - 1
            self._rows[uav] = np.maximum(rows, 0), (rows >= 0) & (times <= t[-1] + 1.5 * spacing + 1e-6)

    def __len__(self) -> int:
        return len(self.times)

    def column(self, name: str) -> Array:
        """Return a column, shape (n, UAVs): the newest row at each time; all nan if it was not recorded."""
        values = np.full((len(self.times), len(self.uavs)), np.nan)
        if name in self._recorded.names:
            for i, uav in enumerate(self.uavs):
                if uav in self._rows:
                    rows, known = self._rows[uav]
                    values[known, i] = self._recorded.column(name, uav)[rows[known]]
        return values

    def faulty(self) -> NDArray[np.bool_]:
        """Return when which UAV has an actuator fault, shape (n, UAVs): less than whole effectiveness, or a bias."""
        faulty = np.zeros((len(self.times), len(self.uavs)), dtype=bool)
        for name in self._recorded.names:
            if name.endswith("_effectiveness"):
                faulty |= self.column(name) < 1.0
            elif name.endswith("_bias"):
                faulty |= np.nan_to_num(self.column(name)) != 0.0
        return faulty
