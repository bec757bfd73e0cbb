"""Aircraft in a scene: shaded airframes with their attitude, projected on the picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.drawn_airframe import SPAN, airframe, outline
from ftcc.groundside.palette import Color, hexadecimal
from ftcc.link.rotation import body_attitude, body_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PolyCollection
    from matplotlib.lines import Line2D

__all__ = ["ABOVE", "BEHIND", "BESIDE", "Fleet", "View", "axes_of", "begin_tracks"]

Array = NDArray[np.float64]

_LIGHT = np.array([0.35, 0.35, -0.87])
"""Direction towards the light, north-east-down."""
_DARKEST = 0.55
"""Brightness of a surface along the light."""


class View(NamedTuple):
    """Axes of a picture in north-east-down: to the right, up, and towards the viewer."""

    right: Array
    up: Array
    towards: Array


def _view(towards: Sequence[float], up: Sequence[float] = (0.0, 0.0, -1.0)) -> View:
    w = np.array(towards) / np.linalg.norm(towards)
    right = np.cross(up, w)
    right /= np.linalg.norm(right)
    return View(right, np.cross(w, right), w)


BESIDE = _view((-0.32, 0.87, -0.42))
"""From the right and slightly above and behind: north is to the right."""
BEHIND = _view((-1.0, 0.0, -0.26))
"""From behind and slightly above: east is to the right."""
ABOVE = _view((0.0, 0.0, -1.0), up=(1.0, 0.0, 0.0))
"""From above: north is up."""


def axes_of(chi: Array, gamma: Array, mu: Array, alpha: Array, beta: Array) -> Array:
    """Return the body axes (n, 3, 3) of n attitudes, rows nose, right wing and belly in north-east-down; nan stays."""
    angles = np.column_stack([chi, gamma, mu, alpha, beta])
    return np.array([body_axes(*body_attitude(*five)) for five in angles.tolist()]).reshape(-1, 3, 3)


class Fleet:
    """All aircraft of a scene, as one artist, and the outlines of references as another.

    Parameters
    ----------
    axes : Axes
    tints : mapping
        Colour by UAV.
    view : View
    span : float
        Wing span on the picture, pixels.
    outlined : bool
        Whether references are drawn.
    """

    def __init__(self, axes: Axes, tints: Mapping[int, Color], view: View, span: float, outlined: bool = False) -> None:
        from matplotlib.collections import LineCollection, PolyCollection
        from matplotlib.transforms import IdentityTransform

        self._view = view
        vertices, normals = airframe(span / SPAN)
        self._corners = vertices.astype(float)
        self._normals = normals[::3].astype(float)
        self._strips = [strip.astype(float) for strip in outline(span / SPAN)]
        self._tints = np.array(list(tints.values()), float).reshape(-1, 3) / 255.0
        self._bodies: PolyCollection = PolyCollection(
            [], transform=IdentityTransform(), linewidths=0.3, animated=True, zorder=6, clip_on=True
        )
        axes.add_collection(self._bodies, autolim=False)
        self._outlines: LineCollection | None = None
        if outlined:
            self._outlines = LineCollection(
                [], transform=IdentityTransform(), linewidths=1.1, animated=True, zorder=5, alpha=0.9
            )
            axes.add_collection(self._outlines, autolim=False)

    @property
    def artists(self) -> list[object]:
        """Artists that change from frame to frame, in the order in which they are drawn."""
        return [self._bodies] if self._outlines is None else [self._outlines, self._bodies]

    def draw(self, places: Array, axes: Array) -> None:
        """Put aircraft at ``places`` (n, 2; pixels) with body axes ``axes`` (n, 3, 3); one with a nan is left out."""
        shown = np.isfinite(places).all(axis=1) & np.isfinite(axes).all(axis=(1, 2))
        corners = self._corners @ axes[shown]
        flat = self._flat(corners, places[shown]).reshape(len(corners), -1, 3, 2)
        depth = (corners @ self._view.towards).reshape(len(corners), -1, 3).mean(axis=2)
        light = np.abs(self._normals @ axes[shown] @ _LIGHT)
        shade = (_DARKEST + (1.0 - _DARKEST) * light)[..., None] * self._tints[shown][:, None]
        order = np.argsort(depth, axis=1)
        rows = np.arange(len(order))[:, None]
        self._bodies.set_verts(list(flat[rows, order].reshape(-1, 3, 2)))
        tints = shade[rows, order].reshape(-1, 3)
        self._bodies.set_facecolor(tints)
        self._bodies.set_edgecolor(tints)

    def draw_references(self, places: Array, axes: Array) -> None:
        """Put outlines at ``places`` with body axes ``axes``, as in `draw`."""
        if self._outlines is None:
            return
        shown = np.flatnonzero(np.isfinite(places).all(axis=1) & np.isfinite(axes).all(axis=(1, 2)))
        lines = [self._flat((strip @ axes[i])[None], places[i : i + 1])[0] for i in shown for strip in self._strips]
        self._outlines.set_segments(lines)
        self._outlines.set_color(list(map(tuple, np.repeat(self._tints[shown], len(self._strips), axis=0).tolist())))

    def _flat(self, points: Array, places: Array) -> Array:
        """Return points (n, k, 3) in north-east-down around ``places`` (n, 2) as pixels (n, k, 2)."""
        return np.stack([points @ self._view.right, points @ self._view.up], axis=-1) + places[:, None]


def begin_tracks(axes: Axes, tints: Mapping[int, Color]) -> list[Line2D]:
    """Return a line for the way behind each aircraft, empty as yet."""
    return [
        axes.plot([], [], color=hexadecimal(tint), linewidth=1.8, alpha=0.6, animated=True, zorder=4)[0]
        for tint in tints.values()
    ]
