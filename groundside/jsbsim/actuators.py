"""Travel, lag and rate limit of the actuators of a JSBSim aircraft."""

from __future__ import annotations

import math
from typing import NamedTuple

from ftcc.groundside.errors import UserError
from ftcc.groundside.schema import Plan
from ftcc.link.actuators import ACTUATORS

__all__ = ["STANDARD_TRAVEL", "Actuator", "ActuatorError", "actuators_of"]

STANDARD_TRAVEL = math.radians(30.0)
"""Of a surface whose travel nobody gives, to both sides, rad."""


class ActuatorError(UserError):
    """Actuators that cannot be written."""


class Actuator(NamedTuple):
    """How an actuator moves; the same as ours, see `ftcc.sim.actuation`."""

    lowest: float
    """rad or N."""
    highest: float
    lag: float = 0.0
    """Bandwidth of the first-order lag, rad/s; 0 = none."""
    rate: float = math.inf
    """rad/s or N/s."""

    @property
    def travel(self) -> float:
        """What a command of 1 stands for, rad or N."""
        return max(abs(self.lowest), abs(self.highest))


def actuators_of(plan: Plan | None, full_thrust: float) -> dict[str, Actuator]:
    """Return the actuators by name, as the plant of a scenario has them.

    Without a scenario there is no lag and no rate limit. A surface without a travel has `STANDARD_TRAVEL`, the engine
    one from 0 to ``full_thrust`` (N).

    Raises
    ------
    ActuatorError
        For actuators of second order: JSBSim's second-order filter starts at zero, wherever its command is.
    """
    standard = dict.fromkeys(ACTUATORS, (-STANDARD_TRAVEL, STANDARD_TRAVEL)) | {"thrust": (0.0, full_thrust)}
    if plan is None:
        return {name: Actuator(*travel) for name, travel in standard.items()}
    plant = plan.plant
    found = {}
    for name, travel in standard.items():
        lowest, highest = getattr(plant.limits, name) or travel
        lag, rate, damping = (float(getattr(table, name)) for table in (plant.lag, plant.rate_limits, plant.damping))
        if damping > 0.0:
            raise ActuatorError(
                f"plant.damping.{name} = {damping:g}: must be 0; the actuators of a JSBSim aircraft are of first order"
            )
        found[name] = Actuator(float(lowest), float(highest), lag, rate)
    return found
