"""From a scenario to a mission: the checks that need the scheme, the graph and the airframe, and the specs of every process."""

from __future__ import annotations

import importlib.metadata
import math
import platform
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomli_w

from ftcc.airside.model import Model
from ftcc.airside.references.profiles import (
    Command,
    Cosine,
    Profile,
    SpeedWave,
    Trigger,
    largest_acceleration,
    largest_climb,
    trigger_rows,
)
from ftcc.airside.scheme import Flight, Reference, Scheme
from ftcc.airside.schemes import find as find_scheme
from ftcc.airside.spec import AutopilotSpec, Neighbour
from ftcc.groundside.links import link_changes, link_texts
from ftcc.groundside.scenario import Scenario, ScenarioError, load_airframe, whole
from ftcc.groundside.schema import Claim, LeaderFields, Plan
from ftcc.link.actuators import ACTUATORS, ELEVATOR
from ftcc.link.channel import Channel
from ftcc.link.graph import Graph, GraphError
from ftcc.link.timing import Timing
from ftcc.sim.airframe import Airframe
from ftcc.sim.plant import TRUTH, Disturbance, Fault
from ftcc.sim.spec import VehicleSpec
from ftcc.sim.trim import Trim, TrimError, trim

__all__ = ["IDEAL", "PLANT_ACTUATORS", "Mission", "resolve"]

IDEAL = "monograph"
"""The form with ideal exchange, which no processes can fly."""

PLANT_ACTUATORS = {"longitudinal": ("thrust", "elevator")}
"""What can be commanded, and can fail, by plant."""

_DISTURBANCES = (("d1", "m/s^2"), ("d2", "rad/s"), ("d3", "rad/s^2"))
_UNITS = {"thrust": "N"}
_MOST_PERIODS = 30
"""Latency, delay and jitter together in exchange periods: the inbox and the mesh keep that many records."""


@dataclass(frozen=True)
class Mission:
    """Everything that a flight is made of, checked."""

    name: str
    title: str
    form: str
    variants: tuple[str, ...]
    case: str
    """Form and variants, the key of the claims' expected values."""
    scheme: Scheme
    timing: Timing
    wire: bool
    """States, commands and records pass through messages, and a command acts one sample late; False: ideal exchange."""
    graph: Graph
    vehicles: tuple[VehicleSpec, ...]
    """Followers, then leaders."""
    autopilots: tuple[AutopilotSpec, ...]
    claims: tuple[Claim, ...]
    """Those of this case."""
    warnings: tuple[str, ...]
    toml: str
    """The merged scenario as flown, with seed and versions: flies the same flight again."""
    events: tuple[tuple[float, int | None, str], ...]
    """What is planned to happen: time s, UAV (None: everybody), text."""

    @property
    def uavs(self) -> tuple[int, ...]:
        """Ids, in the order of the specs."""
        return self.graph.uavs


class _Findings:
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


def resolve(scenario: Scenario) -> Mission:
    """Check a scenario as a whole and turn it into specs.

    Raises
    ------
    ScenarioError
        With all that is wrong.
    """
    findings = _Findings(scenario.file)
    plan = scenario.plan
    scheme = _scheme(scenario, findings)
    wire = scenario.form != IDEAL
    timing = _timing(plan, wire, findings)
    graph = _graph(plan, scheme, findings)
    sheet = load_airframe(plan.airframe, scenario.file)
    values = {name: float(getattr(sheet, name)) for name in Airframe._fields}
    true = Airframe(**values | ({} if plan.plant.elevator_lift else {"CLde": 0.0}))
    limits = _limits(plan, PLANT_ACTUATORS[scheme.plant], findings)
    findings.stop_if_refused()

    profiles = {uav: _profile(plan, uav, graph, findings) for uav in graph.leaders}
    findings.stop_if_refused()
    vehicles = [_aircraft(plan, uav, true, limits, findings) for uav in graph.followers]
    vehicles += [_reference_point(plan, uav, true, limits, profiles[uav]) for uav in graph.leaders]
    findings.stop_if_refused()
    _check_faults(plan, vehicles, findings)

    gains = _gains(scenario, scheme, findings)
    if gains is not None:
        _check_scheme(plan, scheme, gains, graph, timing, vehicles, profiles, findings)
    channel = Channel(**plan.channel.model_dump())
    changes = link_changes(plan.link_events, graph, channel, findings.refuse)
    _check_delays(plan, timing, findings)
    findings.stop_if_refused()
    assert gains is not None

    low, high = zip(*limits, strict=True)
    model = Model(
        **values,
        thrust_min=low[3],
        thrust_max=high[3],
        elevator_min=low[ELEVATOR],
        elevator_max=high[ELEVATOR],
        lag=plan.plant.lag.elevator,
    )
    autopilots = tuple(
        AutopilotSpec(
            uav=vehicle.uav,
            role="leader" if vehicle.uav in graph.leaders else "follower",
            scheme=scheme.name,
            gains=tuple(gains),
            model=model,
            travel=vehicle.travel,
            mission=Reference(x=0.0, V=plan.mission.V, V_dot=0.0, z=0.0, z_dot=0.0, z_ddot=0.0, x_dot=plan.mission.V),
            neighbours=tuple(Neighbour(j, graph.weights[vehicle.uav, j]) for j in graph.senders(vehicle.uav)),
            channel=channel,
            link_events=tuple(changes.get(vehicle.uav, ())),
            profile=profiles.get(vehicle.uav),
            offset=vehicle.offset,
            hearers=tuple(graph.receivers(vehicle.uav)),
        )
        for vehicle in vehicles
    )
    return Mission(
        name=scenario.name,
        title=plan.title,
        form=scenario.form,
        variants=scenario.variants,
        case=scenario.case,
        scheme=scheme,
        timing=timing,
        wire=wire,
        graph=graph,
        vehicles=tuple(vehicles),
        autopilots=autopilots,
        claims=tuple(claim for claim in plan.claims if scenario.case in claim.expected),
        warnings=tuple(findings.warned),
        toml=_as_flown(scenario),
        events=_planned(plan),
    )


def _scheme(scenario: Scenario, findings: _Findings) -> Scheme:
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


def _timing(plan: Plan, wire: bool, findings: _Findings) -> Timing:
    rates = plan.rates
    period = 1e6 / rates.control_rate
    step = rates.plant_step * 1e6
    grid, allowed = (1000, "1 ms") if wire else (500, "0.5 ms")
    if not whole(period / grid):
        findings.refuse(
            f"rates.control_rate = {rates.control_rate:g}: a period of {period / 1e3:g} ms; must be a multiple of {allowed}"
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


def _check_delays(plan: Plan, timing: Timing, findings: _Findings) -> None:
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


def _graph(plan: Plan, scheme: Scheme, findings: _Findings) -> Graph:
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


def _limits(plan: Plan, actuators: tuple[str, ...], findings: _Findings) -> tuple[tuple[float, float], ...]:
    """Travel in the order of ``ACTUATORS``; (0, 0) for what the plant lacks."""
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
                f"faults.{n}.actuator = {fault.actuator!r}: the plant has no such actuator; it has {', '.join(actuators)}"
            )
        if fault.uav not in plan.uavs.followers:
            findings.refuse(
                f"faults.{n}.uav = {fault.uav}: is no follower; followers are {', '.join(map(str, plan.uavs.followers))}"
            )
    for where, uavs in (
        *((f"disturbances.{n}.uavs", d.uavs or []) for n, d in enumerate(plan.disturbances)),
        ("start.uav", list(plan.start.uav)),
    ):
        for uav in uavs:
            if uav not in plan.uavs.followers:
                findings.refuse(
                    f"{where}: UAV {uav} is no follower; followers are {', '.join(map(str, plan.uavs.followers))}"
                )
    if isinstance(plan.plant.initial_actuators, dict):
        for name in plan.plant.initial_actuators:
            if name not in actuators:
                findings.refuse(f"plant.initial_actuators.{name}: the plant has no such actuator")
    return tuple(limits)


def _trim(airframe: Airframe, V: float, where: str, findings: _Findings, **disturbances: float) -> Trim:
    try:
        return trim(airframe, V, **disturbances)
    except TrimError as error:
        findings.refuse(f"{where}: {error}")
        return Trim(math.nan, math.nan, math.nan)


def _initial_command(plan: Plan, level: Trim) -> tuple[float, ...]:
    given = plan.plant.initial_actuators
    values = {"elevator": level.elevator, "thrust": level.thrust} | (given if isinstance(given, dict) else {})
    return tuple(float(values.get(name, 0.0)) for name in ACTUATORS)


def _aircraft(
    plan: Plan, uav: int, airframe: Airframe, limits: tuple[tuple[float, float], ...], findings: _Findings
) -> VehicleSpec:
    own = plan.start.uav.get(uav)
    start: dict[str, Any] = {}
    for name in ("V", "x", "y", "z", "gamma", "theta", "q"):
        value = getattr(own, name) if own is not None else None
        start[name] = value if value is not None else getattr(plan.start, name)
    for name in ("V", "z"):
        if start[name] is None:
            findings.refuse(f"start.{name}: is missing")
            start[name] = 1.0
    level = _trim(airframe, start["V"], f"start of UAV {uav}", findings)
    gamma = start["gamma"] or 0.0
    theta = start["theta"] if isinstance(start["theta"], float) else level.alpha + gamma
    noise = plan.noise
    return VehicleSpec(
        uav=uav,
        kind=plan_kind(plan),
        airframe=airframe,
        initial=(start["V"], start["x"] or 0.0, start["z"], gamma, theta, start["q"] or 0.0),
        command=_initial_command(plan, level),
        limits=limits,
        lag=tuple(float(getattr(plan.plant.lag, name)) for name in ACTUATORS),
        fault_before_lag=plan.plant.fault == "before_lag",
        faults=tuple(
            Fault(
                f.at,
                float(ACTUATORS.index(f.actuator)),
                f.effectiveness,
                f.bias,
                f.effectiveness_onset,
                f.bias_onset,
            )
            for f in sorted(plan.faults, key=lambda f: f.at)
            if f.uav == uav
        ),
        disturbances=tuple(
            Disturbance(d.at, float(channel), getattr(d, name), d.onset)
            for d in sorted(plan.disturbances, key=lambda d: d.at)
            if d.uavs is None or uav in d.uavs
            for channel, (name, _) in enumerate(_DISTURBANCES)
            if getattr(d, name) != 0.0
        ),
        noise=tuple(float(getattr(noise, name, 0.0)) * noise.factor for name in TRUTH),
        guards=_guards(plan),
        offset=start["y"] or 0.0,
    )


def plan_kind(plan: Plan) -> str:
    """The kind of vehicle that a plan's followers fly."""
    return find_scheme(plan.scheme).plant


def _guards(plan: Plan) -> tuple[float, float, float]:
    guards = plan.plant.guards
    return (guards.least_airspeed, guards.flight_path_angle, guards.angle_of_attack)


def _reference_point(
    plan: Plan, uav: int, airframe: Airframe, limits: tuple[tuple[float, float], ...], profile: Profile
) -> VehicleSpec:
    return VehicleSpec(
        uav=uav,
        kind="reference_point",
        airframe=airframe,
        initial=(profile.V, profile.x, profile.z, 0.0, 0.0, 0.0),
        command=(0.0,) * len(ACTUATORS),
        limits=limits,
        lag=(0.0,) * len(ACTUATORS),
        fault_before_lag=False,
        faults=(),
        disturbances=(),
        noise=(0.0,) * len(TRUTH),
        guards=_guards(plan),
        offset=plan.leaders[uav].y,
    )


def _profile(plan: Plan, uav: int, graph: Graph, findings: _Findings) -> Profile:
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
        findings.refuse(f"leaders.{uav}.commands: {error}")
    return profile


def _gains(scenario: Scenario, scheme: Scheme, findings: _Findings) -> Any:
    plan = scenario.plan
    overrides = dict(plan.gains)
    for name, on in plan.switches.items():
        if name not in scheme.switches:
            findings.refuse(
                f"switches.{name}: scheme {scheme.name} has no such switch; it has {', '.join(scheme.switches)}"
            )
        elif not on:
            overrides |= scheme.switches[name]
    try:
        return scheme.gains(scenario.form, overrides)
    except ValueError as error:
        findings.refuse(f"gains: {error}")
        return None


def _check_scheme(
    plan: Plan,
    scheme: Scheme,
    gains: Any,
    graph: Graph,
    timing: Timing,
    vehicles: list[VehicleSpec],
    profiles: dict[int, Profile],
    findings: _Findings,
) -> None:
    speeds = {c.speed for p in profiles.values() for c in (*p.commands, *p.triggers)} | {p.V for p in profiles.values()}
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
    for problem in scheme.check(gains, flight):
        if problem.fatal:
            findings.refuse(problem.text)
        else:
            findings.warned.append(problem.text)


def _check_faults(plan: Plan, vehicles: list[VehicleSpec], findings: _Findings) -> None:
    """Whether each fault leaves a level trim: (needed deflection - bias) / effectiveness within the travel."""
    by_uav = {vehicle.uav: vehicle for vehicle in vehicles}
    V = plan.mission.V
    for n, fault in enumerate(plan.faults):
        vehicle = by_uav[fault.uav]
        later = [f.at for f in plan.faults if f.uav == fault.uav and f.actuator == fault.actuator and f.at > fault.at]
        end = min(later, default=math.inf)
        low, high = vehicle.limits[ACTUATORS.index(fault.actuator)]
        for at in sorted({fault.at} | {d.time for d in vehicle.disturbances if fault.at < d.time < end}):
            acting = {
                name: sum(d.value for d in vehicle.disturbances if d.channel == channel and d.time <= at)
                for channel, (name, _) in enumerate(_DISTURBANCES)
            }
            needed = getattr(_trim(vehicle.airframe, V, f"faults.{n}", findings, **acting), fault.actuator)
            command = (needed - fault.bias) / fault.effectiveness if fault.effectiveness > 0.0 else math.inf
            if low < command < high or (fault.effectiveness == 0.0 and needed == fault.bias):
                continue
            unit = _UNITS.get(fault.actuator, "rad")
            text = (
                f"faults.{n} (effectiveness {fault.effectiveness:g}, bias {fault.bias:g} {unit}): leaves UAV {fault.uav} no "
                f"level trim at {V:g} m/s and t = {at:g} s: {fault.actuator} would have to be commanded to "
                f"({needed:.3f} - {fault.bias:g})/{fault.effectiveness:g} = {command:.3f} {unit}; "
                f"allowed is {low:g} to {high:g}"
            )
            if fault.without_trim:
                findings.warned.append(text)
            else:
                findings.refuse(f"{text} (without_trim = true flies it all the same)")
            break


def _planned(plan: Plan) -> tuple[tuple[float, int | None, str], ...]:
    events: list[tuple[float, int | None, str]] = []
    for fault in plan.faults:
        unit = _UNITS.get(fault.actuator, "rad")
        text = f"{fault.actuator} fault: effectiveness {fault.effectiveness:g}, bias {fault.bias:g} {unit}"
        if fault.effectiveness == 1.0 and fault.bias == 0.0:
            text = f"{fault.actuator} repaired"
        events.append((fault.at, fault.uav, text))
    for disturbance in plan.disturbances:
        given = [(name, unit, getattr(disturbance, name)) for name, unit in _DISTURBANCES]
        text = "disturbance " + ", ".join(f"{name} = {value:g} {unit}" for name, unit, value in given if value != 0.0)
        events += [(disturbance.at, uav, text) for uav in (disturbance.uavs or [None])]
    for uav, leader in plan.leaders.items():
        for command in leader.commands:
            if command.at is not None:
                asked = [f"{command.altitude:g} m"] if command.altitude is not None else []
                asked += [f"{command.speed:g} m/s"] if command.speed is not None else []
                events.append((command.at, uav, f"leader commanded to {', '.join(asked)}"))
        if leader.cosine is not None:
            events.append((leader.cosine.at, uav, "leader begins its cosine in altitude"))
    events += link_texts(plan.link_events)
    ends = plan.duration + 1e-9
    return tuple(sorted((event for event in events if event[0] <= ends), key=lambda e: (e[0], e[1] or 0, e[2])))


def _as_flown(scenario: Scenario) -> str:
    versions = {name: importlib.metadata.version(name) for name in ("numpy", "numba", "scipy", "pydantic")}
    versions["python"] = platform.python_version()
    document = {key: value for key, value in scenario.document.items() if key != "flown"}
    document["seed"] = scenario.plan.seed
    document["flown"] = {
        "name": scenario.name,
        "form": scenario.form,
        "variants": list(scenario.variants),
        "settings": list(scenario.settings),
        "versions": versions,
    }
    return tomli_w.dumps(document)
