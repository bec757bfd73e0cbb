"""The nominal model of an aircraft as a point: eqs. (2.15)-(2.16) as one acceleration, and its inverse [R].

P'' = t (T - D)/m + h g n sin(mu) + k g n cos(mu) - g e_up, on the triad of the flight path: t along track, h horizontal
to the right, k normal and up; thrust T, load factor n and bank mu are the inputs. Axes are north, east, up.
"""

from __future__ import annotations

import math

from ftcc.airside.elements.nonlinear import clip
from ftcc.airside.elements.vectors import dot
from ftcc.link.compiled import compiled

__all__ = ["acceleration", "commands_for", "drag", "triad", "velocity"]

_LEAST_NORMAL = 0.1
"""Floor on n cos(mu) in a command: an aircraft is not flown upside down."""
_LEAST_AIRSPEED = 5.0
"""Airspeed guard in the drag, m/s."""


@compiled
def velocity(V, gamma, chi):
    """Velocity (m/s) from speed, flight-path angle and course."""
    ground = V * math.cos(gamma)
    return ground * math.cos(chi), ground * math.sin(chi), V * math.sin(gamma)


@compiled
def triad(gamma, chi):
    """The flight path's unit vectors: along track, to the right, up."""
    cg, sg, cc, sc = math.cos(gamma), math.sin(gamma), math.cos(chi), math.sin(chi)
    return (cg * cc, cg * sc, sg), (-sc, cc, 0.0), (-sg * cc, -sg * sc, cg)


@compiled
def drag(V, n, model):
    """Drag (N) at airspeed ``V`` and load factor ``n`` in still air: the polar at the angle of attack of that lift."""
    speed = max(V, _LEAST_AIRSPEED)
    lifting = 0.5 * model.rho * speed * speed * model.S
    alpha = (n * model.m * model.g / lifting - model.CL0) / model.CLa
    return lifting * (model.CD0 + model.CDa * alpha + model.CDa2 * alpha * alpha)


@compiled
def acceleration(V, gamma, chi, thrust, n, mu, model):
    """P'' (m/s^2) under thrust (N), load factor and bank (rad)."""
    along, right, up = triad(gamma, chi)
    a = (thrust - drag(V, n, model)) / model.m
    b = model.g * n * math.sin(mu)
    c = model.g * n * math.cos(mu)
    return (
        along[0] * a + right[0] * b + up[0] * c,
        along[1] * a + right[1] * b + up[1] * c,
        along[2] * a + right[2] * b + up[2] * c - model.g,
    )


@compiled
def commands_for(x, y, z, V, gamma, chi, bank_max, n_max, model):
    """Thrust (N), load factor and bank (rad), within their limits, that accelerate by ``x, y, z`` (m/s^2)."""
    along, right, up = triad(gamma, chi)
    wanted = (x, y, z + model.g)
    sideways = dot(right, wanted)
    upwards = max(dot(up, wanted), _LEAST_NORMAL * model.g)
    mu = clip(math.atan2(sideways, upwards), -bank_max, bank_max)
    n = min(math.sqrt(sideways * sideways + upwards * upwards) / model.g, n_max)
    thrust = clip(model.m * dot(along, wanted) + drag(V, n, model), model.thrust_min, model.thrust_max)
    return thrust, n, mu
