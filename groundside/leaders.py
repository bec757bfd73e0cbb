"""The leaders' profiles from a scenario: commands by time, by position, or by the obstacles that they detect."""

from __future__ import annotations

import math

from ftcc.airside.references.profiles import Command, Cosine, Profile, SpeedWave, Trigger, trigger_rows
from ftcc.groundside.checks import Findings
from ftcc.groundside.schema import LeaderFields, Plan
from ftcc.link.graph import Graph

__all__ = ["profiles_of"]


def profiles_of(plan: Plan, graph: Graph, findings: Findings) -> dict[int, Profile]:
    """The profile of each leader, by id."""
    _check_reactions(plan, findings)
    findings.stop_if_refused()
    return {uav: _profile(plan, uav, graph, findings) for uav in graph.leaders}


def _profile(plan: Plan, uav: int, graph: Graph, findings: Findings) -> Profile:
    fields: LeaderFields = plan.leaders[uav]
    commands, triggers = [], []
    altitude, speed = fields.z, fields.V
    for command in fields.commands:
        altitude = altitude if command.altitude is None else command.altitude
        speed = speed if command.speed is None else command.speed
        if command.at is not None:
            commands.append(Command(command.at, altitude, speed))
        elif command.x is not None:
            triggers.append(Trigger(uav if command.uav is None else command.uav, command.x, altitude, speed))
    if fields.over_obstacles:
        triggers = _reaction(plan, uav)
    if commands != sorted(commands, key=lambda c: c.at):
        findings.refuse(f"leaders.{uav}.commands: must stand in the order of time")
    profile = Profile(
        x=fields.x,
        z=fields.z,
        V=fields.V,
        commands=tuple(commands),
        altitude_filter=(fields.altitude_filter.frequency, fields.altitude_filter.damping),
        speed_filter=(fields.speed_filter.frequency, fields.speed_filter.damping),
        cosine=Cosine(**fields.cosine.model_dump()) if fields.cosine else None,
        triggers=tuple(triggers),
        forward=fields.forward,
        speed_wave=SpeedWave(**fields.speed_wave.model_dump()) if fields.speed_wave else None,
        climb_limit=math.inf if fields.climb_limit is None else fields.climb_limit,
    )
    try:
        trigger_rows(profile, uav, graph.senders(uav))
    except ValueError as error:
        field = "over_obstacles" if fields.over_obstacles else "commands"
        findings.refuse(f"leaders.{uav}.{field}: {error}")
    return profile


def _check_reactions(plan: Plan, findings: Findings) -> None:
    """What must be given for leaders that climb over obstacles."""
    reacting = [uav for uav, leader in plan.leaders.items() if leader.over_obstacles]
    for uav in reacting:
        given = len(plan.leaders[uav].over_obstacles)
        if given != len(plan.obstacles):
            findings.refuse(f"leaders.{uav}.over_obstacles: {given} altitudes for {len(plan.obstacles)} obstacles")
        if any(command.x is not None for command in plan.leaders[uav].commands):
            findings.refuse(f"leaders.{uav}: takes either over_obstacles or commands by position")
    if reacting and plan.detection_range is None:
        findings.refuse("detection_range: is missing; the leaders climb over obstacles that they detect")
    if reacting and len({leader.V for leader in plan.leaders.values()}) > 1:
        findings.refuse("leaders: those that climb over obstacles together must fly at one speed")


def _reaction(plan: Plan, uav: int) -> list[Trigger]:
    """The commands by position of a leader that climbs over the obstacles.

    The foremost leader detects an obstacle, the hindmost is the last to leave it behind, and all act on both.
    """
    own, leaders = plan.leaders[uav], plan.leaders
    first = max(leaders, key=lambda leader: leaders[leader].x)
    last = min(leaders, key=lambda leader: leaders[leader].x)
    assert plan.detection_range is not None
    changes = []
    for obstacle, altitude in zip(plan.obstacles, own.over_obstacles, strict=True):
        seen, passed = obstacle.x[0] - plan.detection_range, obstacle.x[1]
        changes.append((seen - leaders[first].x, first, seen, altitude, True))
        changes.append((passed - leaders[last].x, last, passed, altitude, False))
    triggers, ahead = [], []
    for _, watched, x, altitude, begins in sorted(changes):
        if begins:
            ahead.append(altitude)
        else:
            ahead.remove(altitude)
        triggers.append(Trigger(watched, x, max(ahead, default=own.z), own.V))
    return triggers
