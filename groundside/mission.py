"""From a scenario to a mission: the specs of every process, checked as a whole."""

from __future__ import annotations

import importlib.metadata
import math
import platform
from dataclasses import dataclass
from typing import Any

import tomli_w

from ftcc.airside.model import Model
from ftcc.airside.references.profiles import Command, Cosine, Profile, SpeedWave, Trigger, trigger_rows
from ftcc.airside.scheme import Scheme
from ftcc.airside.spec import AutopilotSpec, Neighbour
from ftcc.groundside.checks import (
    DISTURBANCES,
    IDEAL,
    PLANT_ACTUATORS,
    Findings,
    check_delays,
    check_faults,
    check_scheme,
    gains_of,
    graph_of,
    level_trim,
    limits_of,
    scheme_of,
    timing_of,
    unit_of,
)
from ftcc.groundside.claims import check_claims
from ftcc.groundside.links import link_changes, link_texts
from ftcc.groundside.references import own_references, reference_texts
from ftcc.groundside.run import LEADING
from ftcc.groundside.scenario import Scenario, load_airframe
from ftcc.groundside.schema import Claim, LeaderFields, Plan
from ftcc.link.actuators import ACTUATORS, ELEVATOR, THRUST
from ftcc.link.channel import Channel
from ftcc.link.graph import Graph
from ftcc.link.timing import Timing
from ftcc.sim.airframe import Airframe
from ftcc.sim.plant import TRUTH, Disturbance, Fault
from ftcc.sim.spec import VehicleSpec
from ftcc.sim.trim import Trim

__all__ = ["Mission", "resolve"]


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


def resolve(scenario: Scenario) -> Mission:
    """Check a scenario as a whole and turn it into specs.

    Raises
    ------
    ScenarioError
        With all that is wrong.
    """
    findings = Findings(scenario.file)
    plan = scenario.plan
    scheme = scheme_of(scenario, findings)
    wire = scenario.form != IDEAL
    timing = timing_of(plan, wire, findings)
    limits = limits_of(plan, PLANT_ACTUATORS[scheme.plant], findings)
    graph = graph_of(plan, scheme, findings)
    sheet = load_airframe(plan.airframe, scenario.file)
    values = {name: float(getattr(sheet, name)) for name in Airframe._fields}
    true = Airframe(**values | ({} if plan.plant.elevator_lift else {"CLde": 0.0}))
    findings.stop_if_refused()

    references = own_references(plan, scheme.plant, graph.followers, timing, findings)
    profiles = {uav: _profile(plan, uav, graph, findings) for uav in graph.leaders}
    findings.stop_if_refused()
    vehicles = [_aircraft(plan, uav, scheme.plant, true, limits, findings) for uav in graph.followers]
    vehicles += [_reference_point(plan, uav, true, limits, profiles[uav]) for uav in graph.leaders]
    findings.stop_if_refused()
    check_faults(plan, vehicles, findings)

    gains = gains_of(scenario, scheme, findings)
    if gains:
        check_scheme(plan, scheme, gains, graph, timing, vehicles, profiles, findings)
    channel = Channel(**plan.channel.model_dump())
    changes = link_changes(plan.link_events, graph, channel, findings.refuse)
    check_delays(plan, timing, findings)
    names = (*LEADING, *(quantity.name for quantity in scheme.signals))
    findings.refused += check_claims(plan.claims, graph, names)
    findings.stop_if_refused()

    low, high = zip(*limits, strict=True)
    model = Model(
        **values,
        thrust_min=low[THRUST],
        thrust_max=high[THRUST],
        elevator_min=low[ELEVATOR],
        elevator_max=high[ELEVATOR],
        lag=plan.plant.lag.elevator,
    )
    autopilots = tuple(
        AutopilotSpec(
            uav=vehicle.uav,
            role="leader" if vehicle.uav in graph.leaders else "follower",
            scheme=scheme.name,
            gains=tuple(gains[vehicle.uav]),
            model=model,
            travel=vehicle.travel,
            reference=references[vehicle.uav],
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


def _initial_command(plan: Plan, level: Trim) -> tuple[float, ...]:
    given = plan.plant.initial_actuators
    values = {"elevator": level.elevator, "thrust": level.thrust} | (given if isinstance(given, dict) else {})
    return tuple(float(values.get(name, 0.0)) for name in ACTUATORS)


def _aircraft(
    plan: Plan, uav: int, kind: str, airframe: Airframe, limits: tuple[tuple[float, float], ...], findings: Findings
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
    level = level_trim(airframe, start["V"], f"start of UAV {uav}", findings)
    gamma = start["gamma"] or 0.0
    theta = start["theta"] if isinstance(start["theta"], float) else level.alpha + gamma
    noise = plan.noise
    return VehicleSpec(
        uav=uav,
        kind=kind,
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
            for channel, (name, _) in enumerate(DISTURBANCES)
            if getattr(d, name) != 0.0
        ),
        noise=tuple(float(getattr(noise, name, 0.0)) * noise.factor for name in TRUTH),
        guards=_guards(plan),
        offset=start["y"] or 0.0,
    )


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


def _planned(plan: Plan) -> tuple[tuple[float, int | None, str], ...]:
    events: list[tuple[float, int | None, str]] = []
    for fault in plan.faults:
        unit = unit_of(fault.actuator)
        text = f"{fault.actuator} fault: effectiveness {fault.effectiveness:g}, bias {fault.bias:g} {unit}"
        if fault.effectiveness == 1.0 and fault.bias == 0.0:
            text = f"{fault.actuator} repaired"
        events.append((fault.at, fault.uav, text))
    for disturbance in plan.disturbances:
        given = [(name, unit, getattr(disturbance, name)) for name, unit in DISTURBANCES]
        text = "disturbance " + ", ".join(f"{name} = {value:g} {unit}" for name, unit, value in given if value != 0.0)
        if disturbance.uavs is None:
            events.append((disturbance.at, None, text))
        else:
            events += [(disturbance.at, uav, text) for uav in disturbance.uavs]
    for uav, leader in plan.leaders.items():
        for command in leader.commands:
            if command.at is not None:
                asked = [f"{command.altitude:g} m"] if command.altitude is not None else []
                asked += [f"{command.speed:g} m/s"] if command.speed is not None else []
                events.append((command.at, uav, f"leader commanded to {', '.join(asked)}"))
        if leader.cosine is not None:
            events.append((leader.cosine.at, uav, "leader begins its cosine in altitude"))
    events += reference_texts(plan)
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
