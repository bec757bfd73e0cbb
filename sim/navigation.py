"""Navigation faults: what a vehicle reports of its position and attitude when GPS or gyros fail.

They act on the fields of the two state messages, behind noise. Whatever fails, the fields stay finite.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ftcc.link.compiled import compiled, fields, store
from ftcc.link.messages import StateMessage
from ftcc.sim.faults import healthy

__all__ = ["ATTITUDE", "INTERMITTENT", "OFF", "POSITION", "SLOW", "STUCK", "WRONG", "NavigationFault", "navigate"]

POSITION, ATTITUDE = range(2)
"""What fails, the part of a `NavigationFault`: position and velocity, or attitude and rates."""

WRONG, OFF, STUCK, SLOW, INTERMITTENT = range(5)
"""Kinds of `NavigationFault`."""

_ROUNDING = 1e-9
"""By how much a number of periods may be short of a whole one."""

_ATTITUDE, _RATES, _POSITION, _VELOCITY = (StateMessage._fields.index(name) for name in ("q1", "rollspeed", "x", "vx"))
"""Where they begin in a `StateMessage`."""
_FIRST = (_POSITION, _ATTITUDE)
"""The first field of the message that fails, by what fails."""
_END = (len(StateMessage._fields), _POSITION)
"""Behind the last one."""


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


_TIME, _PART = NavigationFault._fields.index("time"), NavigationFault._fields.index("part")


@compiled
def _turned(q0, q1, q2, q3, axis, angle):
    """The attitude quaternion turned by ``angle`` (rad) about the body's axis 0, 1 or 2."""
    c, s = math.cos(0.5 * angle), math.sin(0.5 * angle)
    if axis == 0:
        return c * q0 - s * q1, c * q1 + s * q0, c * q2 + s * q3, c * q3 - s * q2
    if axis == 1:
        return c * q0 - s * q2, c * q1 - s * q3, c * q2 + s * q0, c * q3 + s * q1
    return c * q0 - s * q3, c * q1 + s * q2, c * q2 - s * q1, c * q3 + s * q0


@compiled
def _offset(message, part, fault):
    """Add the offsets of a wrong navigation solution; an attitude is turned by yaw, pitch and roll, in this order."""
    offsets = (fault.first, fault.second, fault.third)
    rates = (fault.first_rate, fault.second_rate, fault.third_rate)
    if part == POSITION:
        for n in range(len(offsets)):
            message[_POSITION + n] += offsets[n]
            message[_VELOCITY + n] += rates[n]
        return
    roll, pitch, yaw = offsets
    sent = fields(StateMessage, message)
    q1, q2, q3, q4 = _turned(sent.q1, sent.q2, sent.q3, sent.q4, 2, yaw)
    q1, q2, q3, q4 = _turned(q1, q2, q3, q4, 1, pitch)
    store(_turned(q1, q2, q3, q4, 0, roll), message[_ATTITUDE:_RATES])
    for n in range(len(rates)):
        message[_RATES + n] += rates[n]


@compiled
def _is_fresh(fleet, i, part, fault, since):
    """Whether a slow or intermittent solution is fresh at this tick, ``since`` s after its fault began."""
    if fleet.fresh[i, part] < 0.0:
        return True  # there is nothing yet that could be held
    if fault.kind == SLOW:
        count = int(since / fault.period + _ROUNDING)
        if count != fleet.updates[i, part]:
            fleet.updates[i, part] = count
            return True
        return False
    return fault.kind == INTERMITTENT and healthy(since, fault.period, fault.duty)


@compiled
def _keep(fleet, i, part, time, message):
    """Remember a fresh solution, to be held later."""
    for n in range(_FIRST[part], _END[part]):
        fleet.solution[i, n] = message[n]
    fleet.fresh[i, part] = time


@compiled
def _hold(fleet, i, part, time, kind, message):
    """Replace what fails by the last fresh solution; `OFF`: by dead reckoning, or the attitude held without rates."""
    for n in range(_FIRST[part], _END[part]):
        message[n] = fleet.solution[i, n]
    if kind == OFF:
        for n in range(3):
            if part == POSITION:
                message[_POSITION + n] += message[_VELOCITY + n] * (time - fleet.fresh[i, part])
            else:
                message[_RATES + n] = 0.0


@compiled
def _latest(fleet, i, part, time):
    """Row of the navigation fault of ``part`` in force at ``time`` (s); -1 where there is none."""
    latest = -1
    for n in range(fleet.navigation_count[i]):
        if time - fleet.navigation[i, n, _TIME] >= 0.0 and int(fleet.navigation[i, n, _PART]) == part:
            latest = n
    return latest


@compiled
def navigate(fleet, i, time, message):
    """Apply the navigation faults of vehicle ``i`` at ``time`` (s) to its `StateMessage` (13,), in place."""
    for part in range(2):
        latest = _latest(fleet, i, part, time)
        if latest < 0:
            _keep(fleet, i, part, time, message)
            fleet.updates[i, part] = 0
            continue
        fault = fields(NavigationFault, fleet.navigation[i, latest])
        kind = int(fault.kind)
        if kind == WRONG:
            _keep(fleet, i, part, time, message)
            fleet.updates[i, part] = 0
            _offset(message, part, fault)
        elif _is_fresh(fleet, i, part, fault, time - fault.time):
            _keep(fleet, i, part, time, message)
        else:
            _hold(fleet, i, part, time, kind, message)
    for n in range(message.shape[0]):
        message[n] = float(np.float32(message[n]))
