"""An aircraft of JSBSim in a scenario: found, loaded, its controls measured, and checked against the scenario."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

from ftcc.groundside.scenario.checks import Findings
from ftcc.groundside.schema import Plan
from ftcc.link.actuators import ACTUATORS, unit_of
from ftcc.sim.jsbsim.aircraft import Aircraft, JsbsimError
from ftcc.sim.jsbsim.controls import NO_CONTROL, Controls, controls_of
from ftcc.sim.jsbsim.flight import FlownAircraft
from ftcc.sim.plants import flies_model

__all__ = ["aircraft_of", "flown_of", "lacking_actuators"]

_SLACK = 1e-6
"""By how much a limit may exceed the travel that was measured, of the travel."""


def aircraft_of(plan: Plan, plant: ModuleType, file: Path, findings: Findings) -> Aircraft | None:
    """Return the aircraft of JSBSim that a scenario names; None if it names none. Refuse one that cannot be loaded."""
    given = plan.plant
    if not flies_model(plant):
        for name in ("aircraft", "properties"):
            if getattr(given, name):
                findings.refuse(f'plant.{name}: is for plant.model = "jsbsim" alone')
        return None
    if given.coefficients or not given.elevator_lift:
        findings.refuse("plant.coefficients, plant.elevator_lift: the aircraft's own file holds its coefficients")
    if given.aircraft is None:
        findings.refuse('plant.aircraft: is missing: for plant.model = "jsbsim" give a name or an XML file')
        findings.stop_if_refused()
        raise AssertionError
    path = file.parent / given.aircraft
    name = str(path.resolve()) if path.suffix == ".xml" else given.aircraft
    return Aircraft(name, tuple(sorted(given.properties.items())))


def lacking_actuators(plan: Plan, aircraft: Aircraft | None, findings: Findings) -> tuple[str, ...]:
    """Return the names of the actuators that a scenario's aircraft of JSBSim does not have."""
    start = plan.start
    if aircraft is None or start.V is None or start.z is None:
        return ()
    try:
        return controls_of(aircraft, start.V, start.z + plan.home.altitude).missing
    except JsbsimError as error:
        findings.refuse(f"plant.aircraft: {error}")
        findings.stop_if_refused()
        raise


def flown_of(
    plan: Plan, aircraft: Aircraft, V: float, z: float, step_us: int, guided: bool, findings: Findings
) -> FlownAircraft:
    """Return what flies a vehicle that starts at ``V`` (m/s) and ``z`` (m); refuse limits beyond its travel."""
    home = (plan.home.latitude, plan.home.longitude, plan.home.altitude)
    # One map from thrust to throttle for all aircraft of the swarm, whose commands then mean the same.
    common, height = plan.start.V or V, plan.start.z if plan.start.z is not None else z
    try:
        controls = controls_of(aircraft, common, height + plan.home.altitude)
    except JsbsimError as error:
        findings.refuse(f"plant.aircraft: {error}")
        findings.stop_if_refused()
        raise
    _check_actuators(plan, aircraft, controls, guided, findings)
    return FlownAircraft(aircraft, controls, home, z + plan.home.altitude, step_us, plan.seed)


def _check_actuators(plan: Plan, aircraft: Aircraft, controls: Controls, guided: bool, findings: Findings) -> None:
    """Refuse faults of actuators that the aircraft lacks, and limits that are beyond its travel."""
    for n, fault in enumerate(plan.faults):
        if fault.actuator in controls.missing:
            has = [name for name in ACTUATORS if name not in controls.missing]
            findings.refuse(
                f"faults.{n}.actuator = {fault.actuator!r}: {aircraft.title} has no {fault.actuator}; "
                f"it has {', '.join(has) or 'no actuator'}"
            )
    for name in ("thrust",) if guided else ACTUATORS:
        given, control = getattr(plan.plant.limits, name), getattr(controls, name)
        if given is None:
            continue
        if control == NO_CONTROL:
            findings.refuse(f"plant.limits.{name}: {aircraft.title} has no {name}")
            continue
        low, high, slack = control.least, control.most, _SLACK * (control.most - control.least)
        if given[1] > high + slack or (name != "thrust" and given[0] < low - slack):
            findings.refuse(
                f"plant.limits.{name} = {list(given)}: {aircraft.title} reaches {low:.4g} to {high:.4g} {unit_of(name)}"
            )
