"""What is checked before aircraft of a scenario fly behind doors."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ftcc.groundside.errors import UserError
from ftcc.sim.actuation import NO_AUTOTHROTTLE
from ftcc.sim.doors.px4 import PERIOD_US
from ftcc.sim.doors.sensors import Sizes
from ftcc.sim.doors.vehicle import why_unserved

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission

__all__ = ["DoorError", "field_of", "followers_of", "set_aside"]

_STRONGEST = 1.0
"""gauss; the earth's field has 0.22 to 0.67."""


class DoorError(UserError):
    """A flight behind doors that cannot begin."""


def followers_of(mission: Mission, uav: int | None = None) -> tuple[int, ...]:
    """Return the aircraft that fly behind doors: all followers, or ``uav`` alone.

    Raises
    ------
    DoorError
        If ``uav`` is no follower, or its plant cannot be flown by another autopilot.
    """
    flown = tuple(spec for spec in mission.vehicles if spec.kind == "aircraft" and uav in (None, spec.uav))
    if not flown:
        followers = ", ".join(str(spec.uav) for spec in mission.vehicles if spec.kind == "aircraft")
        raise DoorError(
            f"--uav {uav}: {mission.name} has the aircraft {followers} (leaders are points, nobody's aircraft)"
        )
    for spec in flown:
        why = why_unserved(spec, mission.timing.step_us, PERIOD_US)
        if why:
            raise DoorError(f"{mission.name}, UAV {spec.uav}: {why}")
    return tuple(spec.uav for spec in flown)


def set_aside(mission: Mission) -> tuple[str, ...]:
    """Return what of the scenario does not act behind a door."""
    parts = {
        "the autothrottle (the autopilot has the throttle)": any(
            spec.autothrottle != NO_AUTOTHROTTLE for spec in mission.vehicles
        ),
        "attacks (the other autopilot shares no records)": any(spec.attacks for spec in mission.autopilots),
        "faults of navigation": any(spec.navigation_faults for spec in mission.vehicles),
        "the measurement noise (doors have sensors)": any(any(spec.noise) for spec in mission.vehicles),
    }
    return tuple(part for part, given in parts.items() if given)


def field_of(text: str | None) -> Sizes:
    """Return the sensors' sizes with the earth's magnetic field "N,E,D" (gauss); None: that of the default home.

    Raises
    ------
    DoorError
        If it is no field.
    """
    if text is None:
        return Sizes()
    try:
        north, east, down = (float(part) for part in text.split(","))
    except ValueError:
        north = east = down = math.nan
    if not 0.0 < math.hypot(north, east, down) < _STRONGEST:
        raise DoorError(
            f"--field {text}: must be north,east,down in gauss, below {_STRONGEST:g}, as 0.2175,0.0133,0.4333"
        )
    return Sizes(field=(north, east, down))
