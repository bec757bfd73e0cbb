"""Checks of healthy aircraft: the start is within the model, and the travel is enough for level flight."""

from __future__ import annotations

import math
from collections.abc import Iterable
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.references.profiles import Profile
from ftcc.groundside.scenario.checks import Findings
from ftcc.groundside.schema import Plan
from ftcc.link.actuators import SLOT, unit_of
from ftcc.sim import plants
from ftcc.sim.jsbsim.aircraft import JsbsimError
from ftcc.sim.jsbsim.flight import FlownAircraft
from ftcc.sim.plant import AIRSPEED, CLIMB, INCIDENCE, LOST, SIDESLIP, TRUTH, UNITS
from ftcc.sim.spec import VehicleSpec
from ftcc.sim.trim import TrimError

__all__ = [
    "check_starts",
    "check_trims",
    "disturbances_at",
    "level_trim",
    "speeds_at",
    "times_to_check",
    "truth_at_start",
]

_GUARDED = {
    AIRSPEED: ("V", "least_airspeed"),
    CLIMB: ("gamma", "flight_path_angle"),
    INCIDENCE: ("alpha", "angle_of_attack"),
    SIDESLIP: ("beta", "sideslip"),
}
"""Quantity and guard of each reason for which an aircraft is lost."""


def truth_at_start(vehicle: VehicleSpec) -> NDArray[np.float64]:
    """Return the state of an aircraft at its start, in the order of ``TRUTH``."""
    plant = plants.find(vehicle.plant)
    true = np.zeros(len(TRUTH))
    plant.truth(plant.State(*vehicle.initial), plant.Inputs(*vehicle.command), vehicle.offset, true)
    return true


def level_trim(
    plant: ModuleType,
    airframe: Any,
    V: float,
    where: str,
    findings: Findings,
    flown: FlownAircraft | None = None,
    **disturbances: float,
) -> dict[str, float]:
    """Return the level trim at ``V`` (m/s) under disturbances, by actuator; refuse, and return {}, if there is none."""
    model = {} if flown is None else {"flown": flown}
    try:
        return dict(plant.level(airframe, V, **model, **disturbances)._asdict())
    except (TrimError, JsbsimError) as error:
        findings.refuse(f"{where}: {error}")
        return {}


def disturbances_at(vehicle: VehicleSpec, plant: ModuleType, at: float) -> dict[str, float]:
    """Return a vehicle's disturbances at ``at`` (s), by name, after their onset.

    An oscillating disturbance counts with its mean, 0.
    """
    return {
        name: sum(
            d.value
            for d in vehicle.disturbances
            if d.channel == channel and d.time <= at < d.until and d.frequency == 0.0
        )
        for channel, (name, _) in enumerate(plant.DISTURBANCES)
    }


def speeds_at(plan: Plan, profiles: dict[int, Profile], uav: int, at: float) -> set[float]:
    """Return the airspeeds (m/s) at which a UAV must be able to fly level at ``at`` (s).

    They are the leaders' commanded speeds, if these change; else the mission's speed, or the UAV's initial speed.
    """
    speeds = {speed for p in profiles.values() for speed in (p.V, *(command.speed for command in p.commands))}
    if len(speeds) > 1:
        return {[p.V, *(c.speed for c in p.commands if c.at <= at)][-1] for p in profiles.values()}
    if plan.mission is not None:
        return {plan.mission.V}
    own = plan.start.uav.get(uav, plan.start)
    return {own.V or plan.start.V or math.nan}


def times_to_check(
    plan: Plan, profiles: dict[int, Profile], vehicle: VehicleSpec, begin: float, end: float
) -> list[float]:
    """Return ``begin`` and the times before ``end`` (s) at which a vehicle's speed or disturbance changes."""
    times = {command.at for p in profiles.values() for command in p.commands}
    times |= {time for disturbance in vehicle.disturbances for time in (disturbance.time, disturbance.until)}
    return sorted({begin} | {t for t in times if begin < t < min(end, plan.duration)})


def check_starts(plan: Plan, plant: ModuleType, vehicles: Iterable[VehicleSpec], findings: Findings) -> None:
    """Refuse initial states beyond the guards, and actuators that start beyond their travel."""
    for vehicle in vehicles:
        if vehicle.kind != "aircraft" or math.isnan(sum(vehicle.initial)):
            continue
        reason = int(plant.lost(plant.State(*vehicle.initial), vehicle.guards))
        if reason in _GUARDED:
            quantity, guard = _GUARDED[reason]
            value, unit = float(truth_at_start(vehicle)[TRUTH.index(quantity)]), UNITS[quantity]
            findings.refuse(
                f"start of UAV {vehicle.uav}: {LOST[reason]}: {quantity} = {value:.3g} {unit}, "
                f"plant.guards.{guard} = {getattr(vehicle.guards, guard):g} {unit}"
            )
    given = plan.plant.initial_actuators
    for name, position in given.items() if isinstance(given, dict) else ():
        low, high = getattr(plan.plant.limits, name) or (-math.inf, math.inf)
        if not low <= position <= high:
            findings.refuse(
                f"plant.initial_actuators.{name} = {position:g}: plant.limits.{name} is {low:g} to {high:g} "
                f"{unit_of(name)}"
            )


def check_trims(
    plan: Plan, plant: ModuleType, vehicles: Iterable[VehicleSpec], profiles: dict[int, Profile], findings: Findings
) -> None:
    """Refuse a healthy aircraft that cannot fly level within its travel, at its start or under a disturbance."""
    report = findings.warn if plan.plant.beyond_limits else findings.refuse
    problems: dict[str, list[int]] = {}
    for vehicle in vehicles:
        text = _first_beyond_travel(plan, plant, vehicle, profiles, findings) if vehicle.kind == "aircraft" else ""
        if text:
            problems.setdefault(text, []).append(vehicle.uav)
    for text, uavs in problems.items():
        report(f"UAV {', '.join(map(str, uavs))}: {text} (plant.beyond_limits = true flies it anyway)")


def _first_beyond_travel(
    plan: Plan, plant: ModuleType, vehicle: VehicleSpec, profiles: dict[int, Profile], findings: Findings
) -> str:
    """Describe the first level trim beyond a healthy aircraft's travel; "" if there is none."""
    for at in times_to_check(plan, profiles, vehicle, 0.0, math.inf):
        for speed in sorted(speeds_at(plan, profiles, vehicle.uav, at)):
            where = f"UAV {vehicle.uav} at t = {at:g} s"
            acting = disturbances_at(vehicle, plant, at)
            steady = level_trim(
                plant, plant.Parameters(*vehicle.airframe), speed, where, findings, vehicle.flown, **acting
            )
            for name in plant.ACTUATORS:
                low, high = vehicle.limits[SLOT[name]]
                if not low <= steady.get(name, low) <= high:
                    unit = f" {unit_of(name)}".removesuffix(" -")
                    return (
                        f"no level trim at {speed:g} m/s and t = {at:g} s: {name} would need {steady[name]:.3f}{unit}; "
                        f"plant.limits.{name} is {low:g} to {high:g}{unit}"
                    )
    return ""
