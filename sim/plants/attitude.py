"""The aircraft in six degrees of freedom, eqs. (2.1)-(2.7): aileron, elevator, rudder and thrust."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from ftcc.link.compiled import compiled
from ftcc.link.rotation import wrapped
from ftcc.sim.airframe import Airframe, Deflections, attitude_rates
from ftcc.sim.plant import (
    AIRSPEED,
    ALPHA,
    BETA,
    CHI,
    CLIMB,
    GAMMA,
    INCIDENCE,
    MU,
    NUMBER,
    SIDESLIP,
    THETA,
    P,
    Q,
    R,
    V,
    X,
    Y,
    Z,
)
from ftcc.sim.plants.longitudinal import DISTURBANCES, Disturbances, level

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
    """Motion of a rigid aircraft in still air."""

    x: float
    """Position north, m."""
    y: float
    """Position east, m."""
    z: float
    """Altitude, m."""
    V: float
    """Airspeed, m/s."""
    chi: float
    """Course, rad; not wrapped."""
    gamma: float
    """Flight-path angle, rad."""
    mu: float
    """Bank about the velocity, rad; not wrapped."""
    alpha: float
    """Angle of attack, rad."""
    beta: float
    """Sideslip, rad."""
    p: float
    q: float
    r: float
    """Body rates, rad/s."""


Inputs = Deflections
Parameters = Airframe
ACTUATORS = ("thrust", "elevator", "aileron", "rudder")
COMPLETED = ("theta",)
SERVES = ("attitude", "longitudinal")
START = ("V", "x", "y", "z", "gamma", "theta", "q", "chi", "mu", "alpha", "beta", "p", "r")


@compiled
def rates(s, u, d, a):
    """Rates of `State` under the deflections ``u`` and disturbances ``d`` of the airframe ``a``."""
    V_dot, chi_dot, gamma_dot, mu_dot, alpha_dot, beta_dot, p_dot, q_dot, r_dot = attitude_rates(
        s.V, s.gamma, s.mu, s.alpha, s.beta, s.p, s.q, s.r,
        u.aileron, u.elevator, u.rudder, u.thrust, d.d1, d.d2, d.d3, a,
    )  # fmt: skip
    ground = s.V * math.cos(s.gamma)
    return (
        ground * math.cos(s.chi),
        ground * math.sin(s.chi),
        s.V * math.sin(s.gamma),
        V_dot,
        chi_dot,
        gamma_dot,
        mu_dot,
        alpha_dot,
        beta_dot,
        p_dot,
        q_dot,
        r_dot,
    )


@compiled
def airspeed(s):
    """Airspeed, m/s."""
    return s.V


@compiled
def truth(s, u, offset, out):
    """Write the channels of ``plant.TRUTH`` that are states, course and bank within +-pi."""
    out[X], out[Y], out[Z], out[V] = s.x, s.y, s.z, s.V
    out[GAMMA], out[CHI] = s.gamma, wrapped(s.chi)
    out[MU], out[ALPHA], out[BETA] = wrapped(s.mu), s.alpha, s.beta
    out[P], out[Q], out[R] = s.p, s.q, s.r


@compiled
def complete(out):
    """Pitch angle, from the path, the bank about it, sideslip and angle of attack."""
    sin_pitch = math.sin(out[GAMMA]) * math.cos(out[ALPHA]) * math.cos(out[BETA]) + math.cos(out[GAMMA]) * (
        math.cos(out[ALPHA]) * math.sin(out[BETA]) * math.sin(out[MU]) + math.sin(out[ALPHA]) * math.cos(out[MU])
    )
    out[THETA] = math.asin(min(max(sin_pitch, -1.0), 1.0))


@compiled
def lost(s, guards):
    """Why a vehicle in this state is lost, a key of ``plant.LOST``; 0 if it is not."""
    moving = abs(s.p) + abs(s.q) + abs(s.r) + abs(s.chi) + abs(s.mu)
    if not (s.V + moving + abs(s.gamma) + abs(s.alpha) + abs(s.beta) < math.inf):
        return NUMBER
    if guards.least_airspeed > s.V:
        return AIRSPEED
    if abs(s.gamma) > guards.flight_path_angle:
        return CLIMB
    if abs(s.alpha) > guards.angle_of_attack:
        return INCIDENCE
    if abs(s.beta) > guards.sideslip:
        return SIDESLIP
    return 0


def initial(start: Mapping[str, float], steady: Mapping[str, float]) -> State:
    """`State` of an aircraft that starts as ``start`` says, for the rest in the flight of `level`.

    Raises
    ------
    ValueError
        If pitch and angle of attack are both given, or no angle of attack gives that pitch.
    """
    gamma, mu, beta = (start.get(name, 0.0) for name in ("gamma", "mu", "beta"))
    alpha = start.get("alpha", steady["alpha"])
    if "theta" in start:
        if "alpha" in start:
            raise ValueError("theta and alpha are both given; the one follows from the other")
        alpha = _alpha_of(start["theta"], gamma, mu, beta)
    free = {name: start.get(name, 0.0) for name in State._fields if name not in ("V", "z", "gamma", "alpha")}
    return State(V=start["V"], z=start["z"], gamma=gamma, alpha=alpha, **free)


def _alpha_of(theta: float, gamma: float, mu: float, beta: float) -> float:
    """Angle of attack of an aircraft with that pitch: the inverse of `complete`."""
    if mu == beta == 0.0:
        return theta - gamma
    level = math.sin(gamma) * math.cos(beta) + math.cos(gamma) * math.sin(beta) * math.sin(mu)
    upright = math.cos(gamma) * math.cos(mu)
    most = math.hypot(level, upright)
    if abs(math.sin(theta)) > most:
        raise ValueError(f"theta = {theta:g}: no angle of attack gives that pitch in a bank of {mu:g}")
    return math.asin(math.sin(theta) / most) - math.atan2(level, upright)
