"""Mark each aircraft by its health: a shape and a colour for each state, below the aircraft."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ftcc.groundside.dashboard.labels import HEALTH, health_of
from ftcc.groundside.dashboard.snapshot import Snapshot
from ftcc.groundside.dashboard.viewer import Entry
from ftcc.groundside.palette import HEALTH_COLORS

__all__ = ["HealthMarks"]

_ANGLES = np.linspace(0.0, 2.0 * np.pi, 13)
_RING = [(0.6 * np.sin(a), 0.6 * np.cos(a)) for a in _ANGLES]
_SHAPES = (
    _RING,
    [(-1.0, -0.8), (0.0, 1.0), (1.0, -0.8), (-1.0, -0.8)],
    [(-1.0, 0.0), (0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)],
    [(-1.0, -1.0), (1.0, 1.0), (0.0, 0.0), (-1.0, 1.0), (1.0, -1.0)],
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0)],
)
"""By state, east and up: ring, triangle, diamond, cross; and a square for a UAV that has left the swarm."""

MARKS_NOTE = "marks: health"


class HealthMarks:
    """Draws the marks of all UAVs as one entry.

    Parameters
    ----------
    path : str
        Of the entity.
    size : float
        Half width of a mark, m.
    below : float
        Distance between an aircraft and its mark, m.
    """

    def __init__(self, path: str, size: float, below: float) -> None:
        self._path = path
        self._shapes = [np.array([(size * x, 0.0, size * z - below) for x, z in shape]) for shape in _SHAPES]
        assert len(self._shapes) == len(HEALTH)
        self._shown: dict[int, int] = {}
        """State of each UAV that has a mark, as drawn."""

    def draw(self, snapshot: Snapshot, places: Mapping[int, NDArray[np.float64]], moving: bool = True) -> list[Entry]:
        """Return the marks at the ``places`` (east, north, up; m); with ``moving`` False only if a state changed."""
        states = {}
        for uav in places:
            state = snapshot.uavs.get(uav)
            health = None if state is None else health_of(state)
            if health is not None:
                states[uav] = health
        if states == self._shown and not (moving and states):
            return []
        strips = [self._shapes[health] + places[uav] for uav, health in states.items()]
        marks = rr.LineStrips3D.from_fields(strips=strips)
        if states != self._shown:
            self._shown = states
            tints = [HEALTH_COLORS[health] for health in states.values()]
            marks = rr.LineStrips3D.from_fields(strips=strips, colors=tints, radii=rr.Radius.ui_points(1.2))
        return [Entry(self._path, snapshot.t, marks)]
