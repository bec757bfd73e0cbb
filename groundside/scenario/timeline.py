"""Planned events: the entries of the event log that follow from the scenario."""

from __future__ import annotations

from types import ModuleType

from ftcc.groundside.scenario.attacks import attack_texts
from ftcc.groundside.scenario.faults import fault_texts
from ftcc.groundside.scenario.links import link_texts
from ftcc.groundside.scenario.references import reference_texts
from ftcc.groundside.scenario.wind import wind_texts
from ftcc.groundside.schema import Plan

__all__ = ["PlannedEvent", "planned_events"]

PlannedEvent = tuple[float, int | None, str, str]
"""Time s, UAV (None: all UAVs), severity, text: "info" for a command, "warning" for a fault or a disturbance."""


def planned_events(plan: Plan, plant: ModuleType) -> tuple[PlannedEvent, ...]:
    """Return the planned events in order of time."""
    commands = [*_leader_texts(plan), *reference_texts(plan)]
    warnings = [
        *fault_texts(plan),
        *_disturbance_texts(plan, plant),
        *link_texts(plan.link_events),
        *attack_texts(plan),
        *wind_texts(plan),
    ]
    events = [(t, uav, "info", text) for t, uav, text in commands]
    events += [(t, uav, "warning", text) for t, uav, text in warnings]
    end = plan.duration + 1e-9
    return tuple(sorted((event for event in events if event[0] <= end), key=lambda e: (e[0], e[1] or 0, e[3])))


def _disturbance_texts(plan: Plan, plant: ModuleType) -> list[tuple[float, int | None, str]]:
    found: list[tuple[float, int | None, str]] = []
    units = dict(plant.DISTURBANCES)
    for disturbance in plan.disturbances:
        values = disturbance.values
        text = "disturbance " + ", ".join(f"{name} = {v:g} {units[name]}" for name, v in values.items())
        if disturbance.frequency is not None:
            text += f", oscillating with {disturbance.frequency:g} rad/s"
        for uav in [None] if disturbance.uavs is None else disturbance.uavs:
            found.append((disturbance.at, uav, text))
            if disturbance.until is not None:
                found.append((disturbance.until, uav, f"disturbance {', '.join(values)} over"))
    return found


def _leader_texts(plan: Plan) -> list[tuple[float, int | None, str]]:
    found: list[tuple[float, int | None, str]] = []
    for uav, leader in plan.leaders.items():
        for command in leader.commands:
            if command.at is not None:
                asked = [f"{command.altitude:g} m"] if command.altitude is not None else []
                asked += [f"{command.speed:g} m/s"] if command.speed is not None else []
                found.append((command.at, uav, f"leader commanded to {', '.join(asked)}"))
            if command.until is not None:
                found.append((command.until, uav, "leader commanded as before"))
        if leader.cosine is not None:
            found.append((leader.cosine.at, uav, "leader begins its cosine in altitude"))
    return found
