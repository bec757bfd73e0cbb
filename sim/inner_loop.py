"""The vehicle's own inner loop: load factor and bank by the surfaces of the 6-DoF aircraft (not in the monograph).

Shaped demands, an integral on the measured load factor, the kinematics (2.3) inverted for body rates, the moments
(2.4)-(2.7) inverted for surfaces. Damping and stiffness terms use the commanded angle of attack and rates: cancelling
the natural ones by measured values through the surfaces' lag would be unstable.

The bandwidths are those of the reference airframe at 30 m/s, times a ``pace``: 1 there, and on another aircraft the
ratio of the natural frequencies in pitch, see `pace_of`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ftcc.link.compiled import compiled
from ftcc.link.rotation import wrapped

__all__ = ["LoopState", "deflections", "load_factor", "loop_rates", "pace_of"]

_LOAD_FREQUENCY, _LOAD_DAMPING = 16.0, 0.7
"""Reference model of the load factor, rad/s."""
_BANK_TIME, _BANK_RATE = 0.15, 2.0
"""Reference model of the bank: time constant, s, and largest rate, rad/s."""
_MOST_INTEGRAL = 0.3
_LEAST_ALPHA, _MOST_ALPHA = -0.1, 0.2
"""Commanded angle of attack, rad."""
_K_BANK, _K_SIDESLIP, _K_ALPHA = 6.0, 2.0, 3.0
"""Attitude errors to body rates, 1/s."""
_K_P, _K_Q, _K_R = 8.0, 10.0, 4.0
"""Rate errors to angular accelerations, 1/s."""


class LoopState(NamedTuple):
    """State of the loop."""

    n_r: float
    """Shaped load factor."""
    n_r_dot: float
    """1/s."""
    mu_r: float
    """Shaped bank, rad."""
    integral: float
    """Of the load factor's error, s."""


_PITCH_FREQUENCY = 12.2
"""Of the reference airframe at 30 m/s, see `pace_of`, rad/s."""


@compiled
def pace_of(V, a):
    """How fast an aircraft's loop may be against the one of the reference airframe: -Cma qbar S c / Iy, by its root."""
    stiffness = max(-a.Cma, 0.0) * 0.5 * a.rho * V * V * a.S * a.c / a.Iy
    return math.sqrt(stiffness) / _PITCH_FREQUENCY


@compiled
def _clip(value, low, high):
    return min(max(value, low), high)


@compiled
def load_factor(V, alpha, elevator, thrust, a):
    """Load factor along the lift axis, as an accelerometer measures it: (L + T sin(alpha)) / (m g)."""
    lift = 0.5 * a.rho * V * V * a.S * (a.CL0 + a.CLa * alpha + a.CLde * elevator)
    return (lift + thrust * math.sin(alpha)) / (a.m * a.g)


@compiled
def loop_rates(loop, wanted_load, wanted_bank, measured_load, pace):
    """Rates of `LoopState` for the demanded load factor and bank (rad)."""
    error = loop.n_r - measured_load
    integral_rate = error
    if abs(loop.integral) >= _MOST_INTEGRAL and loop.integral * error > 0.0:
        integral_rate = 0.0
    w = _LOAD_FREQUENCY * pace
    return (
        loop.n_r_dot,
        w * w * (wanted_load - loop.n_r) - 2.0 * _LOAD_DAMPING * w * loop.n_r_dot,
        _clip(wrapped(wanted_bank - loop.mu_r) / _BANK_TIME * pace, -_BANK_RATE * pace, _BANK_RATE * pace),
        integral_rate * pace,
    )


@compiled
def deflections(loop, mu_r_dot, V, gamma, mu, alpha, beta, p, q, r, chi_dot, gamma_dot, elevator, thrust, pace, a):
    """Aileron, elevator and rudder (rad) that fly the loop's references.

    Parameters
    ----------
    loop : LoopState
    mu_r_dot : float
        Rate of the shaped bank, rad/s.
    V, gamma, mu, alpha, beta : float
        Airspeed m/s, flight-path angle, bank, angle of attack and sideslip of the air velocity, rad.
    p, q, r : float
        Body rates, rad/s.
    chi_dot, gamma_dot : float
        Rates of the air path, eqs. (2.2), rad/s.
    elevator, thrust : float
        What acts at present, rad and N.
    pace : float
    a : Airframe
    """
    pressure = 0.5 * a.rho * V * V * a.S
    lift = a.m * a.g * (loop.n_r + loop.integral) - thrust * math.sin(alpha)
    alpha_d = _clip((lift / pressure - a.CL0 - a.CLde * elevator) / a.CLa, _LEAST_ALPHA, _MOST_ALPHA)

    # Body rates that hold bank, sideslip and angle of attack, (2.3) inverted.
    sin_a, cos_a, sin_b, cos_b = math.sin(alpha), math.cos(alpha), math.sin(beta), math.cos(beta)
    sin_g, cos_g, sin_m, cos_m = math.sin(gamma), math.cos(gamma), math.sin(mu), math.cos(mu)
    tan_b = sin_b / cos_b
    rolling = cos_b * (
        mu_r_dot
        + _K_BANK * pace * wrapped(loop.mu_r - mu)
        - chi_dot * (sin_g + cos_g * sin_m * tan_b)
        - gamma_dot * cos_m * tan_b
    )  # fmt: skip
    slipping = -_K_SIDESLIP * pace * beta - chi_dot * cos_g * cos_m + gamma_dot * sin_m
    p_c = cos_a * rolling + sin_a * slipping
    r_c = sin_a * rolling - cos_a * slipping
    q_c = (
        loop.n_r_dot * a.m * a.g / (pressure * a.CLa)
        + _K_ALPHA * pace * (alpha_d - alpha)
        + tan_b * (p * cos_a + r * sin_a)
        + (chi_dot * cos_g * sin_m + gamma_dot * cos_m) / cos_b
    )

    # Angular accelerations less the gyroscopic terms, (2.4)-(2.5).
    inertia = a.Ix * a.Iz - a.Ixz * a.Ixz
    c1 = ((a.Iy - a.Iz) * a.Iz - a.Ixz * a.Ixz) / inertia
    c2 = a.Ixz * (a.Ix - a.Iy + a.Iz) / inertia
    c8 = (a.Ix * (a.Ix - a.Iy) + a.Ixz * a.Ixz) / inertia
    p_d = _K_P * pace * (p_c - p) - (c1 * r + c2 * p) * q
    r_d = _K_R * pace * (r_c - r) - (c8 * p - c2 * r) * q
    q_d = _K_Q * pace * (q_c - q) - ((a.Iz - a.Ix) * p * r - a.Ixz * (p * p - r * r)) / a.Iy

    # Moments, then surfaces, (2.6)-(2.7).
    pitching = q_d * a.Iy / (pressure * a.c)
    wanted_elevator = (pitching - a.Cm0 - a.Cma * alpha_d - a.Cmq * a.c * q_c / (2.0 * V)) / a.Cmde
    half_span = 0.5 * a.b / V
    roll = (a.Ix * p_d - a.Ixz * r_d) / (pressure * a.b) - half_span * (a.Clp * p_c + a.Clr * r_c)
    yaw = (a.Iz * r_d - a.Ixz * p_d) / (pressure * a.b) - half_span * (a.Cnp * p_c + a.Cnr * r_c)
    authority = a.Clda * a.Cndr - a.Cldr * a.Cnda
    return (roll * a.Cndr - yaw * a.Cldr) / authority, wanted_elevator, (yaw * a.Clda - roll * a.Cnda) / authority
