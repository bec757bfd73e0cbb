"""Obstacles: zones along the flight that are to be passed above, and how far above them a vehicle flies.

A zone is a rule of the mission and no wall: a vehicle that enters one is reported, and flies on. So what its law does
stays comparable, and its neighbours do not lose it for a reason that is none of theirs; a claim on clearance fails.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ftcc.link.compiled import compiled
from ftcc.link.events import note

__all__ = ["ENTERED", "Obstacle", "clearance", "entered_text", "watch", "zones_of"]

ENTERED = 1
"""Kind of happening: a vehicle entered the zone of that number, counted from 1, for the first time."""


class Obstacle(NamedTuple):
    """Nothing may fly at ``start`` < x < ``end`` below ``top``; m."""

    start: float
    end: float
    top: float


def zones_of(obstacles: tuple[Obstacle, ...]) -> np.ndarray:
    """The obstacles as the compiled functions want them, (n, 3)."""
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
    """Note when vehicle ``i`` enters a zone for the first time; ``entered`` (k, n) keeps which ones it did."""
    for n in range(zones.shape[0]):
        if entered[i, n] == 0 and zones[n, 0] < x < zones[n, 1] and z < zones[n, 2]:
            entered[i, n] = 1
            note(events, now_us, i, ENTERED, n + 1)


def entered_text(uav: int, number: int) -> str:
    """The event for people."""
    return f"UAV {uav} entered obstacle zone {number}"
