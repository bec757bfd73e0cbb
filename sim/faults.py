"""Failures of a vehicle, planned or asked for in flight: one way into the tables that the compiled functions read."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ftcc.link.actuators import SLOT
from ftcc.link.failures import EVERY, Failure
from ftcc.sim import navigation
from ftcc.sim.navigation import NavigationFault
from ftcc.sim.plant import INTERMITTENT, STUCK, Fault, Fleet

__all__ = ["SPARE", "faults_of", "inject"]

SPARE = 24
"""Failures beyond the planned ones that a vehicle has room for."""

_NAVIGATION_KINDS = {
    "off": navigation.OFF,
    "stuck": navigation.STUCK,
    "slow": navigation.SLOW,
    "intermittent": navigation.INTERMITTENT,
}
_OFFSETS = {
    "SENSOR_GPS": ("FAIL_POS_N", "FAIL_POS_E", "FAIL_POS_D", "FAIL_VEL_N", "FAIL_VEL_E", "FAIL_VEL_D"),
    "SENSOR_GYRO": ("FAIL_ROLL", "FAIL_PITCH", "FAIL_YAW", "FAIL_P", "FAIL_Q", "FAIL_R"),
}
_PARTS = {"SENSOR_GPS": navigation.POSITION, "SENSOR_GYRO": navigation.ATTITUDE}


def inject(fleet: Fleet, i: int, fault: Fault | NavigationFault, now: float) -> bool:
    """From its time on (s, not before ``now``) the failure acts on vehicle ``i``.

    One of the same actuator or part and the same time is replaced. Returns False where there is no room left.
    """
    if isinstance(fault, Fault):
        table, counts = fleet.faults[i], fleet.fault_count
    else:
        table, counts = fleet.navigation[i], fleet.navigation_count
    rows = [row for row in table[: counts[i]] if (row[0], row[1]) != (fault[0], fault[1])]
    rows = _without_the_superseded(rows, now)
    if len(rows) == len(table):
        return False
    # Of several at one time the last one injected counts.
    place = sum(1 for row in rows if row[0] <= fault.time)
    rows = [*(row.copy() for row in rows[:place]), np.array(fault), *(row.copy() for row in rows[place:])]
    table[:] = 0.0
    table[:, 0] = math.inf
    table[: len(rows)] = rows
    counts[i] = len(rows)
    return True


def _without_the_superseded(rows: list[NDArray[np.float64]], now: float) -> list[NDArray[np.float64]]:
    """Leave out what has acted and acts no more."""
    past = {row[1]: n for n, row in enumerate(rows) if row[0] <= now}
    return [row for n, row in enumerate(rows) if row[0] > now or past[row[1]] == n]


def faults_of(fleet: Fleet, i: int, failure: Failure, time: float) -> list[Fault | NavigationFault]:
    """What a failure that the ground asks for means to vehicle ``i``; empty where it has no such part."""
    unit, kind, sizes = failure.meaning.unit, failure.meaning.kind, failure.sizes
    if unit.name in _PARTS:
        period, duty = sizes["FAIL_PERIOD"], sizes["FAIL_DUTY"]
        fault = NavigationFault(time, _PARTS[unit.name], _NAVIGATION_KINDS.get(kind, navigation.WRONG), period, duty)
        if kind == "wrong":
            offsets = dict(zip(NavigationFault._fields[5:], (sizes[n] for n in _OFFSETS[unit.name]), strict=True))
            fault = fault._replace(**offsets)
        return [fault]
    parts = unit.parts if failure.instance == EVERY else (unit.parts[failure.instance - 1],)
    slots = [SLOT[part] for part in parts if fleet.travel[i, SLOT[part]] > 0.0]
    return [_actuator_fault(kind, sizes, time, slot) for slot in slots]


def _actuator_fault(kind: str, sizes: Mapping[str, float], time: float, slot: int) -> Fault:
    healthy = Fault(time, slot, 1.0, 0.0, 0.0, 0.0)
    lossy = healthy._replace(effectiveness=sizes["FAIL_EFF"], bias=sizes["FAIL_BIAS"])
    match kind:
        case "wrong":
            return lossy._replace(effectiveness_onset=sizes["FAIL_EFF_RATE"], bias_onset=sizes["FAIL_BIAS_RATE"])
        case "off":
            return healthy._replace(effectiveness=0.0)
        case "stuck":
            return healthy._replace(kind=STUCK)
        case "slow":
            return healthy._replace(slew=sizes["FAIL_SLEW"])
        case "intermittent":
            return lossy._replace(kind=INTERMITTENT, period=sizes["FAIL_PERIOD"], duty=sizes["FAIL_DUTY"])
    return healthy
