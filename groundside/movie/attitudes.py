"""Attitudes: every aircraft from behind, along its own course, with the outline of its reference and its angles."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.canvas import Line2D
from ftcc.groundside.movie.aircraft import BEHIND, Fleet, axes_of
from ftcc.groundside.movie.labels import Labels
from ftcc.groundside.movie.sampling import Sampled
from ftcc.groundside.movie.screen import Screen
from ftcc.groundside.palette import colors

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ftcc.groundside.scenario import Mission

__all__ = ["AttitudeScene"]

Array = NDArray[np.float64]

_ANGLES = (("mu", "bank"), ("alpha", "alpha"), ("beta", "sideslip"))
"""States that are commanded, by the names with which ``_d`` is the reference, and as they are called."""
_MOST = 12
"""In a bigger swarm the angles are not written beside the aircraft."""


class AttitudeScene:
    """Aircraft in slots; ``trail`` has no meaning here."""

    title = "Attitudes, from behind, each along its own course"

    def __init__(self, axes: Axes, sampled: Sampled, mission: Mission, screen: Screen, trail: int) -> None:
        del trail
        self._axes = axes
        uavs = sampled.uavs
        tints = colors(uavs)
        axes.axis("off")
        box = axes.get_window_extent()
        columns, rows = _grid(len(uavs), box.width / box.height)
        cell = np.array([box.width / columns, box.height / rows])
        n = np.arange(len(uavs))
        slots = np.column_stack([n % columns + 0.5, rows - 0.5 - n // columns]) * cell
        self._places = np.array([box.x0, box.y0]) + slots + np.array([0.0, 0.07 * cell[1]])
        span = 0.72 * min(cell[0], 1.5 * cell[1])
        states = [sampled.column(name) for name, _ in _ANGLES]
        wanted = [sampled.column(f"{name}_d") for name, _ in _ANGLES]
        gamma = sampled.column("gamma")
        ahead = np.where(np.isfinite(gamma), 0.0, np.nan)
        self._axes_angles = [ahead, gamma, *states]
        self._axes_wanted = [ahead, gamma, *wanted]
        self._degrees = np.degrees(np.stack(states, axis=-1)), np.degrees(np.stack(wanted, axis=-1))
        self._faulty = sampled.faulty()
        self._fleet = Fleet(axes, tints, BEHIND, span, outlined=True)
        self._labels = Labels(axes, tints, mission.graph.leaders, screen, 0.0)
        self._below = self._places - np.array([0.0, 0.37 * cell[1]])
        self._texts = self._angle_texts(axes, cell) if len(uavs) <= _MOST else []
        self._above = self._places + np.array([0.0, 0.27 * cell[1]])
        self._muted = screen.muted

    def _angle_texts(self, axes: Axes, cell: Array) -> list[Any]:
        from matplotlib.transforms import IdentityTransform

        style: dict[str, Any] = {"fontsize": 10.0, "ha": "center", "va": "center", "animated": True, "zorder": 8}
        return [axes.text(x, y, "", transform=IdentityTransform(), **style) for x, y in self._below]

    @property
    def legend(self) -> list[Any]:
        """Entries for what is no aircraft."""
        color = self._axes.xaxis.label.get_color()
        return [Line2D([], [], color=color, linewidth=1.1, label="reference: outline, (in brackets)")]

    @property
    def artists(self) -> list[Any]:
        """Artists that change from frame to frame, in the order in which they are drawn."""
        return [*self._fleet.artists, *self._labels.artists, *self._texts]

    def draw(self, k: int) -> None:
        """Show frame ``k``."""
        there = np.isfinite(self._axes_angles[1][k])[:, None]
        self._fleet.draw_references(self._places, axes_of(*(angle[k] for angle in self._axes_wanted)))
        self._fleet.draw(self._places, axes_of(*(angle[k] for angle in self._axes_angles)))
        self._labels.draw(np.where(there, self._above, np.nan), self._faulty[k])
        states, wanted = self._degrees
        for i, text in enumerate(self._texts):
            text.set_text(_written(states[k, i], wanted[k, i]))


def _written(state: Array, wanted: Array) -> str:
    """Return the angles of one aircraft as text, in deg, references in brackets."""
    if not np.isfinite(state).all():
        return "lost"
    parts = []
    for (_, name), value, reference in zip(_ANGLES, state, wanted):
        against = f"  ({_tenths(reference)})" if np.isfinite(reference) else ""
        parts.append(f"{name} {_tenths(value)}°{against}")
    return "\n".join(parts)


def _tenths(angle: float) -> str:
    """Return an angle within half a turn, deg, to a tenth; never -0.0."""
    return f"{round(math.remainder(float(angle), 360.0), 1) + 0.0:.1f}"


def _grid(n: int, shape: float) -> tuple[int, int]:
    """Return columns and rows of n slots, each 1.2 times as wide as high, in a box of ``shape`` (width / height)."""
    columns = min(range(1, n + 1), key=lambda c: (-min(shape / c / 1.2, 1.0 / math.ceil(n / c)), c))
    return columns, math.ceil(n / columns)
