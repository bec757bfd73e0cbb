"""The faults of a scenario, by vehicle, and whether a vehicle with a fault can still fly level."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
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

__all__ = [
    "TrimDemand",
    "actuator_faults",
    "check_fault_times",
    "check_faults",
    "fault_texts",
    "navigation_faults",
    "trim_demands",
]

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


@dataclass(frozen=True)
class TrimDemand:
    """What level flight asks of a faulty actuator."""

    at: float
    """Time, s."""
    speed: float
    """Airspeed, m/s."""
    needed: float
    """Deflection of the level trim, rad, or thrust, N."""
    low: float
    high: float
    """Travel of the command."""

    def command(self, effectiveness: float, bias: float) -> float:
        """Return the command that gives the needed deflection; inf if none does."""
        return (self.needed - bias) / effectiveness if effectiveness > 0.0 else math.inf

    def margin(self, effectiveness: float, bias: float) -> float:
        """Return how far that command is from the nearer end of its travel, over half the travel; <= 0: no level trim.

        A dead actuator that stands where level flight needs it has all its margin, 1.
        """
        if effectiveness == 0.0 and self.needed == bias:
            return 1.0
        command = self.command(effectiveness, bias)
        if math.isinf(self.high - self.low):
            return 1.0 if self.low < command < self.high else -1.0
        return 2.0 * min(command - self.low, self.high - command) / (self.high - self.low)


def trim_demands(
    plan: Plan,
    plant: ModuleType,
    vehicles: list[VehicleSpec],
    profiles: dict[int, Profile],
    n: int,
    findings: Findings,
) -> Iterator[TrimDemand]:
    """Yield what level flight asks of the actuator of fault ``n``, at each time and speed of the fault.

    The trim is computed at the mission's speed or, if leaders change their speed, at each speed that they command
    during the fault. It includes the disturbances of that time; an oscillating one counts with its mean, 0. The air is
    still. Of stuck, slow and intermittent actuators, and of navigation, nothing is asked.
    """
    fault = plan.faults[n]
    if fault.actuator is None or fault.kind not in ("wrong", "off"):
        return
    vehicle = next(vehicle for vehicle in vehicles if vehicle.uav == fault.uav)
    later = [f.at for f in _with_repairs(plan) if _part(f) == _part(fault) and f.at > fault.at]
    low, high = vehicle.limits[SLOT[fault.actuator]]
    times = times_to_check(plan, profiles, vehicle, fault.at, min(later, default=math.inf))
    for at, speed in [(t, v) for t in times for v in sorted(speeds_at(plan, profiles, fault.uav, t))]:
        acting = disturbances_at(vehicle, plant, at)
        airframe = plant.Parameters(*vehicle.airframe)
        steady = level_trim(plant, airframe, speed, f"faults.{n}", findings, vehicle.flown, **acting)
        yield TrimDemand(at, speed, steady.get(fault.actuator, 0.0), low, high)


def check_faults(
    plan: Plan, plant: ModuleType, vehicles: list[VehicleSpec], profiles: dict[int, Profile], findings: Findings
) -> None:
    """Refuse a fault without a level trim: (needed deflection - bias) / effectiveness must be within the travel."""
    for n, fault in enumerate(plan.faults):
        remaining = 0.0 if fault.kind == "off" else fault.effectiveness
        for demand in trim_demands(plan, plant, vehicles, profiles, n, findings):
            if demand.margin(remaining, fault.bias) > 0.0:
                continue
            unit = unit_of(str(fault.actuator))
            text = (
                f"faults.{n} (effectiveness {remaining:g}, bias {fault.bias:g} {unit}): leaves "
                f"UAV {fault.uav} no level trim at {demand.speed:g} m/s and t = {demand.at:g} s: {fault.actuator} "
                f"would need the command ({demand.needed:.3f} - {fault.bias:g})/{remaining:g} = "
                f"{demand.command(remaining, fault.bias):.3f} {unit}; allowed is {demand.low:g} to {demand.high:g}"
            )
            if fault.without_trim:
                findings.warn(text)
            else:
                findings.refuse(f"{text} (without_trim = true flies it anyway)")
            break
