"""Angles within half a turn, and attitudes as quaternions, scalar first, as MAVLink carries them."""

from __future__ import annotations

import math

from ftcc.link.compiled import compiled

__all__ = ["body_attitude", "body_axes", "nearest_turn", "quaternion_product", "wrapped"]


@compiled
def nearest_turn(angle, to):
    """``angle`` plus the whole turns that bring it within half a turn of ``to`` (rad); itself, bit for bit, if it is.

    nan and inf are returned as they are.
    """
    away = angle - to
    if not math.pi < abs(away) < math.inf:
        return angle
    return angle - 2.0 * math.pi * math.floor((away + math.pi) / (2.0 * math.pi))


@compiled
def wrapped(angle):
    """``angle`` (rad) within half a turn of 0: for a difference of two angles, the shorter way."""
    return nearest_turn(angle, 0.0)


@compiled
def quaternion_product(a0, a1, a2, a3, b0, b1, b2, b3):
    """The four components of a b."""
    return (
        a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3,
        a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2,
        a0 * b2 - a1 * b3 + a2 * b0 + a3 * b1,
        a0 * b3 + a1 * b2 - a2 * b1 + a3 * b0,
    )


@compiled
def body_attitude(chi, gamma, mu, alpha, beta):
    """Body axes to north-east-down: the path frame (chi, gamma, mu) turned by sideslip and angle of attack; rad."""
    q0, q1, q2, q3 = math.cos(0.5 * chi), 0.0, 0.0, math.sin(0.5 * chi)
    q0, q1, q2, q3 = quaternion_product(q0, q1, q2, q3, math.cos(0.5 * gamma), 0.0, math.sin(0.5 * gamma), 0.0)
    q0, q1, q2, q3 = quaternion_product(q0, q1, q2, q3, math.cos(0.5 * mu), math.sin(0.5 * mu), 0.0, 0.0)
    q0, q1, q2, q3 = quaternion_product(q0, q1, q2, q3, math.cos(0.5 * beta), 0.0, 0.0, -math.sin(0.5 * beta))
    return quaternion_product(q0, q1, q2, q3, math.cos(0.5 * alpha), 0.0, math.sin(0.5 * alpha), 0.0)


@compiled
def body_axes(q0, q1, q2, q3):
    """Nose, right wing and belly of the attitude: unit vectors in north-east-down, columns of its rotation matrix."""
    return (
        (q0 * q0 + q1 * q1 - q2 * q2 - q3 * q3, 2.0 * (q1 * q2 + q0 * q3), 2.0 * (q1 * q3 - q0 * q2)),
        (2.0 * (q1 * q2 - q0 * q3), q0 * q0 - q1 * q1 + q2 * q2 - q3 * q3, 2.0 * (q2 * q3 + q0 * q1)),
        (2.0 * (q1 * q3 + q0 * q2), 2.0 * (q2 * q3 - q0 * q1), q0 * q0 - q1 * q1 - q2 * q2 + q3 * q3),
    )
