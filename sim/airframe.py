"""The true airframe: its equations of motion, in six degrees of freedom and in the vertical plane.

The model is the monograph's (2.1)-(2.7), its coefficients are an `Airframe`. What laws know of the aircraft is not the
truth: `ftcc.airside.model` and `ftcc.airside.attitude_model` state nominal equations a second time on purpose.

Both sets of equations are of the same aircraft: in its plane of symmetry, without aileron and rudder, `attitude_rates`
gives what `longitudinal_rates` gives.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from ftcc.link.airframe import Airframe
from ftcc.link.compiled import compiled

__all__ = ["Airframe", "Deflections", "attitude_rates", "longitudinal_rates", "scaled", "turning_rates"]


class Deflections(NamedTuple):
    """What acts on the airframe, in the order of ``ACTUATORS``; positive ones turn about their axes negatively."""

    aileron: float
    """rad, positive: right one down, rolls left."""
    elevator: float
    """rad, positive: trailing edge down, nose down."""
    rudder: float
    """rad, positive: trailing edge left, nose left."""
    thrust: float
    """N."""


def scaled(airframe: Airframe, factors: Mapping[str, float]) -> Airframe:
    """The airframe with aerodynamic coefficients times ``factors``, by name; "all" for those that are not named.

    Raises
    ------
    ValueError
        For a name that is no aerodynamic coefficient.
    """
    coefficients = [name for name in airframe._fields if name.startswith("C")]
    unknown = [name for name in factors if name not in (*coefficients, "all")]
    if unknown:
        raise ValueError(
            f"{', '.join(unknown)}: no aerodynamic coefficient; there are {', '.join(coefficients)} and all"
        )
    others = factors.get("all", 1.0)
    return airframe._replace(**{name: getattr(airframe, name) * factors.get(name, others) for name in coefficients})


@compiled
def longitudinal_rates(V, gamma, theta, q, thrust, elevator, d1, d2, d3, a, q_g=0.0):
    """Rates of (V, x, z, gamma, theta, q), eqs. (2.8)-(2.12) with the elevator's lift and T sin(alpha).

    Parameters
    ----------
    V, gamma, theta, q : float
        Airspeed m/s, flight-path angle rad, pitch angle rad, pitch rate rad/s.
    thrust, elevator : float
        Acting thrust N and elevator deflection rad (positive: nose down).
    d1, d2, d3 : float
        Disturbances of V (m/s^2), gamma (rad/s) and q (rad/s^2).
    a : Airframe
    q_g : float
        Pitch rate of the air, rad/s: damping follows the rate against it, see `ftcc.sim.turning_air`.
    """
    alpha = theta - gamma
    lifting = 0.5 * a.rho * V * V * a.S
    sin_gamma = math.sin(gamma)
    cos_gamma = math.cos(gamma)
    drag = lifting * (a.CD0 + a.CDa * alpha + a.CDa2 * alpha * alpha)
    lift = lifting * (a.CL0 + a.CLa * alpha + a.CLde * elevator)
    moment = lifting * a.c * (a.Cm0 + a.Cma * alpha + a.Cmde * elevator + a.Cmq * a.c * (q - q_g) / (2.0 * V))
    return (
        (thrust * math.cos(alpha) - drag) / a.m - a.g * sin_gamma + d1,
        V * cos_gamma,
        V * sin_gamma,
        (lift - a.m * a.g * cos_gamma + thrust * math.sin(alpha)) / (a.m * V) + d2,
        q,
        moment / a.Iy + d3,
    )


@compiled
def turning_rates(gamma, mu, alpha, beta, p, q, r, chi_dot, gamma_dot):
    """Rates of (mu, alpha, beta), the attitude against a path, under body rates and the path's own, eqs. (2.3)."""
    sin_alpha, cos_alpha = math.sin(alpha), math.cos(alpha)
    sin_beta, cos_beta = math.sin(beta), math.cos(beta)
    sin_mu, cos_mu = math.sin(mu), math.cos(mu)
    sin_gamma, cos_gamma = math.sin(gamma), math.cos(gamma)
    tan_beta = sin_beta / cos_beta
    about_velocity = p * cos_alpha + r * sin_alpha
    lift_axis = chi_dot * cos_gamma * sin_mu + gamma_dot * cos_mu
    side_axis = chi_dot * cos_gamma * cos_mu - gamma_dot * sin_mu
    return (
        about_velocity / cos_beta + chi_dot * sin_gamma + lift_axis * tan_beta,
        q - tan_beta * about_velocity - lift_axis / cos_beta,
        p * sin_alpha - r * cos_alpha + side_axis,
    )


@compiled
def attitude_rates(
    V, gamma, mu, alpha, beta, p, q, r, aileron, elevator, rudder, thrust, d1, d2, d3, a, p_g=0.0, q_g=0.0, r_g=0.0
):
    """Rates of (V, chi, gamma, mu, alpha, beta, p, q, r), eqs. (2.2)-(2.7).

    Parameters
    ----------
    V, gamma : float
        Airspeed m/s, flight-path angle rad; the course chi does not enter.
    mu, alpha, beta : float
        Bank about the velocity, angle of attack, sideslip, rad.
    p, q, r : float
        Body rates, rad/s.
    aileron, elevator, rudder, thrust : float
        What acts, rad and N; a positive deflection turns about its own axis negatively.
    d1, d2, d3 : float
        Disturbances of V (m/s^2), gamma (rad/s) and q (rad/s^2).
    a : Airframe
    p_g, q_g, r_g : float
        Rotation of the air about the body axes, rad/s: damping follows the rates against it.
    """
    sin_alpha, cos_alpha = math.sin(alpha), math.cos(alpha)
    sin_beta, cos_beta = math.sin(beta), math.cos(beta)
    sin_mu, cos_mu = math.sin(mu), math.cos(mu)
    sin_gamma, cos_gamma = math.sin(gamma), math.cos(gamma)
    # Forces and moments, (2.6)-(2.7).
    lifting = 0.5 * a.rho * V * V * a.S
    half_span = 0.5 * a.b / V
    drag = lifting * (a.CD0 + a.CDa * alpha + a.CDa2 * alpha * alpha)
    lift = lifting * (a.CL0 + a.CLa * alpha + a.CLde * elevator)
    side = lifting * (a.CY0 + a.CYb * beta)
    rolling = lifting * a.b * (
        a.Cl0 + a.Clb * beta + a.Clda * aileron + a.Cldr * rudder + half_span * (a.Clp * (p - p_g) + a.Clr * (r - r_g))
    )  # fmt: skip
    pitching = lifting * a.c * (a.Cm0 + a.Cma * alpha + a.Cmde * elevator + a.Cmq * a.c * (q - q_g) / (2.0 * V))
    yawing = lifting * a.b * (
        a.Cn0 + a.Cnb * beta + a.Cnda * aileron + a.Cndr * rudder + half_span * (a.Cnp * (p - p_g) + a.Cnr * (r - r_g))
    )  # fmt: skip
    # Flight path, (2.2).
    momentum = a.m * V
    V_dot = (thrust * cos_alpha * cos_beta - drag) / a.m - a.g * sin_gamma + d1
    turning = thrust * (sin_alpha * sin_mu - cos_alpha * sin_beta * cos_mu)
    chi_dot = (lift * sin_mu + side * cos_mu + turning) / (momentum * cos_gamma)
    climbing = thrust * (cos_alpha * sin_beta * sin_mu + sin_alpha * cos_mu)
    gamma_dot = (lift * cos_mu - side * sin_mu + climbing) / momentum - a.g * cos_gamma / V + d2
    mu_dot, alpha_dot, beta_dot = turning_rates(gamma, mu, alpha, beta, p, q, r, chi_dot, gamma_dot)
    # Body rates, (2.4)-(2.5).
    inertia = a.Ix * a.Iz - a.Ixz * a.Ixz
    c1 = ((a.Iy - a.Iz) * a.Iz - a.Ixz * a.Ixz) / inertia
    c2 = a.Ixz * (a.Ix - a.Iy + a.Iz) / inertia
    c8 = (a.Ix * (a.Ix - a.Iy) + a.Ixz * a.Ixz) / inertia
    p_dot = (c1 * r + c2 * p) * q + (a.Iz * rolling + a.Ixz * yawing) / inertia
    q_dot = ((a.Iz - a.Ix) * p * r - a.Ixz * (p * p - r * r) + pitching) / a.Iy + d3
    r_dot = (c8 * p - c2 * r) * q + (a.Ixz * rolling + a.Ix * yawing) / inertia
    return V_dot, chi_dot, gamma_dot, mu_dot, alpha_dot, beta_dot, p_dot, q_dot, r_dot
