"""The leaders' profiles: commands by time, by position, or by detected obstacles."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from ftcc.airside.references.longitudinal import Reference
from ftcc.airside.references.profiles import (
    Command,
    Cosine,
    Profile,
    SpeedWave,
    Trigger,
    climb_range,
    sampled,
    trigger_rows,
)
from ftcc.groundside.scenario.checks import Findings
from ftcc.groundside.schema import AirframeSheet, LeaderFields, Plan, PointMassSheet, record_of
from ftcc.link.graph import Graph
from ftcc.sim.airframe import Airframe
from ftcc.sim.trim import TrimError, steady_climb

__all__ = ["check_clearance", "limit_climb_rates", "profiles_of"]

_OF_THRUST = 0.99
"""Share of the climb rate that the thrust allows; the profile of chapter 6 uses nearly all of it."""
_OF_ESTIMATES = 0.95
"""Share of the largest climb rate that the followers' estimates can follow."""


def profiles_of(plan: Plan, graph: Graph, findings: Findings) -> dict[int, Profile]:
    """Return the profile of each leader, by id."""
    _check_reactions(plan, findings)
    findings.stop_if_refused()
    return {uav: _profile(plan, uav, graph, findings) for uav in graph.leaders}


def _profile(plan: Plan, uav: int, graph: Graph, findings: Findings) -> Profile:
    fields: LeaderFields = plan.leaders[uav]
    commands, triggers = [], []
    altitude, speed = fields.z, fields.V
    for command in fields.commands:
        before = altitude, speed
        altitude = altitude if command.altitude is None else command.altitude
        speed = speed if command.speed is None else command.speed
        if command.at is not None:
            commands.append(Command(command.at, altitude, speed))
            if command.until is not None:
                altitude, speed = before
                commands.append(Command(command.until, altitude, speed))
        elif command.x is not None:
            triggers.append(Trigger(uav if command.uav is None else command.uav, command.x, altitude, speed))
    if fields.over_obstacles:
        triggers = _triggers_over_obstacles(plan, uav)
    if commands != sorted(commands, key=lambda c: c.at):
        findings.refuse(f"leaders.{uav}.commands: must be in order of time, each after the until of those before")
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
        sink_limit=math.inf if fields.sink_limit is None else fields.sink_limit,
    )
    try:
        trigger_rows(profile, uav, graph.senders(uav))
    except ValueError as error:
        field = "over_obstacles" if fields.over_obstacles else "commands"
        findings.refuse(f"leaders.{uav}.{field}: {error}")
    return profile


def limit_climb_rates(
    plan: Plan,
    profiles: Mapping[int, Profile],
    sheet: AirframeSheet | PointMassSheet,
    thrust: tuple[float, float],
    estimates: float,
    findings: Findings,
) -> dict[int, Profile]:
    """Return the profiles with climb and sink rates that the followers can follow.

    A limit that the scenario gives stays.

    Parameters
    ----------
    profiles
        By leader, with the limits that the scenario gives.
    sheet, thrust
        The followers' aircraft, and their least and largest thrust, N.
    estimates
        Largest climb rate that the followers' estimates can follow, m/s.
    """
    if not profiles or plan.mission is None or not isinstance(sheet, AirframeSheet):
        return dict(profiles)
    V = plan.mission.V
    airframe = record_of(sheet, Airframe)
    try:
        sink, climb = (steady_climb(airframe, V, force) for force in thrust)
    except TrimError as error:
        findings.refuse(f"plant.limits.thrust: {error}")
        return dict(profiles)
    flown = climb_range(profiles, plan.duration)
    return {
        uav: replace(
            profile,
            climb_limit=_limit_in_force(
                uav, "climb", profile.climb_limit, flown[uav][1], max(climb, 0.0), estimates, findings
            ),
            sink_limit=_limit_in_force(
                uav, "sink", profile.sink_limit, flown[uav][0], max(-sink, 0.0), estimates, findings
            ),
        )
        for uav, profile in profiles.items()
    }


def _limit_in_force(
    uav: int, way: str, given: float, flown: float, thrust: float, estimates: float, findings: Findings
) -> float:
    """Return the limit of ``way``, "climb" or "sink", m/s; ``given`` is the scenario's limit, inf if it has none."""
    text = f"leaders.{uav}: its profile {way}s with {flown:.2f} m/s; the followers' thrust holds {thrust:.2f} m/s"
    if math.isfinite(estimates):
        text += f", their estimates follow {estimates:g} m/s"
    if math.isfinite(given):
        if flown > thrust:
            findings.warn(f"{text}: they will lose the leaders")
        return given
    limit = min(_OF_THRUST * thrust, _OF_ESTIMATES * estimates)
    if flown > limit:
        findings.warn(f"{text}: it is held at {limit:.2f} m/s ({way}_limit changes this)")
    return limit


def check_clearance(plan: Plan, profiles: Mapping[int, Profile], findings: Findings) -> None:
    """Warn of profiles that pass below the top of an obstacle."""
    if not plan.obstacles:
        return
    for uav, rows in sampled(profiles, plan.duration, 0.1).items():
        x, z = rows[:, Reference._fields.index("x")], rows[:, Reference._fields.index("z")]
        for n, obstacle in enumerate(plan.obstacles):
            over = z[(x > obstacle.x[0]) & (x < obstacle.x[1])]
            if len(over) and over.min() < obstacle.top:
                findings.warn(
                    f"leaders.{uav}: its profile passes obstacle {n + 1} down to {obstacle.top - over.min():.1f} m "
                    f"below its top"
                )


def _check_reactions(plan: Plan, findings: Findings) -> None:
    """Refuse leaders that climb over obstacles if a value that they need is missing."""
    reacting = [uav for uav, leader in plan.leaders.items() if leader.over_obstacles]
    for uav in reacting:
        given = len(plan.leaders[uav].over_obstacles)
        if given != len(plan.obstacles):
            findings.refuse(f"leaders.{uav}.over_obstacles: {given} altitudes for {len(plan.obstacles)} obstacles")
        if any(command.x is not None for command in plan.leaders[uav].commands):
            findings.refuse(f"leaders.{uav}: give either over_obstacles or commands by position, not both")
    if reacting and plan.detection_range is None:
        findings.refuse("detection_range: is missing; leaders need it to detect the obstacles that they climb over")
    if reacting and len({leader.V for leader in plan.leaders.values()}) > 1:
        findings.refuse("leaders: all that climb over obstacles must fly at the same speed")


def _triggers_over_obstacles(plan: Plan, uav: int) -> list[Trigger]:
    """Return the position triggers of a leader that climbs over the obstacles.

    All leaders climb when the first leader detects an obstacle, and descend when the last leader has passed it.
    """
    own, leaders = plan.leaders[uav], plan.leaders
    first = max(leaders, key=lambda leader: leaders[leader].x)
    last = min(leaders, key=lambda leader: leaders[leader].x)
    assert plan.detection_range is not None
    changes = []
    for obstacle, altitude in zip(plan.obstacles, own.over_obstacles, strict=True):
        detected, passed = obstacle.x[0] - plan.detection_range, obstacle.x[1]
        changes.append((detected - leaders[first].x, first, detected, altitude, True))
        changes.append((passed - leaders[last].x, last, passed, altitude, False))
    triggers, ahead = [], []
    for _, watched, x, altitude, begins in sorted(changes):
        if begins:
            ahead.append(altitude)
        else:
            ahead.remove(altitude)
        triggers.append(Trigger(watched, x, max(ahead, default=own.z), own.V))
    return triggers
