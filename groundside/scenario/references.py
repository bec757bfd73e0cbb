"""Each UAV's own reference: the mission's speed, attitude commands, or a post around the fire."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ftcc.airside.references import attitude, longitudinal
from ftcc.airside.spec import OwnReference
from ftcc.groundside.scenario.checks import Findings
from ftcc.groundside.scenario.fire import fire_references, fire_texts
from ftcc.groundside.schema import Plan
from ftcc.link.timing import Timing

__all__ = ["own_references", "reference_texts"]

_TABLES = {"longitudinal": "mission", "attitude": "attitude", "position": "fire"}
"""The scenario's table with the UAVs' own references, by the scheme's plant."""


def own_references(
    plan: Plan, plant: str, followers: Sequence[int], timing: Timing, findings: Findings
) -> dict[int, OwnReference]:
    """Return each UAV's own reference, by id; leaders also track their profiles."""
    for kind, table in _TABLES.items():
        given = getattr(plan, table) is not None
        if kind == plant and not given:
            findings.refuse(f"{table}: is missing")
        if kind != plant and given:
            findings.refuse(f"{table}: this scheme follows [{_TABLES[plant]}]")
    if plan.leaders and plant != "longitudinal":
        findings.refuse(f"leaders: this scheme has none; each UAV follows [{_TABLES[plant]}]")
    findings.stop_if_refused()
    if plant == "longitudinal":
        assert plan.mission is not None
        V = plan.mission.V
        constants = longitudinal.Reference(x=0.0, V=V, V_dot=0.0, z=0.0, z_dot=0.0, z_ddot=0.0, x_dot=V)
        return dict.fromkeys([*followers, *plan.leaders], OwnReference(constants))
    if plant == "position":
        return fire_references(plan, followers, findings)
    return {uav: _attitude(plan, uav, timing, findings) for uav in followers}


def _attitude(plan: Plan, uav: int, timing: Timing, findings: Findings) -> OwnReference:
    assert plan.attitude is not None
    command = attitude.Command(0.0, 0.0, 0.0, 0.0)
    commands: list[attitude.Command] = []
    for n, given in enumerate(plan.attitude.commands):
        if given.uavs is not None and uav not in given.uavs:
            continue
        if given.at < command.at:
            findings.refuse(
                f"attitude.commands.{n}.at = {given.at:g}: must be in order of time, each after the until of "
                f"those before"
            )
        if given.until is not None and not commands:
            findings.refuse(
                f"attitude.commands.{n}.until: the first command of UAV {uav} cannot end: there is none before it"
            )
        before = command
        asked = {"mu": given.bank, "alpha": given.alpha, "beta": given.sideslip}
        command = command._replace(at=given.at, **{axis: value for axis, value in asked.items() if value is not None})
        commands.append(command)
        if given.until is not None:
            command = before._replace(at=given.until)
            commands.append(command)
    if not commands or commands[0].at > 0.0:
        findings.refuse(f"attitude.commands: UAV {uav} needs a command with at = 0, where its reference starts")
        commands.insert(0, command._replace(at=0.0))
    start = commands[sum(one.at <= 0.0 for one in commands) - 1]
    return OwnReference(
        attitude.Reference(start.mu, start.alpha, start.beta, 0.0, 0.0, 0.0),
        attitude.Filter(plan.attitude.filter.frequency, plan.attitude.filter.damping, float(timing.step_us)),
        tuple(commands),
    )


def reference_texts(plan: Plan) -> list[tuple[float, int | None, str]]:
    """Return the commands as events: time s, UAV (None: all UAVs), text."""
    events = fire_texts(plan)
    for command in plan.attitude.commands if plan.attitude else ():
        asked = [
            f"{name} {math.degrees(value):g} deg"
            for name in ("bank", "alpha", "sideslip")
            if (value := getattr(command, name)) is not None
        ]
        text = f"commanded to {', '.join(asked)}"
        for uav in [None] if command.uavs is None else command.uavs:
            events.append((command.at, uav, text))
            if command.until is not None:
                events.append((command.until, uav, "commanded to the attitude before"))
    return events
