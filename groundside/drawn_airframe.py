"""The airframe as it is drawn: flat wings and tails and a body of triangles. x forward, y right, z down; m."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

__all__ = ["SPAN", "airframe", "outline"]

SPAN = 3.24

_PARTS = (
    ((0.15, 0.0, 0.0), (0.02, 1.62, -0.1), (-0.3, 1.62, -0.1), (-0.4, 0.0, 0.0)),
    ((0.15, 0.0, 0.0), (-0.4, 0.0, 0.0), (-0.3, -1.62, -0.1), (0.02, -1.62, -0.1)),
    ((-0.95, 0.0, -0.05), (-1.05, 0.55, -0.05), (-1.25, 0.55, -0.05), (-1.3, 0.0, -0.05)),
    ((-0.95, 0.0, -0.05), (-1.3, 0.0, -0.05), (-1.25, -0.55, -0.05), (-1.05, -0.55, -0.05)),
    ((-0.8, 0.0, -0.05), (-1.15, 0.0, -0.55), (-1.35, 0.0, -0.55), (-1.3, 0.0, -0.05)),
)
"""Corners of flat parts, each a fan of triangles."""
_BODY = ((1.0, 0.0, 0.0), 0.3, 0.14, (-1.3, 0.0, -0.05))
"""Nose, station and half-width of the thickest section, tail."""


def airframe(scale: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return vertices and normals, shape (n, 3), three vertices per triangle."""
    triangles = [(part[0], part[i], part[i + 1]) for part in _PARTS for i in range(1, len(part) - 1)]
    nose, station, half, tail = _BODY
    ring = [(station, half * math.cos(a), half * math.sin(a)) for a in np.arange(6) * math.pi / 3.0]
    for i in range(6):
        triangles += [(nose, ring[i], ring[(i + 1) % 6]), (tail, ring[(i + 1) % 6], ring[i])]
    corners = np.array(triangles, dtype=np.float32)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return scale * corners.reshape(-1, 3), np.repeat(normals, 3, axis=0).astype(np.float32)


def outline(scale: float) -> list[NDArray[np.float32]]:
    """Return the airframe's edges as closed strips, which represent a reference."""
    return [scale * np.array([*part, part[0]], dtype=np.float32) for part in _PARTS]
