"""The vehicles of a process as plain arrays, whatever plant they fly.

One compiled function flies them, in the vehicle process and in the single-process simulation.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.link.events import EventList

__all__ = ["Fleet"]


class Fleet(NamedTuple):
    """The k vehicles of a process, a row each. Actuators stand in their slots, see ``link.actuators.SLOT``."""

    state: NDArray[np.float64]
    """(k, n): the plant's ``State``."""
    position: NDArray[np.float64]
    """(k, 4): actuator positions behind the lag."""
    command: NDArray[np.float64]
    """(k, 4): the command in force, as received."""
    acting: NDArray[np.float64]
    """(k, 4): what acts on the airframe."""
    limits: NDArray[np.float64]
    """(k, 4, 2): lower and upper limit of the command."""
    lag: NDArray[np.float64]
    """(k, 4): actuator bandwidth, rad/s; 0 = none."""
    rate: NDArray[np.float64]
    """(k, 4): fastest motion of the actuator, rad/s or N/s; inf = no limit."""
    damping: NDArray[np.float64]
    """(k, 4): 0 = first order; else the damping, below 1, of a second-order actuator whose frequency is ``lag``."""
    speed: NDArray[np.float64]
    """(k, 4): rate of the position of second-order actuators."""
    delayed: NDArray[np.float64]
    """(k, d, 4): commands that wait for ``d`` further samples before they are in force, the oldest first."""
    waiting: NDArray[np.int64]
    """(k,): 1 once the delay line is filled: by the first command, or from the start."""
    fault_before_lag: NDArray[np.float64]
    """(k,): 1 where a fault acts at the input of the lag, 0 where it acts on the position behind it."""
    faults: NDArray[np.float64]
    """(k, n, 10): see ``faults.Fault``, in order of time; unused rows have time inf."""
    fault_count: NDArray[np.int64]
    """(k,): rows in use."""
    deflection: NDArray[np.float64]
    """(k, 4): the acting deflections of the last step."""
    held: NDArray[np.float64]
    """(k, 4): what a stuck actuator holds."""
    held_since: NDArray[np.float64]
    """(k, 4): time of the fault by which it is stuck, s; inf = it is not."""
    navigation: NDArray[np.float64]
    """(k, n, 11): see ``navigation.NavigationFault``, in order of time; unused rows have time inf."""
    navigation_count: NDArray[np.int64]
    """(k,): rows in use."""
    solution: NDArray[np.float64]
    """(k, 13): the last fresh navigation solution, see ``messages.StateMessage``."""
    fresh: NDArray[np.float64]
    """(k, 2): time of the last fresh position and attitude, s; -1 = there was none."""
    updates: NDArray[np.int64]
    """(k, 2): updates of a slow solution that are past."""
    disturbances: NDArray[np.float64]
    """(k, n, 7): see ``disturbances.Disturbance``; unused rows have time inf."""
    code: NDArray[np.float64]
    """(k, 3): see ``attitude_target.AttitudeCode``."""
    gust_deviation: NDArray[np.float64]
    """(k,): see ``disturbances.Gust``."""
    gust_period_us: NDArray[np.int64]
    """(k,)."""
    gust_seed: NDArray[np.int64]
    """(k,)."""
    gusts: NDArray[np.float64]
    """(k, n, 6): see ``wind.DiscreteGust``; unused rows have time inf."""
    dryden: NDArray[np.float64]
    """(k, 3, 6): see ``wind.DrydenFilter``; zeros without turbulence."""
    turbulence: NDArray[np.float64]
    """(k, 3, 2): the states of its filters."""
    turns: NDArray[np.int64]
    """(k,): 1 where the air of the turbulence turns."""
    turning: NDArray[np.float64]
    """(k, 3, 7): see ``turning_air.TurnFilter``; zeros where it does not."""
    turned: NDArray[np.float64]
    """(k, 3): the states of its filters."""
    turbulence_seed: NDArray[np.int64]
    """(k,)."""
    still: NDArray[np.int64]
    """(k,): 1 where there are neither gusts nor turbulence: the air's motion stays 0."""
    guards: NDArray[np.float64]
    """(k, 4): see ``plant.Guards``."""
    airframe: NDArray[np.float64]
    """(k, m): the plant's ``Parameters``."""
    datum: NDArray[np.float64]
    """(k,): altitude from which that in the state message counts, m: float32 is exact only near zero."""
    offset: NDArray[np.float64]
    """(k,): lateral position y of a plant that flies in a vertical plane, m."""
    target: NDArray[np.float64]
    """(k, 7): where the vehicle is a `reference_point`: the target in force, see ``messages.PositionTarget``."""
    point: NDArray[np.int64]
    """(k,): 1 for a `reference_point`."""
    noise: NDArray[np.float64]
    """(k, 13): standard deviation of each measured channel, order of ``plant.TRUTH``, in its unit."""
    uav: NDArray[np.int64]
    """(k,): ids."""
    travel: NDArray[np.float64]
    """(k, 4): full deflection of each actuator."""
    zones: NDArray[np.float64]
    """(n, 3): the obstacles, see `obstacles.Obstacle`."""
    entered: NDArray[np.int64]
    """(k, n): 1 once a vehicle has entered the zone."""
    events: EventList
    """Not yet reported; their kinds are those of `obstacles`."""
    autothrottle: NDArray[np.float64]
    """(k, 3): see ``actuation.Autothrottle``."""
    speed_hold: NDArray[np.float64]
    """(k,): the thrust that it sets at present, N."""
    disturbed: NDArray[np.float64]
    """(k, d): room for the disturbances of a step, see the plant's ``Disturbances``."""
    driven: NDArray[np.float64]
    """(k, 7): what a vehicle's external model gets for a step, see ``jsbsim.flight.Driven``."""
    model: NDArray[np.int64]
    """(1,): address of the function that flies external models for a step, see ``link.callbacks``; 0 without any."""
