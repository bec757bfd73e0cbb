"""The aircraft in its vertical plane, eqs. (2.8)-(2.12): thrust and elevator.

States are over the ground: V and gamma are those of the velocity over the ground, which is what is measured; in still
air they are airspeed and climb against the air. Forces and moment are those of the air velocity. It flies north, as the
mean wind blows; a wind from the side has no effect in the plane.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from ftcc.link.compiled import compiled, compiled_apart
from ftcc.sim.airframe import Airframe, Deflections, longitudinal_rates
from ftcc.sim.plant import AIRSPEED, ALPHA, CLIMB, GAMMA, INCIDENCE, NUMBER, THETA, Q, V, X, Y, Z
from ftcc.sim.trim import Trim, trim
from ftcc.sim.wind import AIR_CHANNELS, wind_speed

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
    "initial",
    "level",
    "lost",
    "rates",
    "truth",
]


class State(NamedTuple):
    """Longitudinal motion."""

    V: float
    """Speed over the ground, m/s."""
    x: float
    """Forward position, m."""
    z: float
    """Altitude, m."""
    gamma: float
    """Flight-path angle, rad."""
    theta: float
    """Pitch angle, rad."""
    q: float
    """Pitch rate, rad/s."""


class Disturbances(NamedTuple):
    """Added to the rates, and the motion of the air, see `DISTURBANCES`; then its rotation, rad/s."""

    d1: float
    d2: float
    d3: float
    wind: float = 0.0
    gust: float = 0.0
    wind_along: float = 0.0
    wind_right: float = 0.0
    wind_up: float = 0.0
    p_g: float = 0.0
    q_g: float = 0.0
    r_g: float = 0.0


Inputs = Deflections
Parameters = Airframe
ACTUATORS = ("thrust", "elevator")
DISTURBANCES = (("d1", "m/s^2"), ("d2", "rad/s"), ("d3", "rad/s^2"), *AIR_CHANNELS)
COMPLETED = ("alpha",)
SERVES = ("longitudinal",)
START = (*State._fields, "y")


@compiled_apart
def _rates_in_wind(s, u, d, a):
    """As `longitudinal_rates`, where the air moves."""
    ahead = wind_speed(s.z, d.wind, d.gust) + d.wind_along
    vx, vz = s.V * math.cos(s.gamma), s.V * math.sin(s.gamma)
    forward, climb = vx - ahead, vz - d.wind_up
    speed, gamma = math.sqrt(forward * forward + climb * climb), math.atan2(climb, forward)
    # The rates of the air path in still air are the acceleration along and across it, whatever the wind does.
    along, _, _, turning, _, q_dot = longitudinal_rates(
        speed, gamma, s.theta, s.q, u.thrust, u.elevator, 0.0, 0.0, d.d3, a, d.q_g
    )
    across, apart = speed * turning, gamma - s.gamma
    return (
        along * math.cos(apart) - across * math.sin(apart) + d.d1,
        vx,
        vz,
        (along * math.sin(apart) + across * math.cos(apart)) / s.V + d.d2,
        s.q,
        q_dot,
    )


@compiled
def rates(s, u, d, a):
    """Rates of `State` under the deflections ``u`` and disturbances ``d`` of the airframe ``a``."""
    if d.wind == 0.0 and d.gust == 0.0 and d.wind_along == 0.0 and d.wind_up == 0.0:
        return longitudinal_rates(s.V, s.gamma, s.theta, s.q, u.thrust, u.elevator, d.d1, d.d2, d.d3, a, 0.0)
    return _rates_in_wind(s, u, d, a)


@compiled
def airspeed(s):
    """Speed over the ground, m/s; in still air the airspeed."""
    return s.V


@compiled
def truth(s, u, offset, out):
    """Write the channels of ``plant.TRUTH`` that are states; the plane lies at the lateral position ``offset``."""
    out[V], out[X], out[Y], out[Z] = s.V, s.x, offset, s.z
    out[GAMMA], out[THETA], out[Q] = s.gamma, s.theta, s.q


@compiled
def complete(out):
    """Angle of attack: the difference of pitch and flight-path angle, also as measured."""
    out[ALPHA] += out[THETA] - out[GAMMA] - out[ALPHA]


@compiled
def lost(s, guards):
    """Why a vehicle in this state is lost, a key of ``plant.LOST``; 0 if it is not."""
    if not (guards.least_airspeed <= s.V):
        return AIRSPEED if s.V == s.V else NUMBER
    if abs(s.gamma) > guards.flight_path_angle:
        return CLIMB
    if abs(s.theta - s.gamma) > guards.angle_of_attack:
        return INCIDENCE
    return 0


def initial(start: Mapping[str, float], steady: Mapping[str, float]) -> tuple[float, ...]:
    """`State` of an aircraft that starts as ``start`` says, for the rest in the flight of `level`."""
    gamma = start.get("gamma", 0.0)
    theta = start.get("theta", steady["alpha"] + gamma)
    return State(start["V"], start.get("x", 0.0), start["z"], gamma, theta, start.get("q", 0.0))


def level(airframe: Airframe, V: float, **disturbances: float) -> Trim:
    """Level flight at ``V`` (m/s) in still air under constant disturbances; raises TrimError where there is none."""
    return trim(airframe, V, **{name: disturbances.get(name, 0.0) for name in ("d1", "d2", "d3")})
