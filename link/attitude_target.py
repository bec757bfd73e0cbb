"""Thrust, load factor and bank as an attitude target, as SET_ATTITUDE_TARGET carries it, and back.

The quaternion is that of the path over the ground, turned by the bank about it and by the angle of attack that stands
for the load factor. That angle is a code, the same on both sides: without thrust, elevator or integral, which are the
vehicle's own. Both sides take the path of the very state that the command answers, so that the way there and back is
exact in any wind, but for float32.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ftcc.link.actuators import SLOT, THRUST, as_sent
from ftcc.link.compiled import compiled, fields, fill, store
from ftcc.link.messages import AttitudeTarget

__all__ = ["UNCODED", "AttitudeCode", "decode_target", "encode_target", "path_of"]

_LOAD, _BANK = SLOT["load_factor"], SLOT["bank"]
_LEAST_SPEED = 10.0
"""Guard of the code against division by zero, m/s."""


class AttitudeCode(NamedTuple):
    """Nominal values by which an angle of attack stands for a load factor."""

    loading: float
    """2 m g / (rho S), m^2/s^2; 0: commands do not travel as attitude targets."""
    CL0: float
    CLa: float
    """1/rad."""


UNCODED = AttitudeCode(0.0, 0.0, 1.0)


@compiled
def path_of(vx, vy, vz):
    """Speed (m/s), flight-path angle and course (rad) of a velocity north, east, down."""
    ground = math.sqrt(vx * vx + vy * vy)
    return math.sqrt(ground * ground + vz * vz), math.atan2(-vz, ground), math.atan2(vy, vx)


@compiled
def _pressure(V, code):
    speed = max(V, _LEAST_SPEED)
    return code.loading / (speed * speed)


@compiled
def encode_target(command, V, gamma, chi, travel, code, target):
    """Write ``command`` (4,), by slot, as an `AttitudeTarget` into ``target`` (5,), in float32.

    ``V`` (m/s), ``gamma`` and ``chi`` (rad) are the path of the state that it answers; ``travel`` (4,) is the full
    deflection of each actuator, ``code`` (3,) an `AttitudeCode`.
    """
    nominal = fields(AttitudeCode, code)
    alpha = (command[_LOAD] * _pressure(V, nominal) - nominal.CL0) / nominal.CLa
    a, b = math.cos(0.5 * chi), math.sin(0.5 * chi)
    c, d = math.cos(0.5 * gamma), math.sin(0.5 * gamma)
    e, f = math.cos(0.5 * command[_BANK]), math.sin(0.5 * command[_BANK])
    g, h = math.cos(0.5 * alpha), math.sin(0.5 * alpha)
    # Rz(chi) Ry(gamma), then Rx(bank) Ry(alpha).
    p0, p1, p2, p3 = a * c, -b * d, a * d, b * c
    r0, r1, r2, r3 = e * g, f * g, e * h, f * h
    encoded = AttitudeTarget(
        q1=p0 * r0 - p1 * r1 - p2 * r2 - p3 * r3,
        q2=p0 * r1 + p1 * r0 + p2 * r3 - p3 * r2,
        q3=p0 * r2 - p1 * r3 + p2 * r0 + p3 * r1,
        q4=p0 * r3 + p1 * r2 - p2 * r1 + p3 * r0,
        thrust=command[THRUST] / travel[THRUST],
    )
    store(encoded, target)
    as_sent(target)


@compiled
def decode_target(target, V, gamma, chi, travel, code, command):
    """The inverse of `encode_target` for the path of the state that the target answers."""
    a, b = math.cos(0.5 * chi), math.sin(0.5 * chi)
    c, d = math.cos(0.5 * gamma), math.sin(0.5 * gamma)
    p0, p1, p2, p3 = a * c, -b * d, a * d, b * c
    q0, q1, q2, q3, thrust = fields(AttitudeTarget, target)
    r0 = p0 * q0 + p1 * q1 + p2 * q2 + p3 * q3
    r1 = p0 * q1 - p1 * q0 - p2 * q3 + p3 * q2
    r2 = p0 * q2 + p1 * q3 - p2 * q0 - p3 * q1
    r3 = p0 * q3 - p1 * q2 + p2 * q1 - p3 * q0
    if r0 < 0.0:
        r0, r1, r2, r3 = -r0, -r1, -r2, -r3
    bank = math.atan2(2.0 * (r1 * r0 + r2 * r3), r0 * r0 - r1 * r1 + r2 * r2 - r3 * r3)
    alpha = math.atan2(2.0 * (r0 * r2 + r1 * r3), r0 * r0 + r1 * r1 - r2 * r2 - r3 * r3)
    fill(command, 0.0)
    command[_BANK] = bank
    nominal = fields(AttitudeCode, code)
    command[_LOAD] = (alpha * nominal.CLa + nominal.CL0) / _pressure(V, nominal)
    command[THRUST] = thrust * travel[THRUST]
