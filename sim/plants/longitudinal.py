"""The aircraft in its vertical plane, eqs. (2.8)-(2.12): thrust and elevator."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from ftcc.link.compiled import compiled
from ftcc.sim.airframe import Airframe, Deflections, longitudinal_rates
from ftcc.sim.plant import AIRSPEED, ALPHA, CLIMB, GAMMA, INCIDENCE, NUMBER, THETA, Q, V, X, Y, Z
from ftcc.sim.trim import Trim, trim

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
    """Airspeed, m/s."""
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
    """Added to the rates, see `DISTURBANCES`."""

    d1: float
    d2: float
    d3: float


Inputs = Deflections
Parameters = Airframe
ACTUATORS = ("thrust", "elevator")
DISTURBANCES = (("d1", "m/s^2"), ("d2", "rad/s"), ("d3", "rad/s^2"))
COMPLETED = ("alpha",)
SERVES = ("longitudinal",)
START = ("V", "x", "y", "z", "gamma", "theta", "q")


@compiled
def rates(s, u, d, a):
    """Rates of `State` under the deflections ``u`` and disturbances ``d`` of the airframe ``a``."""
    return longitudinal_rates(s.V, s.gamma, s.theta, s.q, u.thrust, u.elevator, d.d1, d.d2, d.d3, a)


@compiled
def airspeed(s):
    """Airspeed, m/s."""
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
    """Level flight at ``V`` (m/s) under constant disturbances; raises TrimError where there is none."""
    return trim(airframe, V, **disturbances)
