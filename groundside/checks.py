"""What only the scenario as a whole can show: time grid, graph, travel, trim after faults, conditions on the gains."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ftcc.airside.references.profiles import Profile, largest_acceleration, largest_climb
from ftcc.airside.scheme import Flight, Problem, Reference, Scheme
from ftcc.airside.schemes import find as find_scheme
from ftcc.groundside.scenario import Scenario, ScenarioError, whole
from ftcc.groundside.schema import Plan
from ftcc.link.actuators import ACTUATORS
from ftcc.link.graph import Graph, GraphError
from ftcc.link.timing import Timing
from ftcc.sim.airframe import Airframe
from ftcc.sim.spec import VehicleSpec
from ftcc.sim.trim import Trim, TrimError, trim

__all__ = [
    "DISTURBANCES",
    "IDEAL",
    "PLANT_ACTUATORS",
    "Findings",
    "check_delays",
    "check_faults",
    "check_scheme",
    "gains_of",
    "graph_of",
    "level_trim",
    "limits_of",
    "scheme_of",
    "timing_of",
    "unit_of",
]

IDEAL = "monograph"
"""The form with ideal exchange, which no processes can fly."""

PLANT_ACTUATORS = {"longitudinal": ("thrust", "elevator")}
"""What can be commanded, and can fail, by plant."""

DISTURBANCES = (("d1", "m/s^2"), ("d2", "rad/s"), ("d3", "rad/s^2"))
"""Names and units of the disturbances, in the order of the plant's channels."""

_MOST_PERIODS = 30
"""Latency, delay and jitter together in exchange periods: the inbox and the mesh keep that many records."""


def unit_of(actuator: str) -> str:
    """Unit of a deflection."""
    return "N" if actuator == "thrust" else "rad"


class Findings:
    """Collects what is wrong, so that a user sees all of it at once."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.refused: list[str] = []
        self.warned: list[str] = []

    def refuse(self, text: str) -> None:
        self.refused.append(text)

    def stop_if_refused(self) -> None:
        if self.refused:
            raise ScenarioError(self.file, list(dict.fromkeys(self.refused)))


def scheme_of(scenario: Scenario, findings: Findings) -> Scheme:
    """The scheme, which must have the form that is asked for and fly a plant that there is."""
    try:
        scheme = find_scheme(scenario.plan.scheme)
    except LookupError as error:
        findings.refuse(f"scheme = {scenario.plan.scheme!r}: {error.args[0]}")
        findings.stop_if_refused()
        raise
    if scenario.form not in scheme.forms:
        findings.refuse(
            f"form = {scenario.form!r}: scheme {scheme.name} has no such form; it has {', '.join(scheme.forms)}"
        )
    if scheme.plant not in PLANT_ACTUATORS:
        findings.refuse(
            f"scheme = {scheme.name!r}: flies plant {scheme.plant!r}; there are {', '.join(PLANT_ACTUATORS)}"
        )
    findings.stop_if_refused()
    return scheme


def timing_of(plan: Plan, wire: bool, findings: Findings) -> Timing:
    """The time grid; between processes (``wire``) the control period is a whole number of ms."""
    rates = plan.rates
    period = 1e6 / rates.control_rate
    step = rates.plant_step * 1e6
    grid, allowed = (1000, "1 ms") if wire else (500, "0.5 ms")
    if not whole(period / grid):
        findings.refuse(
            f"rates.control_rate = {rates.control_rate:g}: a period of {period / 1e3:g} ms; "
            f"must be a multiple of {allowed}"
        )
    if not whole(period / step):
        findings.refuse(
            f"rates.plant_step = {rates.plant_step:g}: must divide the control period of {period / 1e3:g} ms "
            f"into whole steps"
        )
    exchange = 1e6 / rates.exchange_rate if rates.exchange_rate else period
    latency = 0.0
    if wire:
        latency = rates.latency * 1e6 if rates.latency is not None else exchange
        if not whole(exchange / period):
            findings.refuse(
                f"rates.exchange_rate = {rates.exchange_rate:g}: a period of {exchange / 1e3:g} ms; "
                f"must be a multiple of the control period of {period / 1e3:g} ms"
            )
        if latency < period * (1.0 - 1e-9):
            findings.refuse(
                f"rates.latency = {latency / 1e6:g}: must be at least one control period, {period / 1e6:g} s"
            )
        if latency > _MOST_PERIODS * exchange * (1.0 + 1e-9):
            findings.refuse(
                f"rates.latency = {latency / 1e6:g}: must be at most {_MOST_PERIODS} exchange periods, "
                f"{_MOST_PERIODS * exchange / 1e6:g} s"
            )
    else:
        if not math.isclose(exchange, period):
            findings.refuse(
                f"rates.exchange_rate = {rates.exchange_rate:g}: form {IDEAL} exchanges at every tick; "
                f"leave it out, or fly form flight"
            )
        if rates.latency:
            findings.refuse(f"rates.latency = {rates.latency:g}: form {IDEAL} has none; leave it out")
    every = rates.control_rate / plan.record_rate
    if not whole(every) or every < 1.0 - 1e-9:
        findings.refuse(
            f"record_rate = {plan.record_rate:g}: control_rate = {rates.control_rate:g} must be a whole multiple of it"
        )
    period_us = max(1, round(period))
    return Timing(
        period_us=period_us,
        exchange_us=round(exchange),
        latency_us=round(latency),
        step_us=max(1, round(step)),
        ticks=int(plan.duration * 1e6 / period_us + 1e-6),
        record_every=max(1, round(every)),
        seed=plan.seed,
    )


def check_delays(plan: Plan, timing: Timing, findings: Findings) -> None:
    """Refuse links so slow that records under way would overrun the buffers."""
    most = _MOST_PERIODS * timing.exchange_us / 1e6
    base = plan.channel
    asked = [("channel", base.delay, base.jitter)]
    for n, event in enumerate(plan.link_events):
        delay = base.delay if event.delay is None else event.delay
        asked.append((f"link_events.{n}", delay, base.jitter if event.jitter is None else event.jitter))
    for where, delay, jitter in asked:
        if timing.latency_us / 1e6 + delay + jitter > most * (1.0 + 1e-9):
            findings.refuse(
                f"{where}: latency {timing.latency_us / 1e6:g} + delay {delay:g} + jitter {jitter:g} s "
                f"must be at most {_MOST_PERIODS} exchange periods, {most:g} s"
            )


def graph_of(plan: Plan, scheme: Scheme, findings: Findings) -> Graph:
    """The communication graph, which must satisfy the scheme's assumption."""
    followers, leaders = tuple(plan.uavs.followers), tuple(plan.uavs.leaders)
    known = followers + leaders
    twice = sorted({uav for uav in known if known.count(uav) > 1})
    if twice:
        findings.refuse(f"uavs: {', '.join(map(str, twice))} stands there twice")
    if set(plan.leaders) != set(leaders):
        findings.refuse(f"leaders: tables for UAVs {sorted(plan.leaders)}, but uavs.leaders = {sorted(leaders)}")
    weights: dict[tuple[int, int], float] = {}
    for n, edge in enumerate(plan.graph.edges):
        for receiver, sender in edge.directed:
            for uav in (receiver, sender):
                if uav not in known:
                    findings.refuse(f"graph.edges.{n}: there is no UAV {uav}; UAVs are {', '.join(map(str, known))}")
            if (receiver, sender) in weights:
                findings.refuse(f"graph.edges.{n}: edge {sender} -> {receiver} stands there twice")
            weights[receiver, sender] = edge.weight
    known_to_graph = {pair: weight for pair, weight in weights.items() if set(pair) <= set(known)}
    findings.stop_if_refused()
    try:
        graph = Graph(followers, leaders, known_to_graph)
        graph.require(scheme.graph)
    except GraphError as error:
        findings.refuse(f"graph.edges: {error}")
        findings.stop_if_refused()
        raise
    return graph


def _require_followers(where: str, uavs: Iterable[int], plan: Plan, findings: Findings) -> None:
    for uav in uavs:
        if uav not in plan.uavs.followers:
            findings.refuse(
                f"{where}: UAV {uav} is no follower; followers are {', '.join(map(str, plan.uavs.followers))}"
            )


def limits_of(plan: Plan, actuators: tuple[str, ...], findings: Findings) -> tuple[tuple[float, float], ...]:
    """Travel in the order of ``ACTUATORS``; (0, 0) for what the plant lacks, which nothing else may speak of either."""
    limits = []
    lag = plan.plant.lag
    for name in ACTUATORS:
        given = getattr(plan.plant.limits, name)
        if name in actuators and given is None:
            findings.refuse(f"plant.limits.{name}: is missing")
        if name not in actuators and (given is not None or getattr(lag, name) > 0.0):
            findings.refuse(f"plant: has no {name}; its actuators are {', '.join(actuators)}")
        limits.append(given or (0.0, 0.0))
    for n, fault in enumerate(plan.faults):
        if fault.actuator not in actuators:
            findings.refuse(
                f"faults.{n}.actuator = {fault.actuator!r}: the plant has no such actuator; "
                f"it has {', '.join(actuators)}"
            )
        if fault.uav not in plan.uavs.followers:
            findings.refuse(
                f"faults.{n}.uav = {fault.uav}: is no follower; "
                f"followers are {', '.join(map(str, plan.uavs.followers))}"
            )
    for n, disturbance in enumerate(plan.disturbances):
        _require_followers(f"disturbances.{n}.uavs", disturbance.uavs or (), plan, findings)
    for n, command in enumerate(plan.attitude.commands if plan.attitude is not None else ()):
        _require_followers(f"attitude.commands.{n}.uavs", command.uavs or (), plan, findings)
    _require_followers("start.uav", plan.start.uav, plan, findings)
    if isinstance(plan.plant.initial_actuators, dict):
        for name in plan.plant.initial_actuators:
            if name not in actuators:
                findings.refuse(f"plant.initial_actuators.{name}: the plant has no such actuator")
    return tuple(limits)


def level_trim(airframe: Airframe, V: float, where: str, findings: Findings, **disturbances: float) -> Trim:
    """Level trim under disturbances d1, d2, d3; refused, and nan, where there is none."""
    try:
        return trim(airframe, V, **disturbances)
    except TrimError as error:
        findings.refuse(f"{where}: {error}")
        return Trim(math.nan, math.nan, math.nan)


def gains_of(scenario: Scenario, scheme: Scheme, findings: Findings) -> dict[int, Any]:
    """Each UAV's ``Gains``: of the form, of the scenario, its own, and what switches that are off change.

    Empty if they are refused.
    """
    plan = scenario.plan
    switched: dict[str, float] = {}
    for name, on in plan.switches.items():
        if name not in scheme.switches:
            findings.refuse(
                f"switches.{name}: scheme {scheme.name} has no such switch; it has {', '.join(scheme.switches)}"
            )
        elif not on:
            switched |= scheme.switches[name]

    def complete(where: str, overrides: Mapping[str, float]) -> Any:
        try:
            return scheme.gains(scenario.form, {**overrides, **switched})
        except ValueError as error:
            findings.refuse(f"{where}: {error}")
            return None

    _require_followers("gains.uav", plan.gains.uav, plan, findings)
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
    findings: Findings,
) -> None:
    """The scheme's own conditions on gains and mission; each follower's gains must meet them."""
    speeds = {p.V for p in profiles.values()}
    speeds |= {command.speed for p in profiles.values() for command in p.commands}
    speeds |= {trigger.speed for p in profiles.values() for trigger in p.triggers}
    flight = Flight(
        graph=graph,
        period=timing.period,
        exchange_period=timing.exchange_us / 1e6,
        latency=timing.latency_us / 1e6,
        leader_climb=largest_climb(profiles, plan.duration),
        leader_speed_varies=len(speeds) > 1 or any(p.speed_wave for p in profiles.values()),
        leader_acceleration=largest_acceleration(profiles, plan.duration),
        initial={
            vehicle.uav: Reference(
                x=vehicle.initial[1],
                V=vehicle.initial[0],
                V_dot=0.0,
                z=vehicle.initial[2],
                z_dot=vehicle.initial[0] * math.sin(vehicle.initial[3]),
                z_ddot=0.0,
                x_dot=vehicle.initial[0] * math.cos(vehicle.initial[3]),
            )
            for vehicle in vehicles
            if vehicle.uav in graph.followers
        },
    )
    alike: dict[Any, list[int]] = {}
    for uav in graph.followers:
        alike.setdefault(gains[uav], []).append(uav)
    found: dict[Problem, list[int]] = {}
    for chosen, uavs in alike.items():
        # A condition on initial errors concerns those who fly with these gains.
        concerned = replace(flight, initial={uav: flight.initial[uav] for uav in uavs})
        for problem in scheme.check(chosen, concerned):
            found.setdefault(problem, []).extend(uavs)
    for problem, uavs in found.items():
        who = "" if len(uavs) == len(graph.followers) else f"UAV {', '.join(map(str, sorted(uavs)))}: "
        if problem.fatal:
            findings.refuse(who + problem.text)
        else:
            findings.warned.append(who + problem.text)


def check_faults(plan: Plan, vehicles: list[VehicleSpec], findings: Findings) -> None:
    """Whether each fault leaves a level trim: (needed deflection - bias) / effectiveness within the travel."""
    by_uav = {vehicle.uav: vehicle for vehicle in vehicles}
    for n, fault in enumerate(plan.faults):
        vehicle = by_uav[fault.uav]
        V = plan.mission.V if plan.mission is not None else vehicle.initial[0]
        later = [f.at for f in plan.faults if f.uav == fault.uav and f.actuator == fault.actuator and f.at > fault.at]
        end = min(later, default=math.inf)
        low, high = vehicle.limits[ACTUATORS.index(fault.actuator)]
        for at in sorted({fault.at} | {d.time for d in vehicle.disturbances if fault.at < d.time < end}):
            acting = {
                name: sum(d.value for d in vehicle.disturbances if d.channel == channel and d.time <= at)
                for channel, (name, _) in enumerate(DISTURBANCES)
            }
            needed = getattr(level_trim(vehicle.airframe, V, f"faults.{n}", findings, **acting), fault.actuator)
            command = (needed - fault.bias) / fault.effectiveness if fault.effectiveness > 0.0 else math.inf
            if low < command < high or (fault.effectiveness == 0.0 and needed == fault.bias):
                continue
            unit = unit_of(fault.actuator)
            text = (
                f"faults.{n} (effectiveness {fault.effectiveness:g}, bias {fault.bias:g} {unit}): leaves "
                f"UAV {fault.uav} no level trim at {V:g} m/s and t = {at:g} s: {fault.actuator} would need the command "
                f"({needed:.3f} - {fault.bias:g})/{fault.effectiveness:g} = {command:.3f} {unit}; "
                f"allowed is {low:g} to {high:g}"
            )
            if fault.without_trim:
                findings.warned.append(text)
            else:
                findings.refuse(f"{text} (without_trim = true flies it all the same)")
            break
