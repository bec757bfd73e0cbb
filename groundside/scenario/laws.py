"""Input of the control laws: gains and initial values, and the schemes' own checks."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from ftcc.airside.references.profiles import Profile, climb_range, largest_acceleration
from ftcc.airside.scheme import Flight, Problem, Reference, Scheme
from ftcc.airside.spec import OwnReference
from ftcc.groundside.scenario.checks import Findings, require_followers
from ftcc.groundside.scenario.loading import Scenario
from ftcc.groundside.scenario.trims import truth_at_start
from ftcc.groundside.schema import Plan
from ftcc.link.graph import Graph
from ftcc.link.rotation import wrapped
from ftcc.link.timing import Timing
from ftcc.sim.plant import ALPHA, BETA, GAMMA, MU, V, X, Z
from ftcc.sim.spec import VehicleSpec

__all__ = ["check_scheme", "gains_of", "initial_shared_values", "mission_values_for_gains"]


def mission_values_for_gains(plan: Plan) -> dict[str, float]:
    """Return mission values that some gains take as their default, see ``airside.scheme.FOLLOWED``."""
    if not plan.leaders:
        return {}
    return {"leaders.z": math.fsum(leader.z for leader in plan.leaders.values()) / len(plan.leaders)}


def gains_of(
    scenario: Scenario, scheme: Scheme, findings: Findings, switches: Mapping[str, bool] | None = None
) -> dict[int, Any]:
    """Return each UAV's ``Gains``, by id; empty if they are refused.

    Later values replace earlier ones: those of the form, of the scenario, of the UAV, and of switches that are off.
    ``switches`` are those of the scenario unless given.
    """
    plan = scenario.plan
    followed = mission_values_for_gains(plan)
    switched: dict[str, float] = {}
    for name, on in (plan.switches if switches is None else switches).items():
        if name not in scheme.switches:
            findings.refuse(
                f"switches.{name}: scheme {scheme.name} has no such switch; it has {', '.join(scheme.switches)}"
            )
        elif not on:
            switched |= scheme.switches[name]

    def complete(where: str, overrides: Mapping[str, float]) -> Any:
        try:
            return scheme.gains(scenario.form, {**overrides, **switched}, followed)
        except ValueError as error:
            findings.refuse(f"{where}: {error}")
            return None

    require_followers("gains.uav", plan.gains.uav, plan, findings)
    common = plan.gains.common
    shared = complete("gains", common)
    if shared is None:
        return {}
    own = {uav: complete(f"gains.uav.{uav}", common | gains) for uav, gains in plan.gains.uav.items()}
    return {} if None in own.values() else dict.fromkeys((*plan.uavs.followers, *plan.uavs.leaders), shared) | own


def check_scheme(
    plan: Plan,
    scheme: Scheme,
    gains: Mapping[int, Any],
    graph: Graph,
    timing: Timing,
    vehicles: list[VehicleSpec],
    profiles: dict[int, Profile],
    references: Mapping[int, OwnReference | None],
    findings: Findings,
) -> Flight:
    """Check each follower's gains against the scheme's own conditions; return the `Flight` that the checks used."""
    speeds = {p.V for p in profiles.values()}
    speeds |= {command.speed for p in profiles.values() for command in p.commands}
    speeds |= {trigger.speed for p in profiles.values() for trigger in p.triggers}
    mission_speed = {plan.mission.V} if plan.mission is not None else set()
    flight = Flight(
        graph=graph,
        period=timing.period,
        exchange_period=timing.exchange_us / 1e6,
        latency=timing.latency_us / 1e6,
        leader_climb=max((max(pair) for pair in climb_range(profiles, plan.duration).values()), default=0.0),
        leader_speed_varies=bool(speeds - mission_speed) or any(p.speed_wave for p in profiles.values()),
        leader_acceleration=largest_acceleration(profiles, plan.duration),
        initial={vehicle.uav: _motion(vehicle) for vehicle in vehicles if vehicle.uav in graph.followers},
        initial_errors=_initial_errors(scheme, vehicles, references),
    )
    alike: dict[Any, list[int]] = {}
    for uav in graph.followers:
        alike.setdefault(gains[uav], []).append(uav)
    found: dict[Problem, list[int]] = {}
    for chosen, uavs in alike.items():
        # A condition on initial errors applies to the UAVs with these gains.
        concerned = replace(flight, initial={uav: flight.initial[uav] for uav in uavs})
        for problem in scheme.check(chosen, concerned):
            found.setdefault(problem, []).extend(uavs)
    for problem, uavs in found.items():
        who = "" if len(uavs) == len(graph.followers) else f"UAV {', '.join(map(str, sorted(uavs)))}: "
        if problem.fatal:
            findings.refuse(who + problem.text)
        else:
            findings.warn(who + problem.text)
    return flight


def initial_shared_values(
    scheme: Scheme, vehicles: Iterable[VehicleSpec], profiles: Mapping[int, Profile]
) -> dict[int, tuple[float, ...]]:
    """Return each UAV's shared values at t = 0, by id: its out-neighbours use them before its first record.

    Accelerations are 0. Empty if the scheme needs no such values.
    """
    if not scheme.briefed:
        return {}
    values = {}
    for vehicle in vehicles:
        profile = profiles.get(vehicle.uav)
        if profile is None:
            role, motion = "follower", _motion(vehicle)
        else:
            role, motion = "leader", Reference(profile.x, profile.V, 0.0, profile.z, 0.0, 0.0, profile.V)
        values[vehicle.uav] = tuple(float(getattr(motion, quantity.name)) for quantity in scheme.shared[role])
    return values


def _initial_errors(
    scheme: Scheme, vehicles: list[VehicleSpec], references: Mapping[int, OwnReference | None]
) -> dict[int, tuple[float, float, float]]:
    """Return initial errors in bank, angle of attack and sideslip (rad) by UAV; {} unless the scheme tracks them."""
    errors = {}
    for vehicle in vehicles if scheme.plant == "attitude" else ():
        own, true = references[vehicle.uav], truth_at_start(vehicle)
        if own is not None:
            mu, alpha, beta = own.initial[:3]
            errors[vehicle.uav] = (float(wrapped(true[MU] - mu)), float(true[ALPHA] - alpha), float(true[BETA] - beta))
    return errors


def _motion(vehicle: VehicleSpec) -> Reference:
    """Return the motion of an aircraft at its start."""
    true = truth_at_start(vehicle)
    speed, gamma = float(true[V]), float(true[GAMMA])
    climb, forward = speed * math.sin(gamma), speed * math.cos(gamma)
    return Reference(x=float(true[X]), V=speed, V_dot=0.0, z=float(true[Z]), z_dot=climb, z_ddot=0.0, x_dot=forward)
