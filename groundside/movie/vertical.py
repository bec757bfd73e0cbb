"""The vertical plane: altitude over the position along the track, about the swarm's moving mean."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.movie.aircraft import BESIDE, Fleet, axes_of, begin_tracks
from ftcc.groundside.movie.labels import Labels
from ftcc.groundside.movie.sampling import Sampled
from ftcc.groundside.movie.screen import Screen
from ftcc.groundside.palette import GRAY, colors, hexadecimal

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ftcc.groundside.scenario import Mission

__all__ = ["VerticalScene"]

Array = NDArray[np.float64]

_SPAN = 62.0
"""Wing span on the picture, pixels at 1280x720."""
_NEAR = 2.5
"""Longest part of the track that is shown behind, in lengths of the swarm along the track, if it is not abreast."""
_ABREAST = 30.0
"""A shorter swarm counts as abreast, m."""


class VerticalScene:
    """Aircraft from the side, with trails, the band between the leaders, and obstacles that pass by.

    ``trail`` is the length of the trails in frames.
    """

    title = "Vertical plane"

    def __init__(self, axes: Axes, sampled: Sampled, mission: Mission, screen: Screen, trail: int) -> None:
        self._axes = axes
        self._trail = trail
        self._obstacles = mission.obstacles
        uavs = sampled.uavs
        tints = colors(uavs)
        x, self._z = sampled.column("x"), sampled.column("z")
        self._middle = _mean(x)
        self._x = x - self._middle[:, None]
        angles = (sampled.column(name) for name in ("gamma", "mu", "alpha", "beta"))
        self._angles = [np.zeros_like(x), *(np.where(np.isfinite(x), np.nan_to_num(angle), np.nan) for angle in angles)]
        self._faulty = sampled.faulty()
        self._leaders = [i for i, uav in enumerate(uavs) if uav in mission.graph.leaders]
        self._along = x
        self._limit()
        band = hexadecimal(GRAY)
        self._hull = self._patch(band, 0.16) if len(self._leaders) > 1 else None
        self._blocks = [self._patch(band, 0.55) for _ in self._obstacles]
        self._trails = begin_tracks(axes, tints)
        self._fleet = Fleet(axes, tints, BESIDE, _SPAN * screen.scale)
        self._labels = Labels(axes, tints, mission.graph.leaders, screen, 0.85 * _SPAN * screen.scale)
        axes.set(xlabel="along the track, from the swarm's mean, m", ylabel="altitude, m")

    @property
    def legend(self) -> list[Any]:
        """Entries for what is no aircraft."""
        from matplotlib.patches import Patch

        entries: list[Any] = []
        if self._hull is not None:
            entries.append(Patch(color=hexadecimal(GRAY), alpha=0.25, label="between leaders"))
        if self._obstacles:
            entries.append(Patch(color=hexadecimal(GRAY), alpha=0.6, label="obstacle"))
        return entries

    @property
    def artists(self) -> list[Any]:
        """Artists that change from frame to frame, in the order in which they are drawn."""
        patches = [*self._blocks, *([] if self._hull is None else [self._hull])]
        return [*patches, *self._trails, *self._fleet.artists, *self._labels.artists]

    def draw(self, k: int) -> None:
        """Show frame ``k``."""
        past = slice(max(0, k - self._trail), k + 1)
        behind = self._along[past] - self._middle[k]
        for i, trail in enumerate(self._trails):
            trail.set_data(behind[:, i], self._z[past, i])
        self._draw_hull(past, k)
        bottom = self._axes.get_ylim()[0]
        for patch, (start, end, top) in zip(self._blocks, self._obstacles):
            a, b = start - self._middle[k], end - self._middle[k]
            patch.set_xy([(a, bottom), (a, top), (b, top), (b, bottom)])
        places = self._axes.transData.transform(np.column_stack([self._x[k], self._z[k]]))
        self._fleet.draw(places, axes_of(*(angle[k] for angle in self._angles)))
        self._labels.draw(places, self._faulty[k])

    def _draw_hull(self, past: slice, k: int) -> None:
        if self._hull is None:
            return
        levels = self._z[past][:, self._leaders]
        known = np.flatnonzero(np.isfinite(levels).all(axis=1))
        if not len(known) or known[-1] != len(levels) - 1:
            self._hull.set_visible(False)
            return
        along = np.append(_mean(self._along[past][:, self._leaders])[known] - self._middle[k], self._axes.get_xlim()[1])
        low, high = levels[known].min(axis=1), levels[known].max(axis=1)
        edge = np.column_stack([along, np.append(low, low[-1])])
        back = np.column_stack([along, np.append(high, high[-1])])[::-1]
        self._hull.set_xy(np.vstack([edge, back]))
        self._hull.set_visible(True)

    def _limit(self) -> None:
        """Set the limits of the axes, for the whole film."""
        front, rear = float(np.nanmax(self._x, initial=0.0)), float(np.nanmin(self._x, initial=0.0))
        length = front - rear
        known = np.flatnonzero(np.isfinite(self._middle))
        step = (
            abs(float(self._middle[known[-1]] - self._middle[known[0]])) / max(len(known) - 1, 1) if len(known) else 0.0
        )
        behind = max(step * self._trail, 100.0)
        if length > _ABREAST:
            behind = min(behind, _NEAR * length)
        self._axes.set_xlim(rear - behind, front + 0.25 * (behind + length))
        levels = [*self._z[np.isfinite(self._z)], *(o.top for o in self._obstacles)]
        low, high = (min(levels), max(levels)) if levels else (0.0, 100.0)
        margin = 0.1 * max(high - low, 20.0)
        self._axes.set_ylim(low - margin, high + margin)

    def _patch(self, color: str, alpha: float) -> Any:
        from matplotlib.patches import Polygon

        patch = Polygon(
            np.zeros((1, 2)), closed=True, facecolor=color, alpha=alpha, linewidth=0.0, animated=True, zorder=2
        )
        self._axes.add_patch(patch)
        return patch


def _mean(x: Array) -> Array:
    """Return the mean over UAVs at each time, of those that are there; nan without any."""
    known = np.isfinite(x)
    with np.errstate(invalid="ignore"):
        mean: Array = np.where(known, x, 0.0).sum(axis=1) / np.where(known.any(axis=1), known.sum(axis=1), np.nan)
    return mean
