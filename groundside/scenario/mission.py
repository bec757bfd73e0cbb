"""From a scenario to a mission: the specs of every process, checked as a whole."""

from __future__ import annotations

import functools
import importlib.metadata
import math
import platform
import tomllib
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from types import ModuleType

import tomli_w

from ftcc.airside.model import Model
from ftcc.airside.references.position import Fire
from ftcc.airside.references.profiles import Profile
from ftcc.airside.scheme import FAULT_TOLERANCE, Scheme
from ftcc.airside.spec import AutopilotSpec, Neighbour, OwnReference
from ftcc.groundside.claims import check_claims
from ftcc.groundside.scenario.checks import (
    IDEAL,
    Findings,
    check_delays,
    check_tracking,
    graph_of,
    limits_of,
    plant_of,
    scheme_of,
    timing_of,
)
from ftcc.groundside.scenario.columns import leading
from ftcc.groundside.scenario.faults import actuator_faults, check_ends, check_faults, fault_texts, navigation_faults
from ftcc.groundside.scenario.fire import check_posts
from ftcc.groundside.scenario.laws import briefings, check_scheme, followed_by_gains, gains_of
from ftcc.groundside.scenario.leaders import check_clearance, limited, profiles_of
from ftcc.groundside.scenario.links import link_changes, link_texts
from ftcc.groundside.scenario.loading import Scenario, load_airframe
from ftcc.groundside.scenario.references import own_references, reference_texts
from ftcc.groundside.scenario.trims import check_starts, check_trims, level_trim
from ftcc.groundside.scenario.wind import check_wind, discrete_gusts, gust, mean_wind, turbulence, wind_texts
from ftcc.groundside.schema import AirframeSheet, Claim, Damping, Lag, Plan, PointMassSheet, RateLimits
from ftcc.link.actuators import AILERON, ELEVATOR, RUDDER, THRUST, in_slots
from ftcc.link.attitude_target import UNCODED, AttitudeCode
from ftcc.link.channel import Channel
from ftcc.link.graph import Graph
from ftcc.link.timing import Timing
from ftcc.sim import plants
from ftcc.sim.airframe import scaled
from ftcc.sim.obstacles import Obstacle
from ftcc.sim.plant import TRUTH, Autothrottle, Disturbance, Guards
from ftcc.sim.spec import CALM, NO_AUTOTHROTTLE, VehicleSpec
from ftcc.sim.wind import NO_TURBULENCE

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
    plant: str
    """What the aircraft are, see ``sim.plants``."""
    timing: Timing
    wire: bool
    """States, commands and records pass through messages, and a command acts one sample late; False: ideal exchange."""
    graph: Graph
    obstacles: tuple[Obstacle, ...]
    vehicles: tuple[VehicleSpec, ...]
    """Followers, then leaders."""
    autopilots: tuple[AutopilotSpec, ...]
    claims: tuple[Claim, ...]
    """Those of this case."""
    warnings: tuple[str, ...]
    toml: str
    """The merged scenario as flown, with seed and versions: flies the same flight again."""
    home: tuple[float, float, float]
    """Latitude, longitude (deg) and altitude (m) of the origin of the local frame."""
    events: tuple[tuple[float, int | None, str, str], ...]
    """What is planned to happen: time s, UAV (None: everybody), severity, text: a command is "info", a failure or a
    disturbance a "warning"."""

    @property
    def uavs(self) -> tuple[int, ...]:
        """Ids, in the order of the specs."""
        return self.graph.uavs

    def toml_of_run(self, started: float) -> str:
        """``toml`` with the Unix time (s) at which a run of it started: what stands in that run's folder."""
        return f"{self.toml}\n[flown.run]\nstarted = {datetime.fromtimestamp(started, UTC).isoformat()}\n"

    def with_seed(self, seed: int) -> Mission:
        """The same mission with other random numbers: noise, links, gusts and turbulence."""
        toml = tomli_w.dumps({**tomllib.loads(self.toml), "seed": seed})
        vehicles = tuple(
            replace(
                spec,
                gust=spec.gust if spec.gust == CALM else spec.gust._replace(seed=seed),
                turbulence=spec.turbulence if spec.turbulence == NO_TURBULENCE else spec.turbulence._replace(seed=seed),
            )
            for spec in self.vehicles
        )
        return replace(self, timing=self.timing._replace(seed=seed), vehicles=vehicles, toml=toml)

    @property
    def fire(self) -> Fire | None:
        """What the swarm flies around, as the first UAV knows it; all know the same but for their posts."""
        own = self.autopilots[0].reference
        if self.scheme.plant != "position" or not isinstance(own, OwnReference):
            return None
        return Fire(*own.parameters[: len(Fire._fields)])


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
    plant = plant_of(plan, scheme, findings)
    check_ends(plan, findings)
    check_wind(plan, plant, findings)
    limits = limits_of(plan, plant, findings)
    graph = graph_of(plan, scheme, findings)
    sheet = load_airframe(plan.airframe, scenario.file)
    true = _airframe(plan, sheet, plant, findings)
    findings.stop_if_refused()

    references = own_references(plan, scheme.plant, graph.followers, timing, findings)
    obstacles = tuple(Obstacle(*fields.x, fields.top) for fields in plan.obstacles)
    profiles = profiles_of(plan, graph, findings)
    findings.stop_if_refused()
    model = _nominal(plan, sheet, limits)
    code = _code(model, plant)
    vehicles = [_aircraft(plan, uav, plant, true, limits, code, timing, findings) for uav in graph.followers]
    vehicles += [_reference_point(plan, uav, plant, true, limits, profiles[uav]) for uav in graph.leaders]
    vehicles = [replace(vehicle, obstacles=obstacles, datum=plan.home.datum) for vehicle in vehicles]
    findings.stop_if_refused()
    check_starts(plan, plant, vehicles, findings)
    gains = gains_of(scenario, scheme, findings)
    if plan.fire is None:
        check_trims(plan, plant, vehicles, profiles, findings)
        check_faults(plan, plant, vehicles, profiles, findings)
    elif gains:
        laws = {uav: scheme.command_limits(own) for uav, own in gains.items()}
        check_posts(plan, references, vehicles, laws, model, findings)
    if not wire and any(fault.navigation for fault in plan.faults):
        findings.refuse(f"faults: form {scenario.form} measures without a navigation solution that could fail")

    flight = None
    if gains:
        flight = check_scheme(plan, scheme, gains, graph, timing, vehicles, profiles, references, findings)
        estimates = min(scheme.climb_limit(gains[uav]) for uav in graph.followers)
        profiles = limited(plan, profiles, sheet, limits[THRUST], estimates, findings)
        check_clearance(plan, profiles, findings)
    tolerant = gains
    if plan.switches.get(FAULT_TOLERANCE) is False:
        tolerant = gains_of(scenario, scheme, findings, plan.switches | {FAULT_TOLERANCE: True})
    channel = Channel(**plan.channel.model_dump())
    changes = link_changes(plan.link_events, graph, channel, findings.refuse)
    check_delays(plan, timing, findings)
    clearance = ["clearance"] if obstacles else []
    names = (*leading(plant.ACTUATORS), *clearance, *(quantity.name for quantity in scheme.signals))
    findings.refused += check_claims(plan.claims, graph, names)
    check_tracking(scheme, names, findings)
    findings.stop_if_refused()

    known = briefings(scheme, vehicles, profiles)
    # Laws for the vertical plane fly north.
    steered = scheme.plant == "longitudinal" and "aileron" in plant.ACTUATORS
    autopilots = tuple(
        AutopilotSpec(
            uav=vehicle.uav,
            role="leader" if vehicle.uav in graph.leaders else "follower",
            scheme=scheme.name,
            gains=tuple(gains[vehicle.uav]),
            tolerant_gains=tuple(tolerant[vehicle.uav]) if tolerant[vehicle.uav] != gains[vehicle.uav] else (),
            flight=flight,
            model=model,
            command=vehicle.command,
            travel=vehicle.travel,
            reference=references[vehicle.uav],
            neighbours=tuple(
                Neighbour(j, graph.weights[vehicle.uav, j], known.get(j, ())) for j in graph.senders(vehicle.uav)
            ),
            channel=channel,
            link_events=tuple(changes.get(vehicle.uav, ())),
            profile=profiles.get(vehicle.uav),
            offset=vehicle.offset,
            datum=vehicle.datum,
            course=0.0 if steered and vehicle.uav in graph.followers else None,
            attitude_code=vehicle.attitude_code,
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
        plant=vehicles[0].plant,
        timing=timing,
        wire=wire,
        graph=graph,
        obstacles=obstacles,
        vehicles=tuple(vehicles),
        autopilots=autopilots,
        claims=tuple(claim for claim in plan.claims if scenario.case in claim.expected),
        warnings=tuple(findings.warned),
        toml=_as_flown(scenario, scheme),
        home=(plan.home.latitude, plan.home.longitude, plan.home.altitude),
        events=_planned(plan, plant),
    )


def _nominal(plan: Plan, sheet: AirframeSheet | PointMassSheet, limits: tuple[tuple[float, float], ...]) -> Model:
    """What the laws know of the aircraft."""
    values = dict.fromkeys(Model._fields, 0.0)
    if isinstance(sheet, PointMassSheet):
        # (9.32) as a polar over the lift coefficient.
        values |= {"CLa": 1.0, "CDa2": sheet.kd * sheet.kn**2 / sheet.g**2}
    values |= {name: float(getattr(sheet, name)) for name in Model._fields if name in type(sheet).model_fields}
    for name, slot in (("thrust", THRUST), ("elevator", ELEVATOR), ("aileron", AILERON), ("rudder", RUDDER)):
        values[f"{name}_min"], values[f"{name}_max"] = limits[slot]
    values["lag"] = plan.plant.lag.elevator
    return Model(**values)


def _airframe(
    plan: Plan, sheet: AirframeSheet | PointMassSheet, plant: ModuleType, findings: Findings
) -> tuple[float, ...]:
    """The true parameters of the plant."""
    missing = [name for name in plant.Parameters._fields if name not in type(sheet).model_fields]
    if missing:
        findings.refuse(f"airframe = {plan.airframe!r}: lacks {', '.join(missing)}, which the plant needs")
        findings.stop_if_refused()
    airframe = plant.Parameters(**{name: float(getattr(sheet, name)) for name in plant.Parameters._fields})
    try:
        airframe = scaled(airframe, plan.plant.coefficients)
    except ValueError as error:
        findings.refuse(f"plant.coefficients: {error}")
    return tuple(airframe if plan.plant.elevator_lift else airframe._replace(CLde=0.0))


def _initial_command(plan: Plan, plant: ModuleType, steady: dict[str, float]) -> tuple[float, ...]:
    given = plan.plant.initial_actuators
    values = steady | (given if isinstance(given, dict) else {})
    return tuple(float(values.get(name, 0.0)) for name in in_slots(plant.ACTUATORS))


def _by_slot(fields: Lag | RateLimits | Damping, plant: ModuleType) -> tuple[float, ...]:
    return tuple(float(getattr(fields, name)) for name in in_slots(plant.ACTUATORS))


def _aircraft(
    plan: Plan,
    uav: int,
    plant: ModuleType,
    airframe: tuple[float, ...],
    limits: tuple[tuple[float, float], ...],
    code: AttitudeCode,
    timing: Timing,
    findings: Findings,
) -> VehicleSpec:
    own = plan.start.uav.get(uav)
    start: dict[str, float] = {}
    for name in plant.START:
        value = getattr(own, name) if own is not None else None
        value = value if value is not None else getattr(plan.start, name)
        if isinstance(value, float):
            start[name] = value
    for name in ("V", "z"):
        if name not in start:
            findings.refuse(f"start.{name}: is missing")
            start[name] = 1.0
    true = plant.Parameters(*airframe)
    steady = level_trim(plant, true, start["V"], f"start of UAV {uav}", findings)
    initial = (math.nan,) * len(plant.State._fields)
    try:
        initial = tuple(plant.initial(start, steady)) if steady else initial
    except ValueError as error:
        findings.refuse(f"start of UAV {uav}: {error}")
    noise, throttle = plan.noise, plan.plant.autothrottle
    channels = [name for name, _ in plant.DISTURBANCES]
    return VehicleSpec(
        uav=uav,
        kind="aircraft",
        plant=plants.name_of(plant),
        airframe=airframe,
        initial=initial,
        command=_initial_command(plan, plant, steady),
        limits=limits,
        lag=_by_slot(plan.plant.lag, plant),
        rate=_by_slot(plan.plant.rate_limits, plant),
        damping=_by_slot(plan.plant.damping, plant),
        delay=plan.plant.delay,
        holds_first=isinstance(plan.plant.initial_actuators, dict),
        gust=gust(plan),
        discrete_gusts=discrete_gusts(plan, uav, start["V"], findings),
        turbulence=turbulence(plan, uav, start["V"], timing),
        attitude_code=code,
        fault_before_lag=plan.plant.fault == "before_lag",
        faults=actuator_faults(plan, uav),
        navigation_faults=navigation_faults(plan, uav),
        disturbances=tuple(
            Disturbance(
                d.at,
                float(channels.index(name)),
                value,
                d.onset,
                math.inf if d.until is None else d.until,
                d.frequency or 0.0,
                d.phase,
            )
            for d in sorted(plan.disturbances, key=lambda d: d.at)
            if d.uavs is None or uav in d.uavs
            for name, value in d.values.items()
        )
        + mean_wind(plan, channels),
        noise=tuple(float(getattr(noise, name, 0.0)) * noise.factor for name in TRUTH),
        guards=_guards(plan),
        offset=start.get("y", 0.0),
        autothrottle=NO_AUTOTHROTTLE if throttle is None else Autothrottle(**throttle.model_dump()),
    )


def _code(model: Model, plant: ModuleType) -> AttitudeCode:
    """How commands travel as attitude targets, if the plant takes them so."""
    if not getattr(plant, "BY_ATTITUDE", False):
        return UNCODED
    return AttitudeCode(2.0 * model.m * model.g / (model.rho * model.S), model.CL0, model.CLa)


def _guards(plan: Plan) -> Guards:
    return Guards(**{name: float(getattr(plan.plant.guards, name)) for name in Guards._fields})


def _reference_point(
    plan: Plan,
    uav: int,
    plant: ModuleType,
    airframe: tuple[float, ...],
    limits: tuple[tuple[float, float], ...],
    profile: Profile,
) -> VehicleSpec:
    y = plan.leaders[uav].y
    return VehicleSpec(
        uav=uav,
        kind="reference_point",
        plant=plants.name_of(plant),
        airframe=airframe,
        initial=(0.0,) * len(plant.State._fields),
        command=(0.0,) * len(limits),
        limits=limits,
        lag=(0.0,) * len(limits),
        rate=(math.inf,) * len(limits),
        fault_before_lag=False,
        faults=(),
        disturbances=(),
        noise=(0.0,) * len(TRUTH),
        guards=_guards(plan),
        offset=y,
        target=(0.0, profile.x, y, profile.z, profile.V, 0.0, 0.0),
    )


def _planned(plan: Plan, plant: ModuleType) -> tuple[tuple[float, int | None, str, str], ...]:
    events = fault_texts(plan)
    commands: list[tuple[float, int | None, str]] = []
    units = dict(plant.DISTURBANCES)
    for disturbance in plan.disturbances:
        values = disturbance.values
        text = "disturbance " + ", ".join(f"{name} = {v:g} {units[name]}" for name, v in values.items())
        if disturbance.frequency is not None:
            text += f", oscillating with {disturbance.frequency:g} rad/s"
        for uav in [None] if disturbance.uavs is None else disturbance.uavs:
            events.append((disturbance.at, uav, text))
            if disturbance.until is not None:
                events.append((disturbance.until, uav, f"disturbance {', '.join(values)} over"))
    for uav, leader in plan.leaders.items():
        for command in leader.commands:
            if command.at is not None:
                asked = [f"{command.altitude:g} m"] if command.altitude is not None else []
                asked += [f"{command.speed:g} m/s"] if command.speed is not None else []
                commands.append((command.at, uav, f"leader commanded to {', '.join(asked)}"))
            if command.until is not None:
                commands.append((command.until, uav, "leader commanded as before"))
        if leader.cosine is not None:
            commands.append((leader.cosine.at, uav, "leader begins its cosine in altitude"))
    commands += reference_texts(plan)
    events += link_texts(plan.link_events)
    events += wind_texts(plan)
    all_of_them = [(t, uav, "info", text) for t, uav, text in commands]
    all_of_them += [(t, uav, "warning", text) for t, uav, text in events]
    ends = plan.duration + 1e-9
    return tuple(sorted((one for one in all_of_them if one[0] <= ends), key=lambda e: (e[0], e[1] or 0, e[3])))


_VERSIONED = ("ftcc-sitl", "numpy", "numba", "scipy", "pydantic", "pymavlink", "eclipse-zenoh")
"""What the numbers of a flight may depend on."""


@functools.cache
def _versions() -> dict[str, str]:
    return {name: importlib.metadata.version(name) for name in _VERSIONED} | {"python": platform.python_version()}


def _all_gains(scenario: Scenario, scheme: Scheme) -> dict[str, float]:
    gains = scheme.gains(scenario.form, scenario.plan.gains.common, followed_by_gains(scenario.plan))
    return gains._asdict()  # type: ignore[no-any-return]


def _as_flown(scenario: Scenario, scheme: Scheme) -> str:
    """The merged scenario with seed, versions, and every gain by value: a later default must not change it."""
    document = {key: value for key, value in scenario.document.items() if key != "flown"}
    document["seed"] = scenario.plan.seed
    gains = document.get("gains", {})
    document["gains"] = gains | _all_gains(scenario, scheme)
    document["flown"] = {
        "name": scenario.name,
        "form": scenario.form,
        "variants": list(scenario.variants),
        "settings": list(scenario.settings),
        "versions": _versions(),
    }
    return tomli_w.dumps(document)
