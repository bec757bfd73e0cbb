"""Healthy flights of a scenario under all that may look like a fault: noise, moving air, wrong coefficients, loss."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from ftcc.airside.diagnosis.gains import DiagnosisGains
from ftcc.groundside.scenario.loading import Scenario
from ftcc.groundside.scenario.mission import Mission
from ftcc.groundside.schema import Plan
from ftcc.link.airframe import Airframe, PointMass
from ftcc.sim.plant import UNITS
from ftcc.sim.plants import find, flies_model
from ftcc.sim.wind import AIR

__all__ = ["HEALTHY", "healthy_changes", "healthy_quantities"]

HEALTHY: dict[str, Any] = {
    "faults": [],
    "attacks": [],
    "diagnosis": {"on": True, "accommodate": False, "cooperate": False},
}
"""What makes any scenario one of healthy aircraft that diagnose themselves, merged like a variant."""

_LOSS = 0.3
"""Share of records that the radio loses."""
_COEFFICIENT = (0.8, 1.2)
"""Factor of each true aerodynamic coefficient."""
_AIR = {"sigma": [0.5, 0.5, 0.35], "length": [200.0, 200.0, 50.0]}
"""Turbulence (m/s, m) of a scenario that has none of its own: light air of low flight. In rougher air the thresholds
must be wider; a scenario that flies in it declares it."""
_SHIFT = 1.0
"""Largest delay of a manoeuvre, s, so that it meets every phase of sampling and exchange."""


def _uniform(low: float, high: float) -> dict[str, Any]:
    return {"distribution": "uniform", "low": low, "high": high}


def healthy_changes(scenario: Scenario, mission: Mission) -> dict[str, Any]:
    """Return what a healthy flight changes in a scenario, merged like a variant.

    Parameters
    ----------
    scenario, mission
        The scenario with `HEALTHY`, and its mission.
    """
    plan = scenario.plan
    # A step of a disturbance is what a bias of the actuator of its equation is: nobody can tell them apart.
    changes = HEALTHY | {
        "channel": {"loss": _LOSS},
        "disturbances": [],
        "noise": _noise(plan, mission),
        "record_rate": plan.rates.control_rate,
    }
    if _flies_in_air(mission) and plan.turbulence is None and not plan.gusts:
        changes["turbulence"] = _AIR
    return changes


def healthy_quantities(scenario: Scenario, mission: Mission) -> dict[str, dict[str, Any]]:
    """Return what is drawn for each healthy flight, as in ``[study.random]``; see `healthy_changes`."""
    plan = scenario.plan
    found = {f"plant.coefficients.{name}": _uniform(*_COEFFICIENT) for name in _coefficients(mission)}
    return found | {key: _uniform(at, latest) for key, at, latest in _shifted(plan)}


def _flies_in_air(mission: Mission) -> bool:
    return {*AIR} <= {name for name, _ in find(mission.plant).DISTURBANCES}


def _coefficients(mission: Mission) -> Sequence[str]:
    """Those of the true aircraft; none where an external model has its own."""
    if flies_model(find(mission.plant)):
        return ()
    record = PointMass if find(mission.plant).Parameters is PointMass else Airframe
    return [name for name in record._fields if name.startswith("C")]


def _noise(plan: Plan, mission: Mission) -> dict[str, float]:
    """The scenario's deviations times 1; where it has none, those that the diagnosis expects of the plant's sensors."""
    if any(getattr(plan.noise, name) > 0.0 for name in UNITS):
        return {"factor": 1.0}
    plant = find(mission.plant)
    gains = DiagnosisGains(*mission.autopilots[0].diagnosis.gains)
    expected = {"m/s": gains.sd_speed, "rad": gains.sd_angle, "rad/s": gains.sd_rate}
    # A plant without a course moves in the vertical plane, and has the angles with which it can start.
    measured = {*(UNITS if "chi" in plant.START else plant.START)} - {*plant.COMPLETED}
    return {"factor": 1.0} | {
        name: expected[unit] for name, unit in UNITS.items() if name in measured and unit in expected
    }


def _shifted(plan: Plan) -> Iterator[tuple[str, float, float]]:
    """Key, time (s) and latest time of each manoeuvre that begins at a time."""
    lists: list[tuple[str, Sequence[Any]]] = [
        ("fire_events", plan.fire_events),
        ("attitude.commands", plan.attitude.commands if plan.attitude else ()),
        *((f"leaders.{uav}.commands", leader.commands) for uav, leader in plan.leaders.items()),
    ]
    for where, events in lists:
        times = sorted(event.at for event in events if event.at is not None)
        for n, event in enumerate(events):
            # A reference of attitude begins with a command at t = 0.
            if event.at is not None and (where != "attitude.commands" or event.at > 0.0):
                later = [time - event.at for time in times if time > event.at]
                ends = [event.until - event.at] if getattr(event, "until", None) is not None else []
                yield f"{where}.{n}.at", event.at, event.at + min([_SHIFT, *(0.5 * gap for gap in (*later, *ends))])
