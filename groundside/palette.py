"""Colours of the dashboard and of figures: middle tones, readable on white and on black."""

from __future__ import annotations

import colorsys
from collections.abc import Iterable

__all__ = ["CUT", "DOUBTED", "FIRE", "FRESH", "GRAY", "HEALTH_COLORS", "STALE", "Color", "colors", "hexadecimal"]

Color = tuple[int, int, int]

GRAY: Color = (128, 132, 138)
"""Bounds, limits and everything that belongs to no UAV."""
FRESH: Color = (122, 134, 126)
STALE: Color = (224, 160, 20)
CUT: Color = (226, 48, 48)
"""Links with fresh records, with none lately, and cut ones."""
DOUBTED: Color = (150, 84, 206)
"""Links whose receiver distrusts the sender."""
FIRE: Color = (222, 84, 40)

HEALTH_COLORS: tuple[Color, ...] = ((84, 170, 92), STALE, (230, 110, 30), CUT, GRAY)
"""By what a UAV says of itself: healthy, suspected, undetermined, faulty; and one that has left the swarm."""

_PALETTE: tuple[Color, ...] = (
    (72, 126, 216),
    (200, 116, 48),
    (64, 160, 88),
    (206, 84, 148),
    (138, 104, 206),
    (34, 158, 166),
    (146, 140, 40),
    (108, 120, 148),
)
"""Colours of UAVs; red and amber are reserved for links."""


def colors(uavs: Iterable[int]) -> dict[int, Color]:
    """Return a colour for each UAV; beyond eight, hues a golden angle apart."""
    chosen = dict(zip(sorted(uavs), _PALETTE, strict=False))
    for i, uav in enumerate(sorted(uavs)[len(_PALETTE) :]):
        r, g, b = colorsys.hls_to_rgb((0.09 + 0.618034 * i) % 1.0, 0.5, 0.45)
        chosen[uav] = (int(255 * r), int(255 * g), int(255 * b))
    return chosen


def hexadecimal(color: Color) -> str:
    """Return a colour as ``#rrggbb``."""
    return "#{:02x}{:02x}{:02x}".format(*color)
