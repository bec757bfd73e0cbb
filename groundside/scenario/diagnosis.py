"""Active fault tolerance of a scenario: the `DiagnosisSpec` of every follower."""

from __future__ import annotations

from types import ModuleType

from ftcc.airside.diagnosis.gains import diagnosis_gains
from ftcc.airside.scheme import Scheme
from ftcc.airside.spec import DiagnosisSpec
from ftcc.groundside.scenario.checks import Findings
from ftcc.groundside.schema import Plan
from ftcc.link.graph import Graph
from ftcc.sim.spec import VehicleSpec

__all__ = ["diagnosis_of", "health_edges"]


def health_edges(plan: Plan, graph: Graph) -> tuple[tuple[int, int], ...]:
    """Return the edges (leader, follower) over which leaders hear of health alone: they have no part in the graph."""
    if not (plan.diagnosis.on and plan.diagnosis.cooperate):
        return ()
    pairs = ((leader, follower) for leader in graph.leaders for follower in graph.followers)
    return tuple(pair for pair in pairs if pair not in graph.weights)


def diagnosis_of(
    plan: Plan, scheme: Scheme, plant: ModuleType, vehicle: VehicleSpec, steered: bool, findings: Findings
) -> DiagnosisSpec:
    """Return what the autopilot of the first follower, and so of all, is to know of its actuators.

    ``steered``: aileron and rudder are moved beside the scheme's own commands, by `lateral_hold`.
    """
    fields = plan.diagnosis
    if not fields.on:
        if fields.accommodate or fields.cooperate:
            findings.refuse("diagnosis: accommodate and cooperate need on = true")
        return DiagnosisSpec()
    moved = {*scheme.commands, *(("aileron", "rudder") if steered else ())}
    if plan.plant.autothrottle is not None:
        moved.discard("thrust")
    try:
        gains = diagnosis_gains(fields.gains.given)
    except ValueError as error:
        findings.refuse(f"diagnosis.gains: {error}")
        return DiagnosisSpec()
    return DiagnosisSpec(
        on=True,
        accommodates=fields.accommodate,
        cooperates=fields.cooperate,
        gains=tuple(gains),
        actuators=tuple(name for name in plant.ACTUATORS if name in moved),
        lag=vehicle.lag,
        damping=vehicle.damping,
    )
