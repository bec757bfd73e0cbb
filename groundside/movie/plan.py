"""The plan view: aircraft with their tracks, their references, and the fire that they watch; north is up."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.references.position import Command, border
from ftcc.groundside.canvas import Line2D
from ftcc.groundside.movie.aircraft import ABOVE, Fleet, axes_of, begin_tracks
from ftcc.groundside.movie.labels import Labels
from ftcc.groundside.movie.sampling import Sampled
from ftcc.groundside.movie.screen import Screen
from ftcc.groundside.palette import FIRE, colors, hexadecimal

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ftcc.groundside.scenario import Mission

__all__ = ["PlanScene"]

Array = NDArray[np.float64]

_SPAN = 44.0
"""Wing span on the picture, pixels at 1280x720."""


class PlanScene:
    """Aircraft from above.

    ``trail`` is the length of the tracks in frames.
    """

    title = "Plan view, north up"

    def __init__(self, axes: Axes, sampled: Sampled, mission: Mission, screen: Screen, trail: int) -> None:
        self._axes = axes
        self._trail = 2 * trail
        self._fire = mission.fire
        self._times = sampled.times
        uavs = sampled.uavs
        tints = colors(uavs)
        self._north, self._east = sampled.column("x"), sampled.column("y")
        self._posts = np.stack([sampled.column("y_ref"), sampled.column("x_ref")], axis=-1)
        self._centre = np.stack([_first_known(sampled.column(name)) for name in ("fire_north", "fire_east")], axis=-1)
        self._angles = [sampled.column(name) for name in ("chi", "gamma", "mu")]
        self._angles += [np.nan_to_num(sampled.column(name)) for name in ("alpha", "beta")]
        self._faulty = sampled.faulty()
        self._limit()
        self._area = self._front = None
        if self._fire is not None:
            self._area, self._front = self._patch(0.18), self._patch(1.0, edge=True)
        self._tracks = begin_tracks(axes, tints)
        self._marks = axes.scatter(
            [0.0] * len(uavs),
            [0.0] * len(uavs),
            s=130.0,
            facecolors="none",
            edgecolors=[hexadecimal(tint) for tint in tints.values()],
            linewidths=1.3,
            animated=True,
            zorder=3,
        )
        self._fleet = Fleet(axes, tints, ABOVE, _SPAN * screen.scale)
        self._labels = Labels(axes, tints, mission.graph.leaders, screen, 0.7 * _SPAN * screen.scale)
        axes.set(xlabel="east, m", ylabel="north, m")

    @property
    def legend(self) -> list[Any]:
        """Entries for what is no aircraft."""
        from matplotlib.patches import Patch

        entries: list[Any] = []
        if self._area is not None:
            entries.append(Patch(facecolor=f"{hexadecimal(FIRE)}2e", edgecolor=hexadecimal(FIRE), label="fire"))
        if np.isfinite(self._posts).any():
            ring: dict[str, Any] = {"marker": "o", "markersize": 9.0, "markerfacecolor": "none", "linestyle": "none"}
            entries.append(Line2D([], [], color=self._axes.xaxis.label.get_color(), label="reference", **ring))
        return entries

    @property
    def artists(self) -> list[Any]:
        """Artists that change from frame to frame, in the order in which they are drawn."""
        fire = [patch for patch in (self._area, self._front) if patch is not None]
        return [*fire, self._marks, *self._tracks, *self._fleet.artists, *self._labels.artists]

    def draw(self, k: int) -> None:
        """Show frame ``k``."""
        past = slice(max(0, k - self._trail), k + 1)
        for i, track in enumerate(self._tracks):
            track.set_data(self._east[past, i], self._north[past, i])
        self._marks.set_offsets(self._posts[k])
        line = self._border(k)
        for patch in (self._area, self._front):
            if patch is not None:
                patch.set_visible(line is not None)
                if line is not None:
                    patch.set_xy(line)
        places = self._axes.transData.transform(np.column_stack([self._east[k], self._north[k]]))
        self._fleet.draw(places, axes_of(*(angle[k] for angle in self._angles)))
        self._labels.draw(places, self._faulty[k])

    def _border(self, k: int) -> Array | None:
        """Return the fire's border (n, 2), east and north, around the centre that the UAVs use; None without one."""
        north, east = self._centre[k]
        if self._fire is None or not np.isfinite(north):
            return None
        t = float(self._times[k])
        return border(self._fire, [Command(t, float(north), float(east), 0.0, 0.0)], t)[:, ::-1]

    def _limit(self) -> None:
        """Set the limits of the axes, for the whole film."""
        shown = [np.stack([self._east, self._north], axis=-1).reshape(-1, 2), self._posts.reshape(-1, 2)]
        shown += [line for k in (0, len(self._times) - 1) if (line := self._border(k)) is not None]
        points = np.vstack(shown)
        points = points[np.isfinite(points).all(axis=1)]
        if not len(points):
            return
        low, high = points.min(axis=0), points.max(axis=0)
        box = self._axes.get_window_extent()
        size = np.array([box.width, box.height])
        # One scale for both axes.
        half = 0.5 * size * max(float(((high - low) / size).max()), 100.0 / box.width) * 1.18
        middle = 0.5 * (low + high)
        self._axes.set_xlim(middle[0] - half[0], middle[0] + half[0])
        self._axes.set_ylim(middle[1] - half[1], middle[1] + half[1])

    def _patch(self, alpha: float, edge: bool = False) -> Any:
        from matplotlib.patches import Polygon

        color = hexadecimal(FIRE)
        patch = Polygon(
            np.zeros((1, 2)),
            closed=True,
            facecolor="none" if edge else color,
            edgecolor=color if edge else "none",
            alpha=alpha,
            linewidth=1.6,
            animated=True,
            zorder=2,
        )
        self._axes.add_patch(patch)
        return patch


def _first_known(x: Array) -> Array:
    """Return at each time the value of the first UAV that has one; nan without any."""
    known = np.isfinite(x)
    return np.where(known.any(axis=1), x[np.arange(len(x)), known.argmax(axis=1)], np.nan)
