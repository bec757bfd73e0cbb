"""Numbers beside aircraft, moved apart where they would cover each other, and framed where aircraft are faulty."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.movie.screen import FAULT, Screen
from ftcc.groundside.palette import Color, hexadecimal

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Labels", "spread"]

Array = NDArray[np.float64]

_LETTER = 22.0
"""Height of a label, pixels at 1280x720."""
_MOST = 24
"""In a bigger swarm numbers would cover the aircraft: there a faulty one has a ring around itself."""


class Labels:
    """The number of each aircraft to the right of it, in a red frame while it has a fault.

    ``size`` is the size of an aircraft, pixels; 0: the places are those of the labels.
    """

    def __init__(
        self, axes: Axes, tints: Mapping[int, Color], leaders: Sequence[int], screen: Screen, size: float
    ) -> None:
        from matplotlib.transforms import IdentityTransform

        self._height = _LETTER * screen.scale
        self._away = 0.5 * size + 7.0 * screen.scale if size else 0.0
        self._texts: list[Any] = [
            axes.text(
                0.0,
                0.0,
                f"{uav} leader" if uav in leaders else f"{uav}",
                color=hexadecimal(tint),
                fontsize=11.0,
                fontweight="bold",
                va="center",
                ha="left" if size else "center",
                transform=IdentityTransform(),
                animated=True,
                clip_on=True,
                zorder=8,
                bbox={"boxstyle": "round,pad=0.2", "facecolor": "none", "edgecolor": FAULT, "linewidth": 1.3},
            )
            for uav, tint in tints.items()
            if len(tints) <= _MOST
        ]
        (self._rings,) = axes.plot(
            [],
            [],
            "o",
            transform=IdentityTransform(),
            markerfacecolor="none",
            markeredgecolor=FAULT,
            markeredgewidth=1.4,
            markersize=size / screen.dpi * 72.0,
            animated=True,
            zorder=7,
        )

    @property
    def artists(self) -> list[Any]:
        """Artists that change from frame to frame."""
        return [self._rings, *self._texts]

    def draw(self, places: Array, faulty: NDArray[np.bool_]) -> None:
        """Put labels beside ``places`` (n, 2; pixels); ``faulty`` (n,)."""
        ringed = places[faulty & np.isfinite(places).all(axis=1) & (not self._texts)]
        self._rings.set_data(ringed[:, 0], ringed[:, 1])
        heights = spread(places, self._height)
        for text, (x, y), height, marked in zip(self._texts, places, heights, faulty):
            text.set_visible(bool(np.isfinite(x) and np.isfinite(y)))
            if text.get_visible():
                text.set_position((x + self._away, height))
                text.get_bbox_patch().set_visible(bool(marked))


def spread(places: Array, apart: float) -> Array:
    """Return heights (n,) of labels beside ``places`` (n, 2), no two of a column closer than ``apart``."""
    heights = places[:, 1].copy()
    left = [i for i in np.argsort(places[:, 0]) if np.isfinite(places[i]).all()]
    while left:
        column = [i for i in left if places[i, 0] - places[left[0], 0] <= 2.0 * apart]
        left = [i for i in left if i not in column]
        column.sort(key=lambda i: places[i, 1])
        groups: list[list[int]] = []
        for i in column:
            groups.append([i])
            while len(groups) > 1 and _bottom(groups[-1], places, apart) < _top(groups[-2], places, apart) + apart:
                last = groups.pop()
                groups[-1] += last
        for group in groups:
            for n, i in enumerate(group):
                heights[i] = _bottom(group, places, apart) + n * apart
    return heights


def _bottom(group: Sequence[int], places: Array, apart: float) -> float:
    """Return the lowest height of labels that stand together around the middle of their aircraft."""
    return float(places[list(group), 1].mean()) - 0.5 * apart * (len(group) - 1)


def _top(group: Sequence[int], places: Array, apart: float) -> float:
    return _bottom(group, places, apart) + apart * (len(group) - 1)
