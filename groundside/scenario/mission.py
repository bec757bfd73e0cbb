"""From a scenario to a mission: the spec of each process, checked as a whole.

`resolve` calls the steps of this room in order. Each step adds errors and warnings to the `Findings`, so that a user
sees all of them at once. `resolve` stops early where the next step depends on a refused value.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from types import ModuleType
from typing import Any, NamedTuple

import tomli_w

from ftcc.airside.attacks.attack import Attack
from ftcc.airside.attacks.recording import lie_columns
from ftcc.airside.autopilots import recorded_signals
from ftcc.airside.diagnosis.beliefs import belief_signals
from ftcc.airside.model import Model
from ftcc.airside.references.position import Fire
from ftcc.airside.references.profiles import Profile
from ftcc.airside.scheme import FAULT_TOLERANCE, Flight, Quantity, Scheme
from ftcc.airside.spec import AutopilotSpec, DefenceSpec, DiagnosisSpec, LinkEvent, Neighbour, OwnReference
from ftcc.groundside.claims import check_claims
from ftcc.groundside.scenario.as_flown import as_flown
from ftcc.groundside.scenario.attacks import attacks_of
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
from ftcc.groundside.scenario.columns import leading_columns
from ftcc.groundside.scenario.defence import defence_of
from ftcc.groundside.scenario.diagnosis import diagnosis_of, health_edges
from ftcc.groundside.scenario.faults import TrimDemand, check_fault_times, check_faults, trim_demands
from ftcc.groundside.scenario.fire import check_posts
from ftcc.groundside.scenario.jsbsim import aircraft_of, lacking_actuators
from ftcc.groundside.scenario.laws import check_scheme, gains_of, initial_shared_values
from ftcc.groundside.scenario.leaders import check_clearance, limit_climb_rates, profiles_of
from ftcc.groundside.scenario.links import link_changes
from ftcc.groundside.scenario.loading import Scenario, load_airframe
from ftcc.groundside.scenario.references import own_references
from ftcc.groundside.scenario.timeline import PlannedEvent, planned_events
from ftcc.groundside.scenario.trims import check_starts, check_trims
from ftcc.groundside.scenario.vehicles import Flyable, nominal_model, true_airframe, vehicles_of
from ftcc.groundside.scenario.wind import check_wind
from ftcc.groundside.schema import AirframeSheet, Claim, Plan, PointMassSheet
from ftcc.link.actuators import THRUST
from ftcc.link.channel import Channel
from ftcc.link.graph import Graph
from ftcc.link.recording import Column
from ftcc.link.timing import Timing
from ftcc.sim.disturbances import CALM
from ftcc.sim.jsbsim.aircraft import Aircraft
from ftcc.sim.obstacles import Obstacle
from ftcc.sim.spec import VehicleSpec
from ftcc.sim.wind import NO_TURBULENCE

__all__ = ["Mission", "resolve", "trims_under_faults"]


@dataclass(frozen=True)
class Mission:
    """A checked flight plan, with the specs of all vehicles and autopilots."""

    name: str
    title: str
    form: str
    variants: tuple[str, ...]
    case: str
    """Form and variants, the key of the claims' expected values."""
    scheme: Scheme
    plant: str
    """Name of the aircraft's plant, see ``sim.plants``."""
    timing: Timing
    wire: bool
    """True: states, commands and records are messages, and a command acts one sample later. False: ideal exchange."""
    graph: Graph
    obstacles: tuple[Obstacle, ...]
    vehicles: tuple[VehicleSpec, ...]
    """Followers, then leaders."""
    autopilots: tuple[AutopilotSpec, ...]
    claims: tuple[Claim, ...]
    """The claims of this case."""
    warnings: tuple[str, ...]
    toml: str
    """The merged scenario as flown, with seed and versions: enough to repeat the flight."""
    home: tuple[float, float, float]
    """Latitude, longitude (deg) and altitude (m) of the origin of the local frame."""
    events: tuple[PlannedEvent, ...]

    @property
    def signals(self) -> tuple[Quantity, ...]:
        """What each follower's autopilot records."""
        return recorded_signals(self.autopilots[0])

    @property
    def lie_columns(self) -> tuple[Column, ...]:
        """What is recorded of UAVs that lie to their neighbours: what was true, and what was told."""
        return lie_columns(self.scheme)

    @property
    def uavs(self) -> tuple[int, ...]:
        """Ids, in the order of the specs."""
        return self.graph.uavs

    def toml_of_run(self, started: float) -> str:
        """Return ``toml`` with the Unix time (s) at which a run started, for the run's folder."""
        return f"{self.toml}\n[flown.run]\nstarted = {datetime.fromtimestamp(started, UTC).isoformat()}\n"

    def with_seed(self, seed: int) -> Mission:
        """Return the same mission with other random numbers: noise, links, gusts and turbulence."""
        toml = tomli_w.dumps({**tomllib.loads(self.toml), "seed": seed})
        vehicles = tuple(
            replace(
                spec,
                gust=spec.gust if spec.gust == CALM else spec.gust._replace(seed=seed),
                turbulence=spec.turbulence if spec.turbulence == NO_TURBULENCE else spec.turbulence._replace(seed=seed),
                flown=None if spec.flown is None else replace(spec.flown, seed=seed),
            )
            for spec in self.vehicles
        )
        return replace(self, timing=self.timing._replace(seed=seed), vehicles=vehicles, toml=toml)

    @property
    def fire(self) -> Fire | None:
        """The fire, from the first UAV's reference; other UAVs differ only in their post. None without a fire."""
        own = self.autopilots[0].reference
        if self.scheme.plant != "position" or not isinstance(own, OwnReference):
            return None
        return Fire(*own.parameters[: len(Fire._fields)])


def resolve(scenario: Scenario) -> Mission:
    """Check a scenario as a whole and return its specs.

    Raises
    ------
    ScenarioError
        With all errors that were found.
    """
    plan, findings = scenario.plan, Findings(scenario)
    basis = _basis(scenario, findings)
    references = own_references(plan, basis.scheme.plant, basis.graph.followers, basis.timing, findings)
    profiles = profiles_of(plan, basis.graph, findings)
    findings.stop_if_refused()
    model = nominal_model(plan, basis.sheet, basis.limits)
    aircraft = Flyable(basis.plant, basis.airframe, basis.limits, basis.aircraft)
    vehicles = vehicles_of(plan, aircraft, model, basis.graph, profiles, basis.timing, findings)
    findings.stop_if_refused()
    gains = gains_of(scenario, basis.scheme, findings)
    _check_flyable(plan, basis, vehicles, profiles, references, gains, model, findings)
    flight = None
    if gains:
        flight, profiles = _prepare_guidance(plan, basis, vehicles, profiles, references, gains, findings)
    tolerant = _tolerant_gains(scenario, basis.scheme, gains, findings)
    channel = Channel(**plan.channel.model_dump())
    changes = link_changes(plan.link_events, basis.graph, health_edges(plan, basis.graph), channel, findings.refuse)
    attacks = attacks_of(plan, basis.scheme, basis.graph, basis.timing, findings)
    diagnosis = diagnosis_of(plan, basis.scheme, basis.plant, vehicles[0], _is_steered(basis), findings)
    defence = defence_of(plan, basis.scheme, basis.graph, findings)
    check_delays(plan, basis.timing, findings)
    _check_recorded_columns(plan, basis, diagnosis, findings)
    findings.stop_if_refused()

    autopilots = _autopilots(
        plan,
        basis,
        vehicles,
        model,
        flight,
        gains,
        tolerant,
        references,
        profiles,
        channel,
        changes,
        diagnosis,
        defence,
        attacks,
    )
    return Mission(
        name=scenario.name,
        title=plan.title,
        form=scenario.form,
        variants=scenario.variants,
        case=scenario.case,
        scheme=basis.scheme,
        plant=vehicles[0].plant,
        timing=basis.timing,
        wire=basis.wire,
        graph=basis.graph,
        obstacles=vehicles[0].obstacles,
        vehicles=tuple(vehicles),
        autopilots=autopilots,
        claims=tuple(claim for claim in plan.claims if scenario.case in claim.expected),
        warnings=tuple(findings.warned),
        toml=as_flown(scenario, basis.scheme),
        home=(plan.home.latitude, plan.home.longitude, plan.home.altitude),
        events=planned_events(plan, basis.plant),
    )


def trims_under_faults(scenario: Scenario) -> dict[int, tuple[TrimDemand, ...]]:
    """Return what level flight asks of each faulty actuator, by the number of the fault.

    A fault may leave no level trim; the checks that refuse it, and those of the law, are not made.

    Raises
    ------
    ScenarioError
        If the scenario has no aircraft to compute with.
    """
    plan, findings = scenario.plan, Findings(scenario)
    basis = _basis(scenario, findings)
    profiles = profiles_of(plan, basis.graph, findings)
    findings.stop_if_refused()
    model = nominal_model(plan, basis.sheet, basis.limits)
    aircraft = Flyable(basis.plant, basis.airframe, basis.limits, basis.aircraft)
    vehicles = vehicles_of(plan, aircraft, model, basis.graph, profiles, basis.timing, findings)
    findings.stop_if_refused()
    faults = range(len(plan.faults)) if plan.fire is None else ()
    demands = {n: tuple(trim_demands(plan, basis.plant, vehicles, profiles, n, findings)) for n in faults}
    findings.stop_if_refused()
    return demands


class _Basis(NamedTuple):
    """Parts of a mission that all other parts depend on."""

    scheme: Scheme
    wire: bool
    timing: Timing
    plant: ModuleType
    limits: tuple[tuple[float, float], ...]
    graph: Graph
    sheet: AirframeSheet | PointMassSheet
    airframe: tuple[float, ...]
    """The true parameters of the plant."""
    aircraft: Aircraft | None
    """The aircraft of JSBSim, where one flies."""


def _basis(scenario: Scenario, findings: Findings) -> _Basis:
    plan = scenario.plan
    scheme = scheme_of(scenario, findings)
    wire = scenario.form != IDEAL
    timing = timing_of(plan, wire, findings)
    plant = plant_of(plan, scheme, findings)
    check_fault_times(plan, findings)
    check_wind(plan, plant, findings)
    aircraft = aircraft_of(plan, plant, scenario.file, findings)
    limits = limits_of(plan, plant, lacking_actuators(plan, aircraft, findings), findings)
    graph = graph_of(plan, scheme, findings)
    sheet = load_airframe(plan.airframe, scenario.file, scenario.places)
    airframe = true_airframe(plan, sheet, plant, findings)
    findings.stop_if_refused()
    return _Basis(scheme, wire, timing, plant, limits, graph, sheet, airframe, aircraft)


def _check_flyable(
    plan: Plan,
    basis: _Basis,
    vehicles: list[VehicleSpec],
    profiles: dict[int, Profile],
    references: Mapping[int, OwnReference],
    gains: Mapping[int, Any],
    model: Model,
    findings: Findings,
) -> None:
    """Refuse aircraft, healthy or faulty, whose travel is too small for start, disturbances or references."""
    check_starts(plan, basis.plant, vehicles, findings)
    if plan.fire is None:
        check_trims(plan, basis.plant, vehicles, profiles, findings)
        check_faults(plan, basis.plant, vehicles, profiles, findings)
    elif gains:
        laws = {uav: basis.scheme.command_limits(own) for uav, own in gains.items()}
        check_posts(plan, references, vehicles, laws, model, findings)
    if not basis.wire and any(fault.navigation for fault in plan.faults):
        findings.refuse(f"faults: form {IDEAL} has no navigation solution that could fail")


def _prepare_guidance(
    plan: Plan,
    basis: _Basis,
    vehicles: list[VehicleSpec],
    profiles: dict[int, Profile],
    references: Mapping[int, OwnReference],
    gains: Mapping[int, Any],
    findings: Findings,
) -> tuple[Flight, dict[int, Profile]]:
    """Check the laws, and limit the leaders' profiles to what the followers can follow; return flight and profiles."""
    flight = check_scheme(
        plan, basis.scheme, gains, basis.graph, basis.timing, vehicles, profiles, references, findings
    )
    estimates = min(basis.scheme.climb_limit(gains[uav]) for uav in basis.graph.followers)
    profiles = limit_climb_rates(plan, profiles, basis.sheet, basis.limits[THRUST], estimates, findings)
    check_clearance(plan, profiles, findings)
    return flight, profiles


def _tolerant_gains(
    scenario: Scenario, scheme: Scheme, gains: Mapping[int, Any], findings: Findings
) -> Mapping[int, Any]:
    """Return the gains with fault tolerance, for a flight that begins without it; a command may switch it on."""
    switches = scenario.plan.switches
    if switches.get(FAULT_TOLERANCE) is not False:
        return gains
    return gains_of(scenario, scheme, findings, switches | {FAULT_TOLERANCE: True})


def _check_recorded_columns(plan: Plan, basis: _Basis, diagnosis: DiagnosisSpec, findings: Findings) -> None:
    """Refuse claims and tracking errors that use columns which are not recorded."""
    clearance = ["clearance"] if plan.obstacles else []
    beliefs = belief_signals(diagnosis.actuators) if diagnosis.on else ()
    signals = (quantity.name for quantity in (*basis.scheme.signals, *beliefs))
    names = (*leading_columns(basis.plant.ACTUATORS), *clearance, *signals)
    findings.refused += check_claims(plan.claims, basis.graph, names)
    check_tracking(basis.scheme, names, findings)


def _is_steered(basis: _Basis) -> bool:
    """Whether aileron and rudder are moved beside the law: laws for the vertical plane fly north."""
    return basis.scheme.plant == "longitudinal" and "aileron" in basis.plant.ACTUATORS


def _autopilots(
    plan: Plan,
    basis: _Basis,
    vehicles: Sequence[VehicleSpec],
    model: Model,
    flight: Flight | None,
    gains: Mapping[int, Any],
    tolerant: Mapping[int, Any],
    references: Mapping[int, OwnReference],
    profiles: dict[int, Profile],
    channel: Channel,
    changes: Mapping[int, Sequence[LinkEvent]],
    diagnosis: DiagnosisSpec,
    defence: DefenceSpec,
    attacks: Mapping[int, tuple[Attack, ...]],
) -> tuple[AutopilotSpec, ...]:
    """Return the spec of each vehicle's autopilot."""
    graph, scheme = basis.graph, basis.scheme
    initial = initial_shared_values(scheme, vehicles, profiles)
    steered = _is_steered(basis)
    added = health_edges(plan, graph)
    return tuple(
        AutopilotSpec(
            uav=vehicle.uav,
            role="leader" if vehicle.uav in graph.leaders else "follower",
            scheme=scheme.name,
            gains=tuple(gains[vehicle.uav]),
            tolerant_gains=tuple(tolerant[vehicle.uav]) if tolerant[vehicle.uav] != gains[vehicle.uav] else (),
            diagnosis=diagnosis,
            defence=defence,
            flight=flight,
            model=model,
            command=vehicle.command,
            travel=vehicle.travel,
            reference=references[vehicle.uav],
            neighbours=(
                *(Neighbour(j, graph.weights[vehicle.uav, j], initial.get(j, ())) for j in graph.senders(vehicle.uav)),
                *(Neighbour(j, 0.0) for receiver, j in added if receiver == vehicle.uav),
            ),
            channel=channel,
            link_events=tuple(changes.get(vehicle.uav, ())),
            attacks=attacks.get(vehicle.uav, ()),
            authenticated=plan.network.authenticated,
            profile=profiles.get(vehicle.uav),
            offset=vehicle.offset,
            datum=vehicle.datum,
            course=0.0 if steered and vehicle.uav in graph.followers else None,
            attitude_code=vehicle.attitude_code,
            receivers=(*graph.receivers(vehicle.uav), *(i for i, sender in added if sender == vehicle.uav)),
        )
        for vehicle in vehicles
    )
