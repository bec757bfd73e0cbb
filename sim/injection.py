"""Faults of a vehicle, planned or injected in flight: the one way into the tables that compiled functions read."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ftcc.link.actuators import SLOT
from ftcc.link.failures import EVERY, Failure
from ftcc.sim import navigation
from ftcc.sim.faults import INTERMITTENT, STUCK, Fault
from ftcc.sim.fleet import Fleet
from ftcc.sim.navigation import NavigationFault

__all__ = ["SPARE", "faults_of", "inject"]

SPARE = 24
"""Faults beyond the planned ones that a vehicle has room for, of actuators and of navigation each."""

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
_OFFSET_FIELDS = ("first", "second", "third", "first_rate", "second_rate", "third_rate")
"""Of `NavigationFault`, in the order of `_OFFSETS`."""
_PARTS = {"SENSOR_GPS": navigation.POSITION, "SENSOR_GYRO": navigation.ATTITUDE}


def inject(fleet: Fleet, i: int, fault: Fault | NavigationFault, now: float) -> bool:
    """Enter a fault of vehicle ``i``, which acts from its time on (s, not before ``now``).

    It replaces one of the same actuator or part at the same time. Returns False where there is no room left.
    """
    if isinstance(fault, Fault):
        table, counts = fleet.faults[i], fleet.fault_count
    else:
        table, counts = fleet.navigation[i], fleet.navigation_count
    rows = [row for row in table[: counts[i]] if (row[0], row[1]) != fault[:2]]
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
    """Leave out faults that have acted and act no more."""
    past = {row[1]: n for n, row in enumerate(rows) if row[0] <= now}
    return [row for n, row in enumerate(rows) if row[0] > now or past[row[1]] == n]


def faults_of(fleet: Fleet, i: int, failure: Failure, time: float) -> list[Fault | NavigationFault]:
    """The faults of vehicle ``i`` that a MAVLink failure means, from ``time`` (s) on; empty without such a part."""
    unit, kind, sizes = failure.meaning.unit, failure.meaning.kind, failure.sizes
    if unit.name in _PARTS:
        period, duty = sizes["FAIL_PERIOD"], sizes["FAIL_DUTY"]
        fault = NavigationFault(time, _PARTS[unit.name], _NAVIGATION_KINDS.get(kind, navigation.WRONG), period, duty)
        if kind == "wrong":
            offsets = dict(zip(_OFFSET_FIELDS, (sizes[n] for n in _OFFSETS[unit.name]), strict=True))
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
