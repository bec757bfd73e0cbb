"""What an aircraft can still hold, by what it believes of itself: a speed to fly level at, an angle of attack."""

from __future__ import annotations

import math
from typing import NamedTuple

from ftcc.airside.diagnosis.arrays import Trial
from ftcc.airside.diagnosis.beliefs import FAULTY, SENSOR, UNDETERMINED, Belief
from ftcc.airside.diagnosis.estimator import RHO, B
from ftcc.airside.model import level_flight
from ftcc.airside.point_mass import drag
from ftcc.link.actuators import ELEVATOR, THRUST
from ftcc.link.compiled import compiled, fields

__all__ = ["Level", "end_of", "level_alpha", "level_speed"]

_RESERVE = 0.1
"""Share of an actuator's travel that a safe flight leaves unused, at either end."""
_KNOWN = 0.1
"""Deviation of what an actuator does at an end of its travel, share of that, below which it is known."""
_STEPS, _STEP = 20, 0.025
"""Speeds that are tried on either side of the wanted one, and their distance, shares of it."""
_LARGEST_ALPHA = 0.2
"""Short of the stall, rad."""


class Level(NamedTuple):
    """A straight flight."""

    V: float
    """m/s."""
    climb: float
    """m/s: 0, or the sink rate that is left where no speed can be held level."""
    spare: float
    """Climb rate that the thrust leaves there, m/s; may be negative."""


@compiled
def end_of(d, i, slot, limit):
    """What an actuator of UAV ``i`` does, rad or N, at the command ``limit``, and whether data say so.

    While a fault is undetermined its effect at an end of the travel may be known all the same: where the actuator has
    been there, effectiveness and additive effect are uncertain, but not what they do together. Without word from the
    data it does what is asked.
    """
    if d.has[i, slot] == 0:
        return limit, False
    belief = fields(Belief, d.belief[i, slot])
    if belief.state < UNDETERMINED or belief.kind >= SENSOR:
        return limit, False
    if belief.state != FAULTY:
        P = fields(Trial, d.trial[i, slot]).P
        variance = limit * limit * P[RHO, RHO] + 2.0 * limit * P[RHO, B] + P[B, B]
        if not variance < _KNOWN * _KNOWN * limit * limit:
            return limit, False
    return belief.effectiveness * limit + belief.bias, True


@compiled
def _end(d, i, slot, limit):
    value, _ = end_of(d, i, slot, limit)
    return value


@compiled
def _spare(d, i, V, model):
    """Least share of what its actuators can do that level flight at ``V`` leaves; below 0 there is no such flight."""
    thrust = _end(d, i, THRUST, model.thrust_max)
    if d.point[i] == 1:
        load = _end(d, i, ELEVATOR, d.travel[i, ELEVATOR])
        lifting = 0.5 * model.rho * V * V * model.S
        alpha = (model.m * model.g / lifting - model.CL0) / model.CLa
        return min(
            (thrust - drag(V, 1.0, model)) / model.thrust_max, load - 1.0, (_LARGEST_ALPHA - alpha) / _LARGEST_ALPHA
        )
    alpha, needed, elevator = level_flight(V, model)
    low, high = _end(d, i, ELEVATOR, model.elevator_min), _end(d, i, ELEVATOR, model.elevator_max)
    travel = model.elevator_max - model.elevator_min
    return min(
        (thrust - needed) / model.thrust_max,
        2.0 * min(elevator - low, high - elevator) / travel,
        (_LARGEST_ALPHA - alpha) / _LARGEST_ALPHA,
    )


@compiled
def level_speed(d, i, wanted, model):
    """The `Level` flight of UAV ``i`` nearest to the airspeed ``wanted`` (m/s) that leaves its actuators a reserve.

    Where there is none, the one that leaves the most; if its thrust is too small for that, it sinks.
    """
    best, V = -math.inf, wanted
    for n in range(2 * _STEPS + 1):
        away = (n + 1) // 2 * (1 if n % 2 == 1 else -1)
        tried = wanted * (1.0 + _STEP * away)
        spare = min(_spare(d, i, tried, model), _RESERVE)
        if spare > best:
            best, V = spare, tried
    thrust = _end(d, i, THRUST, model.thrust_max)
    needed = drag(V, 1.0, model) if d.point[i] == 1 else level_flight(V, model)[1]
    spare_climb = (thrust - needed) * V / (model.m * model.g)
    return Level(V, min(spare_climb, 0.0), spare_climb)


@compiled
def level_alpha(d, i, V, model):
    """Angle of attack (rad) of level flight at ``V``, as far as the elevator of UAV ``i`` can hold it."""
    alpha, _, _ = level_flight(V, model)
    margin = _RESERVE * 0.5 * (model.elevator_max - model.elevator_min)
    low = _end(d, i, ELEVATOR, model.elevator_min) + margin
    high = _end(d, i, ELEVATOR, model.elevator_max) - margin
    steep, flat = -(model.Cm0 + model.Cmde * low) / model.Cma, -(model.Cm0 + model.Cmde * high) / model.Cma
    return min(max(alpha, min(steep, flat)), max(steep, flat))
