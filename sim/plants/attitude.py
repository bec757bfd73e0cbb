"""The aircraft in six degrees of freedom, eqs. (2.1)-(2.7): aileron, elevator, rudder and thrust.

States are over the ground: V, chi and gamma are those of the velocity over the ground, mu, alpha and beta the attitude
against it, and that is what is measured; in still air it is the velocity through the air. Forces and moments are those
of the air velocity. The mean wind blows north.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from ftcc.link.compiled import compiled
from ftcc.link.rotation import body_attitude, wrapped
from ftcc.sim.airframe import Airframe, Deflections, attitude_rates, turning_rates
from ftcc.sim.plant import (
    ALPHA,
    BETA,
    CHI,
    GAMMA,
    MU,
    NUMBER,
    THETA,
    P,
    Q,
    R,
    V,
    X,
    Y,
    Z,
    beyond,
)
from ftcc.sim.plants.longitudinal import DISTURBANCES, Disturbances, level
from ftcc.sim.turning_air import about_body_axes
from ftcc.sim.wind import acceleration, against, wind_speed

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
    "alpha_at_start",
    "complete",
    "initial",
    "level",
    "lost",
    "rates",
    "truth",
]


class State(NamedTuple):
    """Motion of a rigid aircraft over the ground."""

    x: float
    """Position north, m."""
    y: float
    """Position east, m."""
    z: float
    """Altitude, m."""
    V: float
    """Speed over the ground, m/s."""
    chi: float
    """Course, rad; not wrapped."""
    gamma: float
    """Flight-path angle, rad."""
    mu: float
    """Bank about the velocity, rad; not wrapped."""
    alpha: float
    """Angle of attack against the velocity over the ground, rad."""
    beta: float
    """Sideslip likewise, rad."""
    p: float
    q: float
    r: float
    """Body rates, rad/s."""


Inputs = Deflections
Parameters = Airframe
ACTUATORS = ("thrust", "elevator", "aileron", "rudder")
COMPLETED = ("theta",)
SERVES = ("attitude", "longitudinal")
START = (*State._fields, "theta")


@compiled
def _rates_in_wind(s, u, d, a):
    """As `attitude_rates`, where the air moves."""
    cg, sg, cc, sc = math.cos(s.gamma), math.sin(s.gamma), math.cos(s.chi), math.sin(s.chi)
    q0, q1, q2, q3 = body_attitude(s.chi, s.gamma, s.mu, s.alpha, s.beta)
    speed, gamma, chi, mu, alpha, beta = against(
        q0, q1, q2, q3,
        s.V * cg * cc - wind_speed(s.z, d.wind, d.gust) - d.wind_along * cc + d.wind_right * sc,
        s.V * cg * sc - d.wind_along * sc - d.wind_right * cc,
        s.V * sg - d.wind_up,
    )  # fmt: skip
    p_g, q_g, r_g = d.p_g, d.q_g, d.r_g
    if p_g != 0.0 or q_g != 0.0 or r_g != 0.0:
        p_g, q_g, r_g = about_body_axes(q0, q1, q2, q3, cc, sc, p_g, q_g, r_g)
    speed_rate, chi_rate, gamma_rate, _, _, _, p_dot, q_dot, r_dot = attitude_rates(
        speed, gamma, mu, alpha, beta, s.p, s.q, s.r,
        u.aileron, u.elevator, u.rudder, u.thrust, 0.0, 0.0, d.d3, a, p_g, q_g, r_g,
    )  # fmt: skip
    # The rates of the air path in still air are the acceleration on its triad, whatever the wind does.
    north, east, up = acceleration(speed, gamma, chi, speed_rate, gamma_rate, chi_rate)
    V_dot = cg * (north * cc + east * sc) + up * sg + d.d1
    chi_dot = (east * cc - north * sc) / (s.V * cg)
    gamma_dot = (up * cg - sg * (north * cc + east * sc)) / s.V + d.d2
    mu_dot, alpha_dot, beta_dot = turning_rates(s.gamma, s.mu, s.alpha, s.beta, s.p, s.q, s.r, chi_dot, gamma_dot)
    return V_dot, chi_dot, gamma_dot, mu_dot, alpha_dot, beta_dot, p_dot, q_dot, r_dot


@compiled
def rates(s, u, d, a):
    """Rates of `State` under the deflections ``u`` and disturbances ``d`` of the airframe ``a``."""
    still = d.wind == 0.0 and d.gust == 0.0 and d.wind_along == 0.0 and d.wind_right == 0.0 and d.wind_up == 0.0
    if still:
        V_dot, chi_dot, gamma_dot, mu_dot, alpha_dot, beta_dot, p_dot, q_dot, r_dot = attitude_rates(
            s.V, s.gamma, s.mu, s.alpha, s.beta, s.p, s.q, s.r,
            u.aileron, u.elevator, u.rudder, u.thrust, d.d1, d.d2, d.d3, a, 0.0, 0.0, 0.0,
        )  # fmt: skip
    else:
        V_dot, chi_dot, gamma_dot, mu_dot, alpha_dot, beta_dot, p_dot, q_dot, r_dot = _rates_in_wind(s, u, d, a)
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
    """Speed over the ground, m/s; in still air the airspeed."""
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
    return beyond(s.V, s.gamma, s.alpha, s.beta, guards)


def initial(start: Mapping[str, float], steady: Mapping[str, float]) -> State:
    """`State` of an aircraft that starts as ``start`` says, for the rest in the flight of `level`.

    Raises
    ------
    ValueError
        If pitch and angle of attack are both given, or no angle of attack gives that pitch.
    """
    gamma, mu, beta = (start.get(name, 0.0) for name in ("gamma", "mu", "beta"))
    alpha = alpha_at_start(start, steady, gamma, mu, beta)
    free = {name: start.get(name, 0.0) for name in State._fields if name not in ("V", "z", "gamma", "alpha")}
    return State(V=start["V"], z=start["z"], gamma=gamma, alpha=alpha, **free)


def alpha_at_start(
    start: Mapping[str, float], steady: Mapping[str, float], gamma: float, mu: float, beta: float
) -> float:
    """Angle of attack at the start: given, from the pitch that is given, or that of steady flight; rad.

    Raises
    ------
    ValueError
        If pitch and angle of attack are both given, or no angle of attack gives that pitch.
    """
    if "theta" in start:
        if "alpha" in start:
            raise ValueError("theta and alpha are both given; the one follows from the other")
        return _alpha_of(start["theta"], gamma, mu, beta)
    return start.get("alpha", steady["alpha"])


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
