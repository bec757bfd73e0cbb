"""Failures of the navigation solution: what a vehicle reports of its position and attitude where GPS or gyros fail.

They act on the fields of the two state messages, behind noise. Whatever fails, the fields stay numbers.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ftcc.link.compiled import compiled
from ftcc.sim.plant import healthy

__all__ = ["ATTITUDE", "INTERMITTENT", "OFF", "POSITION", "SLOW", "STUCK", "WRONG", "NavigationFault", "navigate"]

POSITION, ATTITUDE = range(2)
"""What fails: position and velocity, or attitude and rates."""

WRONG, OFF, STUCK, SLOW, INTERMITTENT = range(5)
"""Kinds of `NavigationFault`."""

_ROUNDING = 1e-9
"""By how much a number of periods may be short of a whole one."""

_FIRST = (7, 0)
"""The first field of the message that fails, by what fails."""
_LAST = (13, 7)


class NavigationFault(NamedTuple):
    """Columns of ``Fleet.navigation``: from ``time`` on, until the next one of the same ``part``."""

    time: float
    """s."""
    part: float
    """`POSITION` or `ATTITUDE`."""
    kind: float = WRONG
    """`WRONG`: with the offsets below. `OFF`: dead reckoning by the velocity held, or no rates and the attitude held.
    `STUCK`: held. `SLOW`: fresh once in a period, else held. `INTERMITTENT`: fresh for a share of each period, else
    held."""
    period: float = 1.0
    """s."""
    duty: float = 1.0
    """Share of a period in which an intermittent solution is fresh."""
    first: float = 0.0
    second: float = 0.0
    third: float = 0.0
    """Offsets of position north, east, down (m), or of roll, pitch and yaw (rad, about the body's axes)."""
    first_rate: float = 0.0
    second_rate: float = 0.0
    third_rate: float = 0.0
    """Offsets of velocity north, east, down (m/s), or of the rates p, q, r (rad/s)."""


@compiled
def _turn(message, roll, pitch, yaw):
    """Turn the attitude of ``message`` by small angles about the body's axes, one after the other."""
    for axis in range(3):
        angle = 0.5 * (yaw if axis == 0 else pitch if axis == 1 else roll)
        c, s = math.cos(angle), math.sin(angle)
        q0, q1, q2, q3 = message[0], message[1], message[2], message[3]
        if axis == 0:
            message[0], message[1], message[2], message[3] = (
                c * q0 - s * q3,
                c * q1 + s * q2,
                c * q2 - s * q1,
                c * q3 + s * q0,
            )
        elif axis == 1:
            message[0], message[1], message[2], message[3] = (
                c * q0 - s * q2,
                c * q1 - s * q3,
                c * q2 + s * q0,
                c * q3 + s * q1,
            )
        else:
            message[0], message[1], message[2], message[3] = (
                c * q0 - s * q1,
                c * q1 + s * q0,
                c * q2 + s * q3,
                c * q3 - s * q2,
            )


@compiled
def _wrong(message, part, fault):
    if part == POSITION:
        for n in range(6):
            message[7 + n] += fault[5 + n]
    else:
        _turn(message, fault[5], fault[6], fault[7])
        for n in range(3):
            message[4 + n] += fault[8 + n]


@compiled
def _updated(fleet, i, part, kind, since, fault):
    """Whether a solution that is not right all the time is fresh at this tick."""
    if fleet.fresh[i, part] < 0.0:
        return True  # there is nothing yet that could be held
    if kind == SLOW:
        count = int(since / fault[3] + _ROUNDING)
        if count != fleet.updates[i, part]:
            fleet.updates[i, part] = count
            return True
        return False
    return kind == INTERMITTENT and healthy(since, fault[3], fault[4])


@compiled
def _keep(fleet, i, part, time, message):
    for n in range(_FIRST[part], _LAST[part]):
        fleet.solution[i, n] = message[n]
    fleet.fresh[i, part] = time


@compiled
def navigate(fleet, i, time, message):
    """What becomes of the state messages' fields (13,) of vehicle ``i`` at ``time`` (s) where its navigation fails."""
    for part in range(2):
        latest = -1
        for n in range(fleet.navigation_count[i]):
            if time - fleet.navigation[i, n, 0] >= 0.0 and int(fleet.navigation[i, n, 1]) == part:
                latest = n
        kind = int(fleet.navigation[i, latest, 2]) if latest >= 0 else WRONG
        if kind == WRONG:
            _keep(fleet, i, part, time, message)
            fleet.updates[i, part] = 0
            if latest >= 0:
                _wrong(message, part, fleet.navigation[i, latest])
        elif _updated(fleet, i, part, kind, time - fleet.navigation[i, latest, 0], fleet.navigation[i, latest]):
            _keep(fleet, i, part, time, message)
        else:
            for n in range(_FIRST[part], _LAST[part]):
                message[n] = fleet.solution[i, n]
            if kind == OFF:
                for n in range(3):
                    if part == POSITION:
                        message[7 + n] += message[10 + n] * (time - fleet.fresh[i, part])
                    else:
                        message[4 + n] = 0.0
    for n in range(message.shape[0]):
        message[n] = float(np.float32(message[n]))
