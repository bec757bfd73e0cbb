"""An aircraft of JSBSim, flown by thrust and surfaces: it gets deflections and moving air, and tells its motion.

Deflections (rad) become commands to its flight controls, and thrust (N) a throttle, by the maps of
`ftcc.sim.jsbsim.controls`; engine, propeller, atmosphere and gravity are JSBSim's. States are over the ground, as on
plant `attitude`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from ftcc.link.airframe import Airframe
from ftcc.link.compiled import compiled
from ftcc.link.rotation import body_attitude
from ftcc.sim.airframe import Deflections
from ftcc.sim.jsbsim.flight import Driven, FlownAircraft, ModelState
from ftcc.sim.jsbsim.steady import Steady, steady_flight
from ftcc.sim.plant import MODEL, beyond
from ftcc.sim.plants.attitude import COMPLETED, START, alpha_at_start, complete
from ftcc.sim.plants.guided import airspeed, truth
from ftcc.sim.wind import AIR_CHANNELS, against, wind_speed

__all__ = [
    "ACTUATORS",
    "COMPLETED",
    "DISTURBANCES",
    "SERVES",
    "START",
    "Disturbances",
    "Inputs",
    "Parameters",
    "State",
    "airspeed",
    "complete",
    "driven",
    "initial",
    "level",
    "lost",
    "rates",
    "truth",
    "wind_of",
]


class Disturbances(NamedTuple):
    """See `DISTURBANCES`."""

    wind: float
    gust: float
    wind_along: float
    wind_right: float
    wind_up: float


State = ModelState
Inputs = Deflections
Parameters = Airframe
"""The nominal model: the aircraft's own numbers are JSBSim's."""
ACTUATORS = ("thrust", "elevator", "aileron", "rudder")
DISTURBANCES = AIR_CHANNELS
SERVES = ("attitude", "longitudinal")


@compiled
def rates(s, u, d, a):
    """Zeros: all that it is moves by JSBSim."""
    return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0


@compiled
def wind_of(s, d):
    """Motion of the air at the aircraft: north, east and up, m/s."""
    ground = math.sqrt(s.vx * s.vx + s.vy * s.vy)
    north, east = wind_speed(s.z, d.wind, d.gust), 0.0
    if ground > 0.0:
        north += (d.wind_along * s.vx - d.wind_right * s.vy) / ground
        east += (d.wind_along * s.vy + d.wind_right * s.vx) / ground
    return north, east, d.wind_up


@compiled
def driven(s, u, d, a):
    """What JSBSim gets for a step: deflections, thrust and the motion of the air."""
    north, east, up = wind_of(s, d)
    return Driven(u.aileron, u.elevator, u.rudder, u.thrust, north, east, up)


@compiled
def lost(s, guards):
    """Why a vehicle in this state is lost, a key of ``plant.LOST``; 0 if it is not."""
    speed, gamma, _, _, alpha, beta = against(s.q0, s.q1, s.q2, s.q3, s.vx, s.vy, s.vz)
    if not (speed + abs(s.z) + abs(s.p) + abs(s.q) + abs(s.r) + abs(alpha) + abs(beta) < math.inf):
        return MODEL
    return beyond(speed, gamma, alpha, beta, guards)


def initial(start: Mapping[str, float], steady: Mapping[str, float]) -> State:
    """`State` of an aircraft that starts as ``start`` says, for the rest in the flight of `level`.

    Raises
    ------
    ValueError
        If pitch and angle of attack are both given, or no angle of attack gives that pitch.
    """
    speed, gamma, chi, beta = start["V"], start.get("gamma", 0.0), start.get("chi", 0.0), start.get("beta", 0.0)
    mu = start.get("mu", steady["mu"])
    alpha = alpha_at_start(start, steady, gamma, mu, beta)
    ground = speed * math.cos(gamma)
    return State(
        start.get("x", 0.0),
        start.get("y", 0.0),
        start["z"],
        ground * math.cos(chi),
        ground * math.sin(chi),
        speed * math.sin(gamma),
        *body_attitude(chi, gamma, mu, alpha, beta),
        *(start.get(name, 0.0) for name in ("p", "q", "r")),
    )


def level(airframe: Airframe, V: float, flown: FlownAircraft, **disturbances: float) -> Steady:
    """Level flight at ``V`` (m/s) in still air, whatever disturbs; raises TrimError where there is none."""
    return steady_flight(flown.aircraft, flown.controls, V, flown.altitude)
