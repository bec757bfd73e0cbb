"""The control-oriented model of attitude: X1' = F1 + G1 X2, X2' = F2 + G2 U, eqs. (7.1)-(7.2), (8.1)-(8.2).

X1 = (mu, alpha, beta), X2 = (p, q, r), U = (aileron, elevator, rudder). Vectors and matrices are tuples, see
`elements.vectors`. Everything is nominal: what a law knows of its aircraft.
"""

from __future__ import annotations

import math

from ftcc.airside.elements.nonlinear import clip
from ftcc.link.compiled import compiled
from ftcc.link.rotation import wrapped

__all__ = [
    "attitude_drift",
    "attitude_error",
    "attitude_of",
    "body_rate_model",
    "body_rates_of",
    "deflections_for",
    "kinematics",
    "kinematics_inverse",
    "largest_deflections",
    "least_deflections",
    "reference_rates_of",
    "surfaces_of",
]

_LEAST_COSINE = 0.05
"""Guard of cos(gamma)."""


@compiled
def attitude_of(own):
    """X1: bank, angle of attack and sideslip, rad."""
    return own.mu, own.alpha, own.beta


@compiled
def body_rates_of(own):
    """X2: roll, pitch and yaw rate, rad/s."""
    return own.p, own.q, own.r


@compiled
def surfaces_of(own):
    """Aileron, elevator and rudder as commanded, in force at present, rad."""
    return own.aileron, own.elevator, own.rudder


@compiled
def reference_rates_of(reference):
    """X1d': rates of the reference's bank, angle of attack and sideslip, rad/s."""
    return reference.mu_dot, reference.alpha_dot, reference.beta_dot


@compiled
def attitude_error(own, reference):
    """X1 - X1d: the own tracking error of (7.12) and (8.10), the shorter way around where the bank is inverted."""
    return wrapped(own.mu - reference.mu), wrapped(own.alpha - reference.alpha), wrapped(own.beta - reference.beta)


@compiled
def kinematics(alpha, beta):
    """G1 of (7.1), three rows; det = -1/cos(beta)."""
    ca, sa, tb, cb = math.cos(alpha), math.sin(alpha), math.tan(beta), math.cos(beta)
    return (ca / cb, 0.0, sa / cb), (-ca * tb, 1.0, -sa * tb), (sa, 0.0, -ca)


@compiled
def kinematics_inverse(alpha, beta):
    """G1^-1, three rows."""
    ca, sa, sb, cb = math.cos(alpha), math.sin(alpha), math.sin(beta), math.cos(beta)
    return (ca * cb, 0.0, sa), (sb, 1.0, 0.0), (sa * cb, 0.0, -ca)


@compiled
def body_rate_model(V, alpha, beta, rates, divisor, a):
    """F2 (rad/s^2) without the surfaces, and G2 (rad/s^2 per rad) in three rows, eqs. (2.4)-(2.7).

    ``divisor`` is the airspeed guarded against zero, ``a`` the `Model`. G2 scales with V^2.
    """
    p, q, r = rates
    gamma = a.Ix * a.Iz - a.Ixz * a.Ixz
    c1 = ((a.Iy - a.Iz) * a.Iz - a.Ixz * a.Ixz) / gamma
    c2 = a.Ixz * (a.Ix - a.Iy + a.Iz) / gamma
    c3, c4, c9 = a.Iz / gamma, a.Ixz / gamma, a.Ix / gamma
    c5, c6, c7 = (a.Iz - a.Ix) / a.Iy, a.Ixz / a.Iy, 1.0 / a.Iy
    c8 = (a.Ix * (a.Ix - a.Iy) + a.Ixz * a.Ixz) / gamma
    force = 0.5 * a.rho * V * V * a.S
    span, chord = a.b / (2.0 * divisor), a.c / (2.0 * divisor)
    roll = force * a.b * (a.Cl0 + a.Clb * beta + span * (a.Clp * p + a.Clr * r))
    pitch = force * a.c * (a.Cm0 + a.Cma * alpha + chord * a.Cmq * q)
    yaw = force * a.b * (a.Cn0 + a.Cnb * beta + span * (a.Cnp * p + a.Cnr * r))
    drift = (
        (c1 * r + c2 * p) * q + c3 * roll + c4 * yaw,
        c5 * p * r - c6 * (p * p - r * r) + c7 * pitch,
        (c8 * p - c2 * r) * q + c4 * roll + c9 * yaw,
    )
    lever = force * a.b
    effect = (
        (lever * (c3 * a.Clda + c4 * a.Cnda), 0.0, lever * (c3 * a.Cldr + c4 * a.Cndr)),
        (0.0, force * a.c * c7 * a.Cmde, 0.0),
        (lever * (c4 * a.Clda + c9 * a.Cnda), 0.0, lever * (c4 * a.Cldr + c9 * a.Cndr)),
    )
    return drift, effect


@compiled
def deflections_for(effect, acceleration):
    """G2^-1 times an angular acceleration: elevator alone, aileron and rudder together."""
    determinant = effect[0][0] * effect[2][2] - effect[0][2] * effect[2][0]
    return (
        (effect[2][2] * acceleration[0] - effect[0][2] * acceleration[2]) / determinant,
        acceleration[1] / effect[1][1],
        (effect[0][0] * acceleration[2] - effect[2][0] * acceleration[0]) / determinant,
    )


@compiled
def attitude_drift(V, gamma, attitude, thrust, divisor, a):
    """F1 (rad/s), eqs. (2.2)-(2.3) without body rates and without the elevator's lift."""
    mu, alpha, beta = attitude
    force = 0.5 * a.rho * V * V * a.S
    lift = force * (a.CL0 + a.CLa * alpha)
    side = force * (a.CY0 + a.CYb * beta)
    ca, sa, sb, tb, cb = math.cos(alpha), math.sin(alpha), math.sin(beta), math.tan(beta), math.cos(beta)
    cm, sm, cg, sg = math.cos(mu), math.sin(mu), math.cos(gamma), math.sin(gamma)
    momentum = a.m * divisor
    # chi' cos(gamma), and gamma'.
    turn = (lift * sm + side * cm + thrust * (sa * sm - ca * sb * cm)) / momentum
    climb = (lift * cm - side * sm + thrust * (ca * sb * sm + sa * cm)) / momentum - a.g * cg / divisor
    return (
        turn * (sg / clip(cg, _LEAST_COSINE, 1.0) + sm * tb) + climb * cm * tb,
        -(turn * sm + climb * cm) / cb,
        turn * cm - climb * sm,
    )


@compiled
def least_deflections(a):
    """Lower limits of aileron, elevator and rudder, rad."""
    return a.aileron_min, a.elevator_min, a.rudder_min


@compiled
def largest_deflections(a):
    """Upper limits, rad."""
    return a.aileron_max, a.elevator_max, a.rudder_max
