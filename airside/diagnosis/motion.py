"""What the actuators do to the aircraft between two ticks, each in its own unit, by the nominal model.

Aircraft with surfaces, eqs. (2.2)-(2.7): thrust by the airspeed, surfaces by the body rates, whose effect G2 is
inverted, so that each actuator has one equation y' = u + F. Point masses, eqs. (2.15)-(2.16): thrust by the airspeed,
load factor by the flight path, bank by itself.

Moving air changes the angle of attack unseen: it is not that of the velocity over the ground. But it bends the flight
path too. `Motion` has how much of each actuator's motion comes with a rate of the flight path that the model does not
explain; what is left after that is calm.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ftcc.airside.attitude_model import body_rate_model, deflections_for
from ftcc.airside.point_mass import drag
from ftcc.link.actuators import AILERON, ELEVATOR, RUDDER, THRUST
from ftcc.link.compiled import compiled, compiled_apart, store
from ftcc.link.rotation import wrapped

__all__ = ["Motion", "aircraft_motion", "kinematic_slips", "point_motion"]

_LEAST_AIRSPEED = 5.0
"""Guard of the airspeed in every division, m/s."""
_LEAST_COSINE = 0.1
_LEAST_SLOPE = 0.1
"""Guard of d gamma'/d alpha, 1/s."""


class Motion(NamedTuple):
    """Of an actuator, between two ticks: a row of ``Diagnosis.motion``."""

    step: float
    """Measured motion, unit times s."""
    drift: float
    """F: what the nominal aircraft does by itself, unit."""
    regressor: float
    """R: the part of the drift that is proportional to the least certain coefficient, unit."""
    air: float
    """Motion that comes with an unexplained turn of the flight path, unit times s per rad."""
    lift: float
    """Turn of the flight path by the actuator itself, rad/s per unit."""
    noise: float
    """Standard deviation of measured motion, unit times s."""


@compiled
def _set(row, step, drift, regressor, air, lift, noise):
    store(Motion(step, drift, regressor, air, lift, noise), row)


@compiled
def _between(before, after):
    """The angle in the middle between two."""
    return before + 0.5 * wrapped(after - before)


@compiled_apart
def aircraft_motion(own, past, positions, a, gains, dt, lateral, out):
    """Write the `Motion` of the four actuators into ``out`` (4, 6); return the unexplained turn of the path, rad.

    ``own`` and ``past`` are `Own` now and a tick before, ``positions`` (4,) the actuators between by the nominal model,
    ``a`` the `Model`. Aileron and rudder are written with ``lateral`` = 1.
    """
    V = max(0.5 * (own.V + past.V), _LEAST_AIRSPEED)
    gamma, alpha, beta = 0.5 * (own.gamma + past.gamma), 0.5 * (own.alpha + past.alpha), 0.5 * (own.beta + past.beta)
    mu = _between(past.mu, own.mu)
    rates = (0.5 * (own.p + past.p), 0.5 * (own.q + past.q), 0.5 * (own.r + past.r))
    sa, ca, sb, cb = math.sin(alpha), math.cos(alpha), math.sin(beta), math.cos(beta)
    sm, cm, sg, cg = math.sin(mu), math.cos(mu), math.sin(gamma), math.cos(gamma)
    force = 0.5 * a.rho * V * V * a.S
    thrust = positions[THRUST]
    lift = force * (a.CL0 + a.CLa * alpha + a.CLde * positions[ELEVATOR])
    side = force * (a.CY0 + a.CYb * beta)
    resistance = force * (a.CD0 + a.CDa * alpha + a.CDa2 * alpha * alpha)
    momentum = a.m * V
    climb_rate = (lift * cm - side * sm + thrust * (ca * sb * sm + sa * cm)) / momentum - a.g * cg / V
    turn = own.gamma - past.gamma - dt * climb_rate
    slope = (force * a.CLa + thrust * ca) * cm / momentum
    if abs(slope) < _LEAST_SLOPE:
        slope = math.inf
    # Thrust.
    per_newton = max(ca * cb, _LEAST_COSINE) / a.m
    tilted = lift / a.m - force * (a.CDa + 2.0 * a.CDa2 * alpha) / a.m
    _set(
        out[THRUST],
        (own.V - past.V) / per_newton,
        (-resistance / a.m - a.g * sg) / per_newton,
        -resistance / a.m / per_newton,
        tilted / slope / per_newton,
        0.0,
        gains.sd_speed / per_newton,
    )
    # Surfaces.
    drift, effect = body_rate_model(V, alpha, beta, rates, V, a)
    per_rad = effect[1][1]
    moment = force * a.c * a.Cma / a.Iy
    _set(
        out[ELEVATOR],
        (own.q - past.q) / per_rad,
        drift[1] / per_rad,
        moment * alpha / per_rad,
        moment / slope / per_rad,
        force * a.CLde * cm / momentum,
        abs(gains.sd_rate / per_rad),
    )
    if lateral == 1:
        step = deflections_for(effect, (own.p - past.p, 0.0, own.r - past.r))
        bare = deflections_for(effect, (drift[0], 0.0, drift[2]))
        inertia = a.Ix * a.Iz - a.Ixz * a.Ixz
        rolling = force * a.b * a.Clp * rates[0] * a.b / (2.0 * V)
        yawing = force * a.b * a.Cnb * beta
        damped = deflections_for(effect, (a.Iz / inertia * rolling, 0.0, a.Ixz / inertia * rolling))
        vaned = deflections_for(effect, (a.Ixz / inertia * yawing, 0.0, a.Ix / inertia * yawing))
        _set(out[AILERON], step[0], bare[0], damped[0], 0.0, 0.0, abs(gains.sd_rate / effect[0][0]))
        _set(out[RUDDER], step[2], bare[2], vaned[2], 0.0, 0.0, abs(gains.sd_rate / effect[2][2]))
    return turn


@compiled_apart
def point_motion(own, past, positions, a, gains, dt, bank_lag, out):
    """As `aircraft_motion`, of a point mass; ``bank_lag`` is the bandwidth of its bank, rad/s; 0: it has none."""
    V = max(0.5 * (own.V + past.V), _LEAST_AIRSPEED)
    gamma, mu = 0.5 * (own.gamma + past.gamma), _between(past.mu, own.mu)
    cg, cm = math.cos(gamma), math.cos(mu)
    resistance = drag(V, positions[ELEVATOR], a)
    _set(
        out[THRUST],
        a.m * (own.V - past.V),
        -resistance - a.m * a.g * math.sin(gamma),
        -resistance,
        0.0,
        0.0,
        a.m * gains.sd_speed,
    )
    upright = cm if abs(cm) > _LEAST_COSINE else math.copysign(_LEAST_COSINE, cm)
    per_load = a.g * upright / V
    step = (own.gamma - past.gamma) / per_load
    _set(out[ELEVATOR], step, -cg / upright, 0.0, 0.0, 0.0, abs(gains.sd_angle / per_load))
    if bank_lag > 0.0:
        _set(out[AILERON], wrapped(own.mu - past.mu) / bank_lag, -mu, 0.0, 0.0, 0.0, gains.sd_angle / bank_lag)
    else:
        # The bank is the actuator itself: its motion is its mean position.
        _set(out[AILERON], dt * mu, 0.0, 0.0, 0.0, 0.0, dt * gains.sd_angle)
    return 0.0


@compiled
def kinematic_slips(own, past, dt):
    """By how much bank, angle of attack and sideslip moved otherwise than body rates and path say, eqs. (2.3), rad.

    No force and no air enters: only a navigation solution that contradicts itself makes them.
    """
    p, q, r = 0.5 * (own.p + past.p), 0.5 * (own.q + past.q), 0.5 * (own.r + past.r)
    alpha, beta = 0.5 * (own.alpha + past.alpha), 0.5 * (own.beta + past.beta)
    mu, gamma = _between(past.mu, own.mu), 0.5 * (own.gamma + past.gamma)
    turned, climbed = wrapped(own.chi - past.chi), own.gamma - past.gamma
    sa, ca, sm, cm = math.sin(alpha), math.cos(alpha), math.sin(mu), math.cos(mu)
    sg, cg, cb = math.sin(gamma), math.cos(gamma), max(math.cos(beta), _LEAST_COSINE)
    tb = math.sin(beta) / cb
    about = dt * (p * ca + r * sa)
    lift_axis = turned * cg * sm + climbed * cm
    side_axis = turned * cg * cm - climbed * sm
    return (
        wrapped(own.mu - past.mu) - about / cb - turned * sg - lift_axis * tb,
        own.alpha - past.alpha - dt * q + tb * about + lift_axis / cb,
        own.beta - past.beta - dt * (p * sa - r * ca) - side_axis,
    )
