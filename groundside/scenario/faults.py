"""The faults of a scenario, by vehicle, and whether a vehicle with a fault can still fly level."""

from __future__ import annotations

import math
from types import ModuleType

from ftcc.airside.references.profiles import Profile
from ftcc.groundside.scenario.checks import Findings
from ftcc.groundside.scenario.trims import disturbances_at, level_trim, speeds_at, times_to_check
from ftcc.groundside.schema import FaultFields, Plan
from ftcc.link.actuators import SLOT, unit_of
from ftcc.sim import navigation
from ftcc.sim.faults import INTERMITTENT, STUCK, WRONG, Fault
from ftcc.sim.navigation import NavigationFault
from ftcc.sim.spec import VehicleSpec

__all__ = ["actuator_faults", "check_fault_times", "check_faults", "fault_texts", "navigation_faults"]

_KINDS = {"stuck": STUCK, "intermittent": INTERMITTENT}
_PARTS = {"position": navigation.POSITION, "attitude": navigation.ATTITUDE}
_NAVIGATION_KINDS = {
    "wrong": navigation.WRONG,
    "off": navigation.OFF,
    "stuck": navigation.STUCK,
    "slow": navigation.SLOW,
    "intermittent": navigation.INTERMITTENT,
    "ok": navigation.WRONG,
}


def _part(fault: FaultFields) -> tuple[int, str | None, str | None]:
    """Return the faulty part: UAV, actuator, part of the navigation."""
    return fault.uav, fault.actuator, fault.navigation


def _with_repairs(plan: Plan) -> list[FaultFields]:
    """Return faults and repairs in order of time.

    A repair is added where a fault ends and no other fault of the same part begins at that time.
    """
    beginnings = {(fault.at, _part(fault)) for fault in plan.faults}
    repairs = [
        FaultFields(at=f.until, uav=f.uav, actuator=f.actuator, navigation=f.navigation, kind="ok")
        for f in plan.faults
        if f.until is not None and (f.until, _part(f)) not in beginnings
    ]
    return sorted([*plan.faults, *repairs], key=lambda f: f.at)


def check_fault_times(plan: Plan, findings: Findings) -> None:
    """Refuse a fault that begins before another fault of the same part ends at its ``until``."""
    for n, fault in enumerate(plan.faults):
        for m, other in enumerate(plan.faults):
            if m == n or fault.until is None or _part(other) != _part(fault):
                continue
            if fault.at <= other.at < fault.until:
                findings.refuse(
                    f"faults.{m}.at = {other.at:g}: faults.{n} of the same part of UAV {fault.uav} lasts from "
                    f"{fault.at:g} to {fault.until:g} s; begin after it, or leave out its until"
                )


def actuator_faults(plan: Plan, uav: int) -> tuple[Fault, ...]:
    """Return the faults of a UAV's actuators and their repairs, in order of time."""
    return tuple(
        Fault(
            f.at,
            float(SLOT[f.actuator]),
            0.0 if f.kind == "off" else f.effectiveness,
            f.bias,
            f.effectiveness_onset,
            f.bias_onset,
            float(_KINDS.get(f.kind, WRONG)),
            **{name: getattr(f, name) for name in ("slew", "period", "duty") if getattr(f, name) is not None},
        )
        for f in _with_repairs(plan)
        if f.uav == uav and f.actuator is not None
    )


def navigation_faults(plan: Plan, uav: int) -> tuple[NavigationFault, ...]:
    """Return the faults of a UAV's navigation solution and their repairs, in order of time."""
    return tuple(
        NavigationFault(
            f.at,
            float(_PARTS[f.navigation]),
            float(_NAVIGATION_KINDS[f.kind]),
            1.0 if f.period is None else f.period,
            1.0 if f.duty is None else f.duty,
            *f.offset,
            *f.rate_offset,
        )
        for f in _with_repairs(plan)
        if f.uav == uav and f.navigation is not None
    )


def fault_texts(plan: Plan) -> list[tuple[float, int | None, str]]:
    """Return begin and end of each fault as (time s, UAV, text)."""
    return [(fault.at, fault.uav, _fault_text(fault)) for fault in _with_repairs(plan)]


def _fault_text(fault: FaultFields) -> str:
    """Describe a fault, for the event log."""
    what = fault.actuator.replace("_", " ") if fault.actuator else f"navigation ({fault.navigation})"
    if fault.kind == "ok" or (fault.kind == "wrong" and fault.actuator and (fault.effectiveness, fault.bias) == (1, 0)):
        return f"{what} repaired"
    if fault.actuator is not None and fault.kind in ("wrong", "intermittent"):
        unit = f" {unit_of(fault.actuator)}".removesuffix(" -")
        how = "" if fault.kind == "wrong" else "intermittent "
        return f"{what} {how}fault: effectiveness {fault.effectiveness:.4g}, bias {fault.bias:.4g}{unit}"
    return f"{what} {fault.kind}"


def check_faults(
    plan: Plan, plant: ModuleType, vehicles: list[VehicleSpec], profiles: dict[int, Profile], findings: Findings
) -> None:
    """Refuse a fault without a level trim: (needed deflection - bias) / effectiveness must be within the travel.

    The trim is computed at the mission's speed or, if leaders change their speed, at each speed that they command
    during the fault. It includes the disturbances of that time; an oscillating one counts with its mean, 0. The air is
    still.
    """
    by_uav = {vehicle.uav: vehicle for vehicle in vehicles}
    for n, fault in enumerate(plan.faults):
        if fault.actuator is None or fault.kind not in ("wrong", "off"):
            continue
        remaining = 0.0 if fault.kind == "off" else fault.effectiveness
        vehicle = by_uav[fault.uav]
        later = [f.at for f in _with_repairs(plan) if _part(f) == _part(fault) and f.at > fault.at]
        low, high = vehicle.limits[SLOT[fault.actuator]]
        times = times_to_check(plan, profiles, vehicle, fault.at, min(later, default=math.inf))
        for at, speed in [(t, v) for t in times for v in sorted(speeds_at(plan, profiles, fault.uav, t))]:
            acting = disturbances_at(vehicle, plant, at)
            steady = level_trim(plant, plant.Parameters(*vehicle.airframe), speed, f"faults.{n}", findings, **acting)
            needed = steady.get(fault.actuator, 0.0)
            command = (needed - fault.bias) / remaining if remaining > 0.0 else math.inf
            if low < command < high or (remaining == 0.0 and needed == fault.bias):
                continue
            unit = unit_of(fault.actuator)
            text = (
                f"faults.{n} (effectiveness {remaining:g}, bias {fault.bias:g} {unit}): leaves "
                f"UAV {fault.uav} no level trim at {speed:g} m/s and t = {at:g} s: {fault.actuator} would need "
                f"the command ({needed:.3f} - {fault.bias:g})/{remaining:g} = {command:.3f} {unit}; "
                f"allowed is {low:g} to {high:g}"
            )
            if fault.without_trim:
                findings.warn(text)
            else:
                findings.refuse(f"{text} (without_trim = true flies it anyway)")
            break
