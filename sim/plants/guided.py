"""The 6-DoF aircraft, eqs. (2.1)-(2.7), under its own inner loop: it takes thrust, load factor and bank as demands.

Motion over the ground in true wind: forces are those of the air velocity. Faults act on the three demands, ahead of the
loop (`ftcc.sim.inner_loop`); the surfaces behind it have a lag, a rate limit and stops of their own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from ftcc.link.compiled import compiled
from ftcc.sim.airframe import Airframe, attitude_rates
from ftcc.sim.inner_loop import LoopState, deflections, load_factor, loop_rates
from ftcc.sim.plant import (
    ALPHA,
    BETA,
    CHI,
    GAMMA,
    MU,
    NUMBER,
    P,
    Q,
    R,
    V,
    X,
    Y,
    Z,
    beyond,
)
from ftcc.sim.plants.attitude import COMPLETED, complete
from ftcc.sim.plants.position import ACTUATORS, DISTURBANCES, SERVES, Inputs
from ftcc.sim.trim import trim
from ftcc.sim.turning_air import about_body_axes
from ftcc.sim.wind import acceleration, against, wind_speed

__all__ = [
    "ACTUATORS",
    "BY_ATTITUDE",
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
    "surface_rate",
    "truth",
]

Parameters = Airframe
BY_ATTITUDE = True
"""Its commands travel as attitude targets."""
START = ("V", "x", "y", "z", "gamma", "chi")

_SURFACE_LAG = 20.0
"""Bandwidth of the surfaces, rad/s."""
_SURFACE_RATE = 4.0
"""rad/s."""
_SURFACE_STOP = math.radians(30.0)


class State(NamedTuple):
    """Motion over the ground, surfaces and inner loop."""

    x: float
    """North, m."""
    y: float
    """East, m."""
    z: float
    """Up, m."""
    vx: float
    """m/s."""
    vy: float
    vz: float
    q0: float
    """Attitude, body to north-east-down."""
    q1: float
    q2: float
    q3: float
    p: float
    """Body rates, rad/s."""
    q: float
    r: float
    aileron: float
    """Surfaces, rad."""
    elevator: float
    rudder: float
    n_r: float
    """Inner loop, see `LoopState`."""
    n_r_dot: float
    mu_r: float
    integral: float


class Disturbances(NamedTuple):
    """See `DISTURBANCES`; then the rotation of the air, rad/s."""

    b_x: float
    b_y: float
    b_z: float
    wind: float = 0.0
    gust: float = 0.0
    wind_along: float = 0.0
    wind_right: float = 0.0
    wind_up: float = 0.0
    p_g: float = 0.0
    q_g: float = 0.0
    r_g: float = 0.0


class Level(NamedTuple):
    """Level flight in still air."""

    alpha: float
    """rad."""
    elevator: float
    """rad."""
    thrust: float
    """N."""
    load_factor: float
    bank: float
    """rad."""


@compiled
def _against(s, vx, vy, vz):
    """Speed, path angle, course, bank, angle of attack and sideslip of the attitude against a velocity (z up)."""
    return against(s.q0, s.q1, s.q2, s.q3, vx, vy, vz)


@compiled
def surface_rate(wanted, position):
    """Rate of a surface (rad/s) on its way from ``position`` to ``wanted`` (rad)."""
    stopped = min(max(wanted, -_SURFACE_STOP), _SURFACE_STOP)
    return min(max(_SURFACE_LAG * (stopped - position), -_SURFACE_RATE), _SURFACE_RATE)


@compiled
def rates(s, u, d, a):
    """Rates of `State` under the demands ``u`` and disturbances ``d`` of the airframe ``a``; the wind blows north."""
    thrust = max(u.thrust, 0.0)
    vx, vy, vz = s.vx - wind_speed(s.z, d.wind, d.gust), s.vy, s.vz
    p_g, q_g, r_g = d.p_g, d.q_g, d.r_g
    if d.wind_along != 0.0 or d.wind_right != 0.0 or d.wind_up != 0.0:
        ground = math.sqrt(s.vx * s.vx + s.vy * s.vy)
        cos_chi, sin_chi = s.vx / ground, s.vy / ground
        vx -= d.wind_along * cos_chi - d.wind_right * sin_chi
        vy -= d.wind_along * sin_chi + d.wind_right * cos_chi
        vz -= d.wind_up
        if p_g != 0.0 or q_g != 0.0 or r_g != 0.0:
            p_g, q_g, r_g = about_body_axes(s.q0, s.q1, s.q2, s.q3, cos_chi, sin_chi, p_g, q_g, r_g)
    speed, gamma, chi, mu, alpha, beta = _against(s, vx, vy, vz)
    V_dot, chi_dot, gamma_dot, _, _, _, p_dot, q_dot, r_dot = attitude_rates(
        speed, gamma, mu, alpha, beta, s.p, s.q, s.r,
        s.aileron, s.elevator, s.rudder, thrust, 0.0, 0.0, 0.0, a, p_g, q_g, r_g,
    )  # fmt: skip
    # The rates of the air path in still air are the acceleration on its triad, whatever the wind does.
    north, east, up = acceleration(speed, gamma, chi, V_dot, gamma_dot, chi_dot)
    loop = LoopState(s.n_r, s.n_r_dot, s.mu_r, s.integral)
    n_r, n_r_dot, mu_r, integral = loop_rates(
        loop, u.load_factor, u.bank, load_factor(speed, alpha, s.elevator, thrust, a), 1.0
    )
    aileron, elevator, rudder = deflections(
        loop, mu_r, speed, gamma, mu, alpha, beta, s.p, s.q, s.r, chi_dot, gamma_dot, s.elevator, thrust, 1.0, a
    )
    return (
        s.vx,
        s.vy,
        s.vz,
        north + d.b_x,
        east + d.b_y,
        up + d.b_z,
        0.5 * (-s.q1 * s.p - s.q2 * s.q - s.q3 * s.r),
        0.5 * (s.q0 * s.p + s.q2 * s.r - s.q3 * s.q),
        0.5 * (s.q0 * s.q - s.q1 * s.r + s.q3 * s.p),
        0.5 * (s.q0 * s.r + s.q1 * s.q - s.q2 * s.p),
        p_dot,
        q_dot,
        r_dot,
        surface_rate(aileron, s.aileron),
        surface_rate(elevator, s.elevator),
        surface_rate(rudder, s.rudder),
        n_r,
        n_r_dot,
        mu_r,
        integral,
    )


@compiled
def airspeed(s):
    """Speed over the ground, m/s."""
    return math.sqrt(s.vx * s.vx + s.vy * s.vy + s.vz * s.vz)


@compiled
def truth(s, u, offset, out):
    """Write the channels of ``plant.TRUTH`` that are states; all angles are against the velocity over the ground."""
    out[X], out[Y], out[Z] = s.x, s.y, s.z
    out[V], out[GAMMA], out[CHI], out[MU], out[ALPHA], out[BETA] = _against(s, s.vx, s.vy, s.vz)
    out[P], out[Q], out[R] = s.p, s.q, s.r


@compiled
def lost(s, guards):
    """Why a vehicle in this state is lost, a key of ``plant.LOST``; 0 if it is not."""
    speed, gamma, _, _, alpha, beta = _against(s, s.vx, s.vy, s.vz)
    if not (speed + abs(s.p) + abs(s.q) + abs(s.r) + abs(alpha) + abs(beta) < math.inf):
        return NUMBER
    return beyond(speed, gamma, alpha, beta, guards)


def initial(start: Mapping[str, float], steady: Mapping[str, float]) -> State:
    """`State` of an aircraft that starts as ``start`` says, with level wings in the trim of `level`."""
    speed, gamma, chi = start["V"], start.get("gamma", 0.0), start.get("chi", 0.0)
    ground, pitch = speed * math.cos(gamma), gamma + steady["alpha"]
    cy, sy, cp, sp = math.cos(0.5 * chi), math.sin(0.5 * chi), math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    return State(
        start.get("x", 0.0), start.get("y", 0.0), start["z"],
        ground * math.cos(chi), ground * math.sin(chi), speed * math.sin(gamma),
        cy * cp, -sy * sp, cy * sp, sy * cp,
        0.0, 0.0, 0.0,
        0.0, steady["elevator"], 0.0,
        1.0, 0.0, 0.0, 0.0,
    )  # fmt: skip


def level(airframe: Airframe, V: float, **disturbances: float) -> Level:
    """Level flight at ``V`` (m/s) in still air, whatever disturbs; raises TrimError where there is none."""
    return Level(*trim(airframe, V), 1.0, 0.0)
