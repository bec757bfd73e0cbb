"""Draw the surroundings of the swarm: the leaders' hull, obstacles, the front of a fire."""

from __future__ import annotations

import math

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ftcc.airside.references.position import Command, border
from ftcc.groundside.dashboard.snapshot import Snapshot
from ftcc.groundside.dashboard.subject import Subject
from ftcc.groundside.dashboard.viewer import Entry
from ftcc.groundside.palette import FIRE, GRAY

__all__ = ["Surroundings"]

_MARGIN = 6.0
"""Sideways distance by which frames and obstacles extend beyond the swarm, m."""
_APART = 1.0
"""If leaders start farther apart than this along the flight, the hull is drawn as a box, m."""
_OBSTACLE = (*GRAY, 70)
_BURNT = (*FIRE, 36)
_FRONT_EVERY = 1.0
"""Time between two drawings of the front, s; it grows by one metre per second."""
_OBSTACLE_HEIGHT = 200.0
"""Drawn height of an obstacle, from its top downwards, m."""


class Surroundings:
    """Draws the leaders' hull, obstacles and a fire.

    ``positions`` (n, 3) are the first drawn positions; ``in_ranks``: drawn in ranks, though in line abreast.
    """

    def __init__(self, subject: Subject, positions: NDArray[np.float64], in_ranks: bool = False) -> None:
        self._subject = subject
        known = positions[np.isfinite(positions[:, 0])] if np.isfinite(positions).any() else np.zeros((1, 3))
        self._west, self._east = float(known[:, 0].min()) - _MARGIN, float(known[:, 0].max()) + _MARGIN
        self._leaders = [sorted(subject.graph.uavs).index(uav) for uav in subject.leaders]
        self._front_at = -math.inf
        apart = len(self._leaders) > 1 and float(np.ptp(positions[self._leaders, 1])) > _APART
        self._boxed = apart and not in_ranks

    @property
    def notes(self) -> list[str]:
        """Return hints for the title of the view."""
        hull = "box: between the leaders" if self._boxed else "frames: lowest and highest leader"
        notes = [hull] if len(self._leaders) > 1 else []
        notes += ["blocks: obstacles"] if self._subject.obstacles else []
        return notes + (["red: fire"] if self._subject.fire else [])

    def static(self) -> list[Entry]:
        """Return the obstacles and the style of the hull."""
        entries = [
            Entry("/world/hull", None, rr.LineStrips3D.from_fields(colors=GRAY, radii=rr.Radius.ui_points(1.0))),
        ]
        obstacles = self._subject.obstacles
        if obstacles:
            half = [((self._east - self._west) / 2, (o.end - o.start) / 2, _OBSTACLE_HEIGHT / 2) for o in obstacles]
            centre = (self._west + self._east) / 2
            boxes = rr.Boxes3D(
                centers=[(centre, (o.start + o.end) / 2, o.top - _OBSTACLE_HEIGHT / 2) for o in obstacles],
                half_sizes=half,
                colors=[_OBSTACLE] * len(obstacles),
                fill_mode="TransparentFillMajorWireframe",
            )
            entries.append(Entry("/world/obstacles", None, boxes))
        return entries

    def draw(self, snapshot: Snapshot, positions: NDArray[np.float64]) -> list[Entry]:
        """Return hull and fire; ``positions`` (n, 3) of all UAVs."""
        return self._hull(snapshot.t, positions) + self._front(snapshot)

    def _front(self, snapshot: Snapshot) -> list[Entry]:
        """Return the border of the fire on the ground, around the centre that the UAVs use."""
        if self._subject.fire is None or snapshot.t < self._front_at:
            return []
        with_fire = (state.signals for state in snapshot.uavs.values() if "fire_north" in state.signals)
        signals = next(with_fire, None)
        if signals is None:
            return []
        self._front_at = snapshot.t + _FRONT_EVERY
        t = snapshot.t
        centre = Command(t, signals["fire_north"], signals["fire_east"], 0.0, 0.0)
        north, east = border(self._subject.fire, [centre], t).T
        line = np.column_stack([east, north, np.zeros_like(north)])
        burning = np.vstack([(centre.east, centre.north, 0.0), line])
        fan = [(0, i, i + 1) for i in range(1, len(line))]
        area = rr.Mesh3D(vertex_positions=burning, triangle_indices=fan, albedo_factor=_BURNT)
        return [
            Entry("/world/fire/front", t, rr.LineStrips3D([line], colors=FIRE, radii=rr.Radius.ui_points(2.0))),
            Entry("/world/fire/area", t, area),
        ]

    def _hull(self, t: float, positions: NDArray[np.float64]) -> list[Entry]:
        """Return the hull between the leaders: two levels, or a box if they start apart."""
        leaders = positions[self._leaders]
        if len(leaders) < 2 or not np.isfinite(leaders).all():
            return []
        known = positions[np.isfinite(positions[:, 0])]
        low, high = known.min(axis=0) - _MARGIN, known.max(axis=0) + _MARGIN
        if self._boxed:
            low[1], high[1] = leaders[:, 1].min(), leaders[:, 1].max()
        bottom, top = leaders[:, 2].min(), leaders[:, 2].max()
        ring = np.array([(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1]), (low[0], low[1])])
        strips = [np.column_stack([ring, np.full(5, level)]) for level in (bottom, top)]
        if self._boxed:
            strips += [np.array([(*corner, bottom), (*corner, top)]) for corner in ring[:4]]
        return [Entry("/world/hull", t, rr.LineStrips3D.from_fields(strips=strips))]
