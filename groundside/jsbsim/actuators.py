"""Travel, lag and rate limit of the actuators of a JSBSim aircraft."""

from __future__ import annotations

import math
from typing import NamedTuple

from ftcc.groundside.schema import Plan
from ftcc.link.actuators import ACTUATORS

__all__ = ["STANDARD_TRAVEL", "Actuator", "actuators_of"]

STANDARD_TRAVEL = math.radians(30.0)
"""Of a surface whose travel nobody gives, to both sides, rad."""


class Actuator(NamedTuple):
    """How an actuator moves; the same as ours, see `ftcc.sim.actuation`."""

    lowest: float
    """rad or N."""
    highest: float
    lag: float = 0.0
    """Bandwidth, or with ``damping`` the natural frequency, rad/s; 0 = none."""
    rate: float = math.inf
    """rad/s or N/s."""
    damping: float = 0.0
    """Of a second-order actuator, below 1; 0 = first order."""

    @property
    def travel(self) -> float:
        """What a command of 1 stands for, rad or N."""
        return max(abs(self.lowest), abs(self.highest))


def actuators_of(plan: Plan | None, full_thrust: float) -> dict[str, Actuator]:
    """Return the actuators by name, as the plant of a scenario has them.

    Without a scenario there is no lag and no rate limit. A surface without a travel has `STANDARD_TRAVEL`, the engine
    one from 0 to ``full_thrust`` (N).
    """
    standard = dict.fromkeys(ACTUATORS, (-STANDARD_TRAVEL, STANDARD_TRAVEL)) | {"thrust": (0.0, full_thrust)}
    if plan is None:
        return {name: Actuator(*travel) for name, travel in standard.items()}
    plant = plan.plant
    found = {}
    for name, travel in standard.items():
        lowest, highest = getattr(plant.limits, name) or travel
        lag, rate, damping = (float(getattr(table, name)) for table in (plant.lag, plant.rate_limits, plant.damping))
        found[name] = Actuator(float(lowest), float(highest), lag, rate, damping if lag > 0.0 else 0.0)
    return found
