"""Actuators: the command in force, its delay, limits, lag and rate limit, and what acts on the airframe."""

from __future__ import annotations

import math
from typing import NamedTuple

from ftcc.link.actuators import ACTUATORS, THRUST
from ftcc.link.compiled import compiled, compiled_within, copy, fields
from ftcc.sim.faults import fault_in_force

__all__ = [
    "IDLE",
    "NO_AUTOTHROTTLE",
    "Autothrottle",
    "Drive",
    "actuate",
    "drive_of",
    "has_autothrottle",
    "hold_speed",
    "latch",
    "stroke",
]


class Autothrottle(NamedTuple):
    """The vehicle's own speed hold, which replaces the commanded thrust: thrust + gain (airspeed - V) within limits."""

    gain: float
    """N per m/s; 0 = none."""
    airspeed: float
    """m/s."""
    thrust: float
    """N."""


NO_AUTOTHROTTLE = Autothrottle(0.0, 0.0, 0.0)


class Drive(NamedTuple):
    """What moves an actuator in a step; the same in all steps in which its command and its faults are."""

    effectiveness: float
    bias: float
    """In the unit of the actuator."""
    rate: float
    """Fastest motion, rad/s or N/s; inf = no limit."""
    target: float
    """The command within its limits, rad or N."""
    half_decay: float
    """Share of the way to the target that the lag leaves after half a step, 0..1,"""
    decay: float
    """and after the whole step."""


IDLE = Drive(1.0, 0.0, math.inf, 0.0, 1.0, 1.0)
"""Of an actuator that the plant does not have."""

_GAIN = Autothrottle._fields.index("gain")


@compiled
def latch(fleet, i, command):
    """Put ``command`` (4,), rad and N, into force; with a delay, the command of that many samples before.

    The first command counts as all those before it, unless the delay line is filled from the start.
    """
    line = fleet.delayed[i]
    last = line.shape[0] - 1
    if last < 0:
        copy(command, fleet.command[i])
        return
    if fleet.waiting[i] == 0:
        for n in range(last + 1):
            copy(command, line[n])
        fleet.waiting[i] = 1
    copy(line[0], fleet.command[i])
    for n in range(last):
        copy(line[n + 1], line[n])
    copy(command, line[last])


@compiled_within
def has_autothrottle(fleet, i):
    """Whether an autothrottle sets the thrust of vehicle ``i``."""
    return fleet.autothrottle[i, _GAIN] > 0.0


@compiled_within
def _saturated(fleet, i, actuator):
    wanted = fleet.command[i, actuator]
    if actuator == THRUST and has_autothrottle(fleet, i):
        wanted = fleet.speed_hold[i]
    return min(max(wanted, fleet.limits[i, actuator, 0]), fleet.limits[i, actuator, 1])


@compiled_within
def hold_speed(fleet, i, airspeed):
    """Set the thrust by which the autothrottle of vehicle ``i`` answers this airspeed (m/s)."""
    hold = fields(Autothrottle, fleet.autothrottle[i])
    fleet.speed_hold[i] = hold.thrust + hold.gain * (hold.airspeed - airspeed)


@compiled_within
def _immediate(fleet, i, actuator, rate):
    return fleet.lag[i, actuator] == 0.0 and rate == math.inf


@compiled
def actuate(fleet, i, time):
    """Set what acts on vehicle ``i`` at ``time`` (s) under the command in force: actuator positions with faults."""
    for actuator in range(len(ACTUATORS)):
        effectiveness, bias, rate = fault_in_force(fleet, i, actuator, time)
        if _immediate(fleet, i, actuator, rate):
            fleet.position[i, actuator] = _saturated(fleet, i, actuator)
        elif fleet.fault_before_lag[i] > 0.0:
            effectiveness, bias = 1.0, 0.0
        fleet.acting[i, actuator] = effectiveness * fleet.position[i, actuator] + bias
        fleet.deflection[i, actuator] = fleet.acting[i, actuator]


@compiled
def _moved(before, target, lag, rate, since, decay):
    """Position ``since`` s after ``before`` on the way to ``target``: pos' = lag (target - pos), at most ``rate``.

    ``decay`` is exp(-lag since).
    """
    away = abs(target - before)
    if lag * away <= rate and lag > 0.0:
        return target + (before - target) * decay
    slowing = rate / lag if lag > 0.0 else 0.0
    until = (away - slowing) / rate
    direction = 1.0 if target > before else -1.0
    if since < until:
        return before + direction * rate * since
    return target - direction * slowing * math.exp(-lag * (since - until))


@compiled
def _swung(before, speed, target, frequency, damping, since):
    """Position and rate of a second-order actuator ``since`` s after ``before`` and ``speed``, exactly."""
    decay, beat = damping * frequency, frequency * math.sqrt(1.0 - damping * damping)
    offset = before - target
    lead = (speed + decay * offset) / beat
    shrunk, cosine, sine = math.exp(-decay * since), math.cos(beat * since), math.sin(beat * since)
    swing = shrunk * (offset * cosine + lead * sine)
    return target + swing, shrunk * beat * (lead * cosine - offset * sine) - decay * swing


@compiled
def drive_of(fleet, i, actuator, time, step):
    """The `Drive` of an actuator in a ``step`` (s) whose middle, at which a fault is taken, is at ``time`` (s)."""
    effectiveness, bias, rate = fault_in_force(fleet, i, actuator, time)
    lag = fleet.lag[i, actuator]
    target = _saturated(fleet, i, actuator)
    return Drive(effectiveness, bias, rate, target, math.exp(-lag * (0.5 * step)), math.exp(-lag * step))


@compiled
def stroke(fleet, i, actuator, drive, step):
    """Acting deflection at the beginning, middle and end of a ``step`` (s), with lag and rate limit integrated exactly.

    ``drive`` is that of `drive_of`.
    """
    effectiveness, bias, rate, target = drive.effectiveness, drive.bias, drive.rate, drive.target
    before = fleet.position[i, actuator]
    if _immediate(fleet, i, actuator, rate):
        fleet.position[i, actuator] = target
        deflection = effectiveness * target + bias
        fleet.deflection[i, actuator] = deflection
        return deflection, deflection, deflection
    if fleet.fault_before_lag[i] > 0.0:
        target = effectiveness * target + bias
        effectiveness, bias = 1.0, 0.0
    lag = fleet.lag[i, actuator]
    if fleet.damping[i, actuator] > 0.0 and rate >= fleet.rate[i, actuator]:
        speed, damping = fleet.speed[i, actuator], fleet.damping[i, actuator]
        middle, _ = _swung(before, speed, target, lag, damping, 0.5 * step)
        after, fleet.speed[i, actuator] = _swung(before, speed, target, lag, damping, step)
    else:
        middle = _moved(before, target, lag, rate, 0.5 * step, drive.half_decay)
        after = _moved(before, target, lag, rate, step, drive.decay)
    fleet.position[i, actuator] = after
    fleet.deflection[i, actuator] = effectiveness * after + bias
    return effectiveness * before + bias, effectiveness * middle + bias, fleet.deflection[i, actuator]
