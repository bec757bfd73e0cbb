"""Obstacles: zones along the flight that vehicles must pass above, and their clearance.

A zone is a rule of the mission and not a wall: a vehicle that enters one is reported, and flies on. So its law stays
comparable, and its neighbours do not lose it; a claim on its clearance fails.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ftcc.link.compiled import compiled
from ftcc.link.events import note

__all__ = ["ENTERED", "Obstacle", "clearance", "entered_text", "watch", "zones_of"]

ENTERED = 1
"""Kind of event: a vehicle entered the zone of that number, counted from 1, for the first time."""


class Obstacle(NamedTuple):
    """Nothing may fly at ``start`` < x < ``end`` below ``top``; m."""

    start: float
    end: float
    top: float


def zones_of(obstacles: tuple[Obstacle, ...]) -> np.ndarray:
    """The obstacles as an array (n, 3) for compiled functions."""
    return np.array(obstacles, np.float64).reshape(len(obstacles), len(Obstacle._fields))


@compiled
def clearance(zones, x, z):
    """Height (m) above the highest obstacle below, or above z = 0 where there is none; negative inside a zone."""
    height = z
    for n in range(zones.shape[0]):
        if zones[n, 0] < x < zones[n, 1]:
            height = min(height, z - zones[n, 2])
    return height


@compiled
def watch(zones, entered, events, i, now_us, x, z):
    """Note an event when vehicle ``i`` enters a zone for the first time, and mark the zone in ``entered`` (k, n)."""
    for n in range(zones.shape[0]):
        if entered[i, n] == 0 and zones[n, 0] < x < zones[n, 1] and z < zones[n, 2]:
            entered[i, n] = 1
            note(events, now_us, i, ENTERED, n + 1)


def entered_text(uav: int, number: int) -> str:
    """The text of that event."""
    return f"UAV {uav} entered obstacle zone {number}"
