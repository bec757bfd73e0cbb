"""Actuator faults: effectiveness, bias, slow, stuck and intermittent actuators, and their onset."""

from __future__ import annotations

import math
from typing import NamedTuple

from ftcc.link.compiled import compiled, compiled_within, fields

__all__ = ["INTERMITTENT", "STUCK", "WRONG", "Fault", "fault_in_force", "faults_are_steady", "healthy", "onset"]

_ROUNDING = 1e-9
"""By how much a time may be short of the phase that it belongs to, s."""

_COMPLETE = 40.0
"""exp(-40) is lost beside 1: from there on an onset is complete, to the last bit."""

WRONG, STUCK, INTERMITTENT = range(3)
"""Kinds of `Fault`."""


class Fault(NamedTuple):
    """Columns of ``Fleet.faults``: from ``time`` on, the actuator acts as effectiveness * position + bias.

    A `STUCK` actuator holds its deflection; an `INTERMITTENT` fault is absent for a share of each period.
    """

    time: float
    """s."""
    actuator: float
    """Its slot, see ``link.actuators.SLOT``."""
    effectiveness: float
    """1 = healthy, 0 = without effect."""
    bias: float
    """In the unit of the actuator."""
    effectiveness_onset: float
    """Rate of the exponential onset of the loss, 1/s; 0 = step."""
    bias_onset: float
    """Rate of the exponential onset of the bias, 1/s; 0 = step."""
    kind: float = WRONG
    slew: float = math.inf
    """Fastest motion, rad/s or N/s; inf = no further limit."""
    period: float = 1.0
    """Of an intermittent fault, s."""
    duty: float = 1.0
    """Healthy share of each period, 0..1."""


_TIME, _ACTUATOR = Fault._fields.index("time"), Fault._fields.index("actuator")


@compiled_within
def onset(since, rate):
    """Share, 0..1, of its full size that a fault or disturbance has ``since`` s after it began; ``rate`` in 1/s."""
    return 1.0 if rate == 0.0 or rate * since > _COMPLETE else 1.0 - math.exp(-rate * since)


@compiled_within
def healthy(since, period, duty):
    """Whether an intermittent fault is absent ``since`` s after it began: for the share ``duty`` of each period (s)."""
    return (since + _ROUNDING) % period < duty * period


@compiled
def fault_in_force(fleet, i, actuator, time):
    """Effectiveness, bias and largest rate of an actuator of vehicle ``i`` at ``time`` (s), by its latest fault."""
    latest = -1
    for n in range(fleet.fault_count[i]):
        if time - fleet.faults[i, n, _TIME] >= 0.0 and int(fleet.faults[i, n, _ACTUATOR]) == actuator:
            latest = n
    if latest < 0:
        return 1.0, 0.0, fleet.rate[i, actuator]
    fault = fields(Fault, fleet.faults[i, latest])
    since = time - fault.time
    kind = int(fault.kind)
    if kind == STUCK:
        if fleet.held_since[i, actuator] != fault.time:
            fleet.held_since[i, actuator] = fault.time
            fleet.held[i, actuator] = fleet.deflection[i, actuator]
        return 0.0, fleet.held[i, actuator], fleet.rate[i, actuator]
    fleet.held_since[i, actuator] = math.inf
    if kind == INTERMITTENT and healthy(since, fault.period, fault.duty):
        return 1.0, 0.0, fleet.rate[i, actuator]
    effectiveness = 1.0 + (fault.effectiveness - 1.0) * onset(since, fault.effectiveness_onset)
    bias = fault.bias * onset(since, fault.bias_onset)
    return effectiveness, bias, min(fleet.rate[i, actuator], fault.slew)


@compiled
def faults_are_steady(fleet, i, begin, end):
    """Whether `fault_in_force` is the same from ``begin`` to ``end`` (s) for every actuator of vehicle ``i``.

    That is, no fault begins, grows, or comes and goes.
    """
    for n in range(fleet.fault_count[i]):
        fault = fields(Fault, fleet.faults[i, n])
        if fault.time > end:
            continue
        if fault.time > begin or int(fault.kind) == INTERMITTENT:
            return False
        since = begin - fault.time
        if onset(since, fault.effectiveness_onset) < 1.0 or onset(since, fault.bias_onset) < 1.0:
            return False
    return True
