"""The airframe: its coefficients and the longitudinal equations of motion.

The model is the monograph's (2.1)-(2.7) restricted to the vertical plane, with the elevator's lift and T sin(alpha).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ftcc.link.compiled import compiled

__all__ = ["Airframe", "Deflections", "longitudinal_rates"]


class Airframe(NamedTuple):
    """True parameters of a fixed-wing aircraft in its vertical plane (SI units, rad)."""

    m: float
    """Mass, kg."""
    S: float
    """Wing area, m^2."""
    c: float
    """Mean aerodynamic chord, m."""
    Iy: float
    """Pitch moment of inertia, kg m^2."""
    rho: float
    """Air density, kg/m^3."""
    g: float
    """Gravity, m/s^2."""
    CD0: float
    CDa: float
    CDa2: float
    CL0: float
    CLa: float
    CLde: float
    Cm0: float
    Cma: float
    Cmde: float
    Cmq: float


class Deflections(NamedTuple):
    """What acts on the airframe, in the order of ``ACTUATORS``."""

    aileron: float
    """rad."""
    elevator: float
    """rad."""
    rudder: float
    """rad."""
    thrust: float
    """N."""


@compiled
def longitudinal_rates(V, gamma, theta, q, thrust, elevator, d1, d2, d3, a):
    """Rates of (V, x, z, gamma, theta, q), eqs. (2.8)-(2.12).

    Parameters
    ----------
    V, gamma, theta, q : float
        Airspeed m/s, flight-path angle rad, pitch angle rad, pitch rate rad/s.
    thrust, elevator : float
        Acting thrust N and elevator deflection rad (positive: nose down).
    d1, d2, d3 : float
        Disturbances of V (m/s^2), gamma (rad/s) and q (rad/s^2).
    a : Airframe
    """
    alpha = theta - gamma
    lifting = 0.5 * a.rho * V * V * a.S
    sin_gamma = math.sin(gamma)
    cos_gamma = math.cos(gamma)
    drag = lifting * (a.CD0 + a.CDa * alpha + a.CDa2 * alpha * alpha)
    lift = lifting * (a.CL0 + a.CLa * alpha + a.CLde * elevator)
    moment = lifting * a.c * (a.Cm0 + a.Cma * alpha + a.Cmde * elevator + a.Cmq * a.c * q / (2.0 * V))
    return (
        (thrust * math.cos(alpha) - drag) / a.m - a.g * sin_gamma + d1,
        V * cos_gamma,
        V * sin_gamma,
        (lift - a.m * a.g * cos_gamma + thrust * math.sin(alpha)) / (a.m * V) + d2,
        q,
        moment / a.Iy + d3,
    )
