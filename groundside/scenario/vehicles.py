"""The vehicles of a scenario: true airframe, nominal model for the laws, and the spec of each vehicle."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from types import ModuleType
from typing import NamedTuple

from ftcc.airside.model import Model
from ftcc.airside.references.profiles import Profile
from ftcc.groundside.scenario.checks import Findings
from ftcc.groundside.scenario.faults import actuator_faults, navigation_faults
from ftcc.groundside.scenario.jsbsim import flown_of
from ftcc.groundside.scenario.trims import level_trim
from ftcc.groundside.scenario.wind import discrete_gusts, gust, mean_wind, turbulence
from ftcc.groundside.schema import AirframeSheet, Damping, Lag, Plan, PointMassSheet, RateLimits, record_of
from ftcc.link.actuators import AILERON, ELEVATOR, RUDDER, THRUST, in_slots
from ftcc.link.airframe import PointMass
from ftcc.link.attitude_target import UNCODED, AttitudeCode
from ftcc.link.graph import Graph
from ftcc.link.timing import Timing
from ftcc.sim import plants
from ftcc.sim.actuation import NO_AUTOTHROTTLE, Autothrottle
from ftcc.sim.airframe import scaled
from ftcc.sim.disturbances import Disturbance
from ftcc.sim.jsbsim.aircraft import Aircraft
from ftcc.sim.obstacles import Obstacle
from ftcc.sim.plant import TRUTH, Guards
from ftcc.sim.spec import VehicleSpec

__all__ = ["Flyable", "nominal_model", "true_airframe", "vehicles_of"]

Limits = tuple[tuple[float, float], ...]
"""(lowest, highest) of each actuator, by slot."""


class Flyable(NamedTuple):
    """What all aircraft of a scenario have in common."""

    plant: ModuleType
    airframe: tuple[float, ...]
    """The true parameters of the plant."""
    limits: Limits
    model: Aircraft | None
    """The aircraft of JSBSim, where one flies."""


def vehicles_of(
    plan: Plan,
    flyable: Flyable,
    model: Model,
    graph: Graph,
    profiles: Mapping[int, Profile],
    timing: Timing,
    findings: Findings,
) -> list[VehicleSpec]:
    """Return the specs of the followers' aircraft, then of the leaders' reference points."""
    code = _attitude_code(model, flyable.plant)
    vehicles = [_aircraft(plan, uav, flyable, code, timing, findings) for uav in graph.followers]
    vehicles += [_reference_point(plan, uav, flyable, profiles[uav]) for uav in graph.leaders]
    obstacles = tuple(Obstacle(*fields.x, fields.top) for fields in plan.obstacles)
    return [replace(vehicle, obstacles=obstacles, datum=plan.home.datum) for vehicle in vehicles]


def nominal_model(plan: Plan, sheet: AirframeSheet | PointMassSheet, limits: Limits) -> Model:
    """Return the nominal model of the aircraft, which the laws use."""
    values = dict.fromkeys(Model._fields, 0.0)
    if isinstance(sheet, PointMassSheet):
        # (9.32) as a polar over the lift coefficient.
        point = record_of(sheet, PointMass)
        values |= {"CLa": 1.0, "CDa2": point.kd * point.kn**2 / point.g**2}
    values |= {name: float(getattr(sheet, name)) for name in Model._fields if name in type(sheet).model_fields}
    for name, slot in (("thrust", THRUST), ("elevator", ELEVATOR), ("aileron", AILERON), ("rudder", RUDDER)):
        values[f"{name}_min"], values[f"{name}_max"] = limits[slot]
    values["lag"] = plan.plant.lag.elevator
    return Model(**values)


def true_airframe(
    plan: Plan, sheet: AirframeSheet | PointMassSheet, plant: ModuleType, findings: Findings
) -> tuple[float, ...]:
    """Return the true parameters of the plant."""
    missing = [name for name in plant.Parameters._fields if name not in type(sheet).model_fields]
    if missing:
        findings.refuse(f"airframe = {plan.airframe!r}: lacks {', '.join(missing)}, which the plant needs")
        findings.stop_if_refused()
    airframe = record_of(sheet, plant.Parameters)
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
    flyable: Flyable,
    code: AttitudeCode,
    timing: Timing,
    findings: Findings,
) -> VehicleSpec:
    plant, airframe, limits, model = flyable
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
    guided = bool(getattr(plant, "BY_ATTITUDE", False))
    flown = None
    if model is not None:
        flown = flown_of(plan, model, start["V"], start["z"], timing.step_us, guided, findings)
    steady = level_trim(plant, true, start["V"], f"start of UAV {uav}", findings, flown)
    initial = (math.nan,) * len(plant.State._fields)
    try:
        initial = tuple(plant.initial(start, steady)) if steady else initial
    except ValueError as error:
        findings.refuse(f"start of UAV {uav}: {error}")
    throttle, noise = plan.plant.autothrottle, plan.noise.deviations
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
        turbulence=turbulence(plan, uav, start["V"], getattr(true, "b", 0.0), timing),
        attitude_code=code,
        fault_before_lag=plan.plant.fault == "before_lag",
        faults=actuator_faults(plan, uav),
        navigation_faults=navigation_faults(plan, uav),
        disturbances=_disturbances(plan, plant, uav),
        noise=tuple(noise[name] for name in TRUTH),
        guards=_guards(plan),
        offset=start.get("y", 0.0),
        autothrottle=NO_AUTOTHROTTLE if throttle is None else Autothrottle(**throttle.model_dump()),
        flown=flown,
    )


def _attitude_code(model: Model, plant: ModuleType) -> AttitudeCode:
    """Return how a command is encoded as an attitude target; ``UNCODED`` if the plant takes actuator commands."""
    if not getattr(plant, "BY_ATTITUDE", False):
        return UNCODED
    return AttitudeCode(2.0 * model.m * model.g / (model.rho * model.S), model.CL0, model.CLa)


def _disturbances(plan: Plan, plant: ModuleType, uav: int) -> tuple[Disturbance, ...]:
    """Return the disturbances that act on a UAV, in order of time, then its mean wind."""
    channels = [name for name, _ in plant.DISTURBANCES]
    planned = tuple(
        Disturbance(
            time=d.at,
            channel=float(channels.index(name)),
            value=value,
            onset=d.onset,
            until=math.inf if d.until is None else d.until,
            frequency=d.frequency or 0.0,
            phase=d.phase,
        )
        for d in sorted(plan.disturbances, key=lambda d: d.at)
        if d.uavs is None or uav in d.uavs
        for name, value in d.values.items()
    )
    return planned + mean_wind(plan, channels)


def _guards(plan: Plan) -> Guards:
    return Guards(**{name: float(getattr(plan.plant.guards, name)) for name in Guards._fields})


def _reference_point(plan: Plan, uav: int, flyable: Flyable, profile: Profile) -> VehicleSpec:
    plant, airframe, limits, _ = flyable
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
