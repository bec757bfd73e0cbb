"""Tracking errors over time, which grow with the film, and events as vertical lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.scheme import Quantity
from ftcc.groundside.movie.screen import Screen
from ftcc.groundside.palette import Color, hexadecimal
from ftcc.groundside.report import Curve, Flown, curves_of, has_columns, thinned

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["MOST", "TrackingPanel", "errors_of"]

Array = NDArray[np.float64]

MOST = 3
"""Largest number of panels."""


def errors_of(flight: Flown) -> list[tuple[Quantity, list[Curve]]]:
    """Return the tracking errors that the scheme declares and the flight recorded, with a curve per follower."""
    found = []
    for error in flight.mission.scheme.tracking:
        if has_columns(flight, [error.name], None):
            curves = list(curves_of(error.name, flight, "followers"))
            if curves:
                found.append((error, curves))
    return found[:MOST]


class TrackingPanel:
    """One tracking error of all followers.

    Parameters
    ----------
    axes : Axes
    error : Quantity
    curves : sequence of Curve
        Times in s; errors in the unit of ``error``, angles are drawn in degrees.
    tints : mapping
        Colour by UAV.
    times : (n,) array
        Simulated times of the frames, s.
    events : sequence of (time s, colour)
        Vertical lines.
    screen : Screen
    """

    def __init__(
        self,
        axes: Axes,
        error: Quantity,
        curves: Sequence[Curve],
        tints: Mapping[int, Color],
        times: Array,
        events: Sequence[tuple[float, str]],
        screen: Screen,
    ) -> None:
        self._times = times
        factor, unit = (np.degrees(1.0), f"deg{error.unit[3:]}") if error.unit.startswith("rad") else (1.0, error.unit)
        self._curves: list[tuple[Array, Array, Any]] = []
        first, last = float(times[0]), float(times[-1])
        shown = []
        for curve in curves:
            inside = (curve.x >= first) & (curve.x <= last + 1e-6)
            x, y = curve.x[inside], factor * curve.y[inside]
            shown.append(np.abs(y[np.isfinite(y)]))
            (line,) = axes.plot([], [], color=hexadecimal(tints[curve.uav]), linewidth=1.5, animated=True, zorder=3)
            self._curves.append((*thinned(x, y), line))
        largest = max((float(sizes.max()) for sizes in shown if len(sizes)), default=0.0)
        limit = 1.12 * largest if largest > 0.0 else 1.0
        for t, color in events:
            axes.axvline(t, color=color, linewidth=1.1, alpha=0.65, zorder=1)
        axes.axhline(0.0, color=screen.muted, linewidth=0.7, zorder=1)
        axes.set(xlim=(first, last), ylim=(-limit, limit))
        axes.set_title(f"{error.meaning or error.name}, {unit}".replace("^2", "²"))
        # On the left it would cover the title.
        axes.yaxis.set_offset_position("right")
        axes.locator_params(axis="y", nbins=5)
        self._mark = axes.axvline(first, color=screen.ink, linewidth=1.2, animated=True, zorder=4)

    @property
    def artists(self) -> list[Any]:
        """Artists that change from frame to frame."""
        return [*(line for _, _, line in self._curves), self._mark]

    def draw(self, k: int) -> None:
        """Show frame ``k``: the errors up to its time."""
        t = float(self._times[k])
        for x, y, line in self._curves:
            n = int(np.searchsorted(x, t + 1e-6, side="right"))
            line.set_data(x[:n], y[:n])
        self._mark.set_xdata([t, t])
