"""Compute shapes of the three-dimensional views: airframes, arrows, poses."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ftcc.groundside.drawn_airframe import SPAN, airframe, outline
from ftcc.groundside.palette import Color
from ftcc.link.messages import StateMessage
from ftcc.link.rotation import body_attitude, body_axes, quaternion_product
from ftcc.sim.plant import TRUTH
from ftcc.sim.sensors import encode_state

__all__ = ["SPAN", "Poses", "airframe", "arrows", "outline", "stick_colors", "sticks"]

_STICKS = (
    ((-1.3, 0.0, 0.0), (1.0, 0.0, 0.0)),
    ((0.0, -1.62, 0.0), (0.0, 1.62, 0.0)),
    ((-1.1, 0.0, 0.0), (-1.3, 0.0, -0.55)),
)
"""Fuselage, wing and fin of an aircraft drawn as three lines."""

_ANGLES = ("chi", "gamma", "mu", "alpha", "beta")
"""Arguments of `body_attitude`."""
_NORTH_TO_WORLD = (0.0, math.sqrt(0.5), math.sqrt(0.5), 0.0)
"""Rotation from north-east-down to east-north-up as a quaternion, scalar first."""


class Poses:
    """Converts true states to poses."""

    def __init__(self) -> None:
        self._message = np.zeros(len(StateMessage._fields))

    def of(
        self,
        place: Sequence[float] | NDArray[np.float64],
        truth: Mapping[str, float],
        turn: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0),
    ) -> rr.Transform3D:
        """Return the pose at ``place`` (east, north, up; m) with the attitude of ``truth``; a missing state is 0.

        ``turn`` is a further rotation, a quaternion in the world's axes.
        """
        encode_state(np.array([truth.get(field, 0.0) for field in TRUTH]), self._message)
        w, x, y, z = quaternion_product(*turn, *quaternion_product(*_NORTH_TO_WORLD, *self._message[:4]))
        return rr.Transform3D(translation=place, quaternion=rr.Quaternion(xyzw=(x, y, z, w)))


def sticks(
    places: NDArray[np.float64],
    truths: Sequence[Mapping[str, float]],
    scale: float,
    turns: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return aircraft as three lines each, shape (3 n, 2, 3).

    ``places`` (n, 3) and ``truths`` as in `Poses.of`; ``turns`` (n, 3, 3) are further rotations.
    """
    angles = [[truth.get(name, 0.0) for name in _ANGLES] for truth in truths]
    axes = np.array([body_axes(*body_attitude(*five)) for five in angles]).reshape(-1, 3, 3)
    # Rows are the body axes forward, right and down; convert from north-east-down to east-north-up.
    axes = axes[:, :, [1, 0, 2]] * (1.0, 1.0, -1.0)
    if turns is not None:
        axes = axes @ turns.transpose(0, 2, 1)
    ends = np.array(_STICKS).reshape(-1, 3) * scale
    return (ends @ axes + places[:, None]).reshape(-1, 2, 3)


def stick_colors(tints: Mapping[int, Color], uavs: Sequence[int]) -> NDArray[np.uint8]:
    """Return the colours of the `sticks` of UAVs, shape (3 n, 3)."""
    return np.repeat(np.array([tints[uav] for uav in uavs], np.uint8).reshape(-1, 3), len(_STICKS), axis=0)


def arrows(
    start: NDArray[np.float64], end: NDArray[np.float64], gap: float, aside: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return origins and vectors of arrows, shortened by ``gap`` at both ends and shifted right by ``aside``, m."""
    along = end - start
    length = np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    ahead = along / length
    right = np.zeros_like(ahead)
    right[:, 0], right[:, 1] = ahead[:, 1], -ahead[:, 0]
    gap_here = np.minimum(gap, 0.3 * length)
    origins = start + gap_here * ahead + aside * right
    return origins, along - 2.0 * gap_here * ahead
