"""The place on earth of the swarm's local frame, for maps."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["Home"]

_EARTH = 6_378_137.0
"""Radius, m."""
_TURN = 3_600_000_000
"""A full turn, 1e-7 deg."""


@dataclass(frozen=True)
class Home:
    """The place on earth of the origin of the local frame."""

    latitude: float
    """deg."""
    longitude: float
    """deg."""
    altitude: float
    """m above mean sea level at z = 0."""

    def place(self, north: float, east: float) -> tuple[int, int]:
        """Latitude and longitude (1e-7 deg) of a point of the local frame (m), on a sphere, near the origin."""
        latitude = self.latitude + math.degrees(north / _EARTH)
        longitude = self.longitude + math.degrees(east / (_EARTH * math.cos(math.radians(self.latitude))))
        turned = round((longitude + 180.0) % 360.0 * 1e7) % _TURN
        return round(max(-90.0, min(90.0, latitude)) * 1e7), turned - _TURN // 2
