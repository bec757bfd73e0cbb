"""The aircraft as a point, eqs. (2.15)-(2.16): thrust, load factor and bank; drag (9.32) in the wind of (9.33).

Integrated as one acceleration of the velocity, which has no singularity in climb. An inner attitude loop is assumed;
`ftcc.sim.actuation` gives it its lag. That loop holds load factor and bank against gusts and turbulence
too: these change the drag, and the direction of the forces, which are those of the air velocity. Wind and gust of
(9.33) enter the drag alone, as printed. States and what is measured are over the ground.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from ftcc.link.airframe import PointMass
from ftcc.link.compiled import compiled
from ftcc.link.rotation import wrapped
from ftcc.sim.plant import AIRSPEED, CHI, CLIMB, GAMMA, MU, NUMBER, THETA, V, X, Y, Z
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
    "drag",
    "initial",
    "level",
    "lost",
    "rates",
    "truth",
    "wind_speed",
]


class State(NamedTuple):
    """Position (m) and velocity (m/s), north, east and up."""

    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float


class Inputs(NamedTuple):
    """What acts, by slot."""

    bank: float
    """rad, right wing down > 0."""
    load_factor: float
    """L / (m g)."""
    unused: float
    thrust: float
    """N."""


class Disturbances(NamedTuple):
    """See `DISTURBANCES`."""

    b_x: float
    b_y: float
    b_z: float
    wind: float = 0.0
    gust: float = 0.0
    wind_along: float = 0.0
    wind_right: float = 0.0
    wind_up: float = 0.0


class Level(NamedTuple):
    """Level flight in still air."""

    thrust: float
    """N."""
    load_factor: float
    bank: float
    """rad."""


Parameters = PointMass
ACTUATORS = ("thrust", "load_factor", "bank")
COMPLETED = ("theta",)
DISTURBANCES = (("b_x", "m/s^2"), ("b_y", "m/s^2"), ("b_z", "m/s^2"), *AIR_CHANNELS)
"""Accelerations north, east and up; mean wind V_m and gust A of (9.33), along the track; the motion of the air."""
SERVES = ("position",)
START = ("V", "x", "y", "z", "gamma", "chi")

_LEAST_AIRSPEED = 1.0
"""Guard of the induced drag against division by zero, m/s."""


@compiled
def drag(airspeed, load_factor, a):
    """Drag (N), eq. (9.32), with g^2 as printed, which makes the induced part negligible."""
    square = max(airspeed, _LEAST_AIRSPEED) * max(airspeed, _LEAST_AIRSPEED)
    lift = load_factor * a.m * a.g
    return 0.5 * a.rho * square * a.S * a.CD0 + 2.0 * a.kd * a.kn * a.kn * lift * lift / (
        a.g * a.g * a.rho * square * a.S
    )


@compiled
def rates(s, u, d, a):
    """Rates of `State` under the inputs ``u`` and disturbances ``d``; thrust cannot brake, whatever its fault says."""
    vx, vy, vz = s.vx, s.vy, s.vz
    ground = math.sqrt(vx * vx + vy * vy)
    if d.wind_along != 0.0 or d.wind_right != 0.0 or d.wind_up != 0.0:
        vx -= (d.wind_along * s.vx - d.wind_right * s.vy) / ground
        vy -= (d.wind_along * s.vy + d.wind_right * s.vx) / ground
        vz -= d.wind_up
        ground = math.sqrt(vx * vx + vy * vy)
    speed = math.sqrt(ground * ground + vz * vz)
    cos_gamma, sin_gamma = ground / speed, vz / speed
    cos_chi, sin_chi = vx / ground, vy / ground
    along = (max(u.thrust, 0.0) - drag(speed - wind_speed(s.z, d.wind, d.gust), u.load_factor, a)) / a.m
    right = a.g * u.load_factor * math.sin(u.bank)
    up = a.g * u.load_factor * math.cos(u.bank)
    return (
        s.vx,
        s.vy,
        s.vz,
        along * cos_gamma * cos_chi - right * sin_chi - up * sin_gamma * cos_chi + d.b_x,
        along * cos_gamma * sin_chi + right * cos_chi - up * sin_gamma * sin_chi + d.b_y,
        along * sin_gamma + up * cos_gamma - a.g + d.b_z,
    )


@compiled
def airspeed(s):
    """Speed over the ground, m/s; the wind enters the drag alone."""
    return math.sqrt(s.vx * s.vx + s.vy * s.vy + s.vz * s.vz)


@compiled
def truth(s, u, offset, out):
    """Write the channels of ``plant.TRUTH`` that are states, and the bank that acts; V is the ground speed."""
    ground = math.sqrt(s.vx * s.vx + s.vy * s.vy)
    out[X], out[Y], out[Z] = s.x, s.y, s.z
    out[V] = math.sqrt(ground * ground + s.vz * s.vz)
    out[GAMMA] = math.atan2(s.vz, ground)
    out[CHI] = math.atan2(s.vy, s.vx)
    out[MU] = wrapped(u.bank)


@compiled
def complete(out):
    """The nose points along the path: pitch is the flight-path angle, also as measured."""
    out[THETA] = out[GAMMA]


@compiled
def lost(s, guards):
    """Why a vehicle in this state is lost, a key of ``plant.LOST``; 0 if it is not."""
    ground = math.sqrt(s.vx * s.vx + s.vy * s.vy)
    speed = math.sqrt(ground * ground + s.vz * s.vz)
    if not (speed >= guards.least_airspeed):
        return AIRSPEED if speed == speed else NUMBER
    if abs(math.atan2(s.vz, ground)) > guards.flight_path_angle:
        return CLIMB
    return 0


def initial(start: Mapping[str, float], steady: Mapping[str, float]) -> tuple[float, ...]:
    """`State` of an aircraft that starts as ``start`` says."""
    speed, gamma, chi = start["V"], start.get("gamma", 0.0), start.get("chi", 0.0)
    ground = speed * math.cos(gamma)
    place = (start.get("x", 0.0), start.get("y", 0.0), start["z"])
    return State(*place, ground * math.cos(chi), ground * math.sin(chi), speed * math.sin(gamma))


def level(airframe: Parameters, V: float, **disturbances: float) -> Level:
    """Level flight at ``V`` (m/s): thrust as the drag in still air, whatever disturbs."""
    return Level(float(drag(float(V), 1.0, airframe)), 1.0, 0.0)
