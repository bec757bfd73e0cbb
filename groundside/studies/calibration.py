"""Thresholds of diagnosis with which no healthy flight raises an alarm, found by flying.

The test of an actuator is a cumulative sum of what its residual exceeds a *drift* by, and an alarm when the sum reaches
a *limit*. Flown with a limit that is never reached, a healthy flight tells the largest sum that it has, and so every
limit with which it would have raised no alarm: up to the first alarm a flight does not depend on the limit.

1. Of several drifts, shares of the smallest fault that is to be found fast, each flies a tenth of the hours. With the
   limit `MARGIN` times the largest sum M(d), a fault of size f adds f - d a second and is found after
   MARGIN M(d) / (f - d): the drift with the shortest such delay is taken.
2. All hours are flown with that drift, and the limit is `MARGIN` times the largest sum.
3. Fresh flights, as many hours, are held against the limit. If a sum reaches it, the limit is raised to `MARGIN` times
   that sum, and fresh flights follow, until a set raises no alarm. Then with 95 % confidence there are less than
   3.0 / hours alarms an hour in such flights.
"""

from __future__ import annotations

import importlib.metadata
import math
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ftcc.airside.model import level_deflections
from ftcc.airside.point_mass import drag
from ftcc.groundside.scenario import (
    HEALTHY,
    Mission,
    Scenario,
    find,
    healthy_changes,
    healthy_quantities,
    load,
    resolve,
    variant_names,
)
from ftcc.groundside.schema import StudyClaim, StudyFields
from ftcc.groundside.studies.campaign import engine_for
from ftcc.groundside.studies.engine import Engine, catch_ctrl_c, fly_all
from ftcc.groundside.studies.errors import StudyError
from ftcc.groundside.studies.flying import Outcome
from ftcc.groundside.studies.plan import StudyPlan
from ftcc.groundside.studies.planning import plan_of_fields
from ftcc.link.actuators import unit_of

__all__ = ["MARGIN", "Calibrated", "Calibration", "Threshold", "calibrate", "plan_calibration"]

MARGIN = 1.3
"""Limit over the largest sum of all healthy flights."""
_SHARES = (0.2, 0.3, 0.4, 0.5, 0.65, 0.8)
"""Drifts that are tried, over the smallest fault that is to be found fast."""
_TRIED = 0.1
"""Share of the hours that each of them flies."""
_SMALLEST_ANGLE, _SMALLEST_LOAD = 0.07, 0.3
"""That fault, rad and load factor: about what a third less elevator does in level flight."""
_SMALLEST_THRUST = 0.8
"""That of thrust, over the thrust of level flight: its total loss."""
_SOONEST = 0.02
"""Time before which the smallest fault is not to raise an alarm, s: the least limit."""
_NEVER = 100.0
"""Limit that no sum reaches, over the smallest fault times 1 s."""
_SETS = 8
"""Fresh sets after which the calibration gives up."""
_ALARMS = 3.0
"""-log(0.05): mean number of alarms that a set without any excludes with 95 % confidence."""


@dataclass(frozen=True)
class Calibration:
    """Healthy flights of a scenario."""

    name: str
    case: str
    file: Path
    """Of the scenario."""
    actuators: dict[str, float]
    """By actuator, the smallest fault that is to be found fast, in its unit."""
    hours: float
    """Of aircraft in flight, of one set."""
    seed: int
    plan: StudyPlan
    """One flight; the thresholds of its documents are not yet those that fly."""
    followers: int
    options: str
    """What else was given on the command line."""

    @property
    def flights(self) -> int:
        """Return the number of flights of a set."""
        return self.flights_of(self.hours)

    def flights_of(self, hours: float) -> int:
        """Return how many flights so many hours take."""
        return math.ceil(hours * 3600.0 / (self.plan.mission.timing.duration * self.followers))

    def with_drifts(self, drifts: Mapping[str, float], flights: int, seed: int) -> StudyPlan:
        """Return so many flights with these drifts, and with limits that are never reached."""
        gains = {f"drift_{name}": drift for name, drift in drifts.items()}
        gains |= {f"limit_{name}": _NEVER * fault for name, fault in self.actuators.items()}
        documents = tuple((case, _with_gains(document, gains)) for case, document in self.plan.documents)
        draws = replace(self.plan.draws, samples=flights, seed=seed)
        return replace(self.plan, documents=documents, draws=draws)


@dataclass(frozen=True)
class Threshold:
    """What was found for an actuator."""

    actuator: str
    drift: float
    limit: float
    largest: float
    """Largest sum of the healthy flights."""
    delay: float
    """Time from the onset of the smallest fault to the alarm, s."""


@dataclass(frozen=True)
class Calibrated:
    """Thresholds of a scenario, and what they were found by."""

    calibration: Calibration
    thresholds: tuple[Threshold, ...]
    flown: float
    """Hours of all sets with the drifts that were taken."""
    fresh: float
    """Hours of the last set, which raised no alarm."""
    seeds: tuple[int, int]
    """First seed of all flights, and the last one."""
    lost: int
    """Flights in which a healthy aircraft was lost; its sums do not count."""

    @property
    def alarms_an_hour(self) -> float:
        """Return the rate of alarms that is excluded with 95 % confidence."""
        return _ALARMS / self.fresh

    def toml(self) -> str:
        """Return the file beside the scenario."""
        one = self.calibration
        version = importlib.metadata.version("ftcc-sitl")
        command = f"ftcc calibrate {one.name} --hours {one.hours:g} --seed {one.seed}{one.options}"
        lines = [
            f"# Thresholds of diagnosis, by {command}",
            f"# case {one.case}, version {version}, seeds {self.seeds[0]} to {self.seeds[1]}",
            f"# {self.flown:.4g} h of healthy aircraft; the last {self.fresh:.4g} h are fresh and without an alarm:",
            f"# less than {self.alarms_an_hour:.2g} alarms an hour with 95 % confidence",
        ]
        if self.lost:
            lines.append(f"# in {self.lost} flights a healthy aircraft was lost; its sums do not count")
        lines += ["", "[diagnosis.gains]"]
        for found in self.thresholds:
            unit, fault = unit_of(found.actuator), one.actuators[found.actuator]
            lines.append(f"drift_{found.actuator} = {found.drift:.4g}  # {unit}")
            lines.append(
                f"limit_{found.actuator} = {found.limit:.4g}  # {unit} s; the largest sum was {found.largest:.3g}; "
                f"{fault:.3g} {unit} is found after {found.delay:.2f} s"
            )
        return "\n".join(lines) + "\n"


def plan_calibration(
    name: str | Path,
    *,
    hours: float,
    form: str | None = None,
    variants: str = "",
    settings: Sequence[str] = (),
    seed: int | None = None,
    duration: float | None = None,
) -> Calibration:
    """Plan the healthy flights of a scenario.

    Parameters
    ----------
    name, form, variants, settings, seed, duration
        See `scenario.load`; ``seed`` is that of the first flight.
    hours : float
        Of aircraft in flight, at least: two aircraft that fly for an hour fly two.

    Raises
    ------
    StudyError, ScenarioError
    """
    if not (math.isfinite(hours) and hours > 0.0):
        raise StudyError(f"--hours {hours:g}: must be a positive number")
    chosen: dict[str, Any] = {"form": form, "variants": variant_names(variants), "settings": settings}
    chosen |= {"seed": seed, "duration": duration}
    scenario = load(name, changes=HEALTHY, **chosen)
    if scenario.plan.flown is not None:
        raise StudyError(f"{name}: is a run; thresholds belong to the scenario that it flew")
    mission = resolve(scenario)
    actuators = _smallest_faults(scenario, mission)
    fields = StudyFields(
        changes=healthy_changes(scenario, mission),
        random=healthy_quantities(scenario, mission),
        design="random",
        redraw=True,
        claims=[
            StudyClaim(
                name=_claim(actuator),
                metric="max_abs",
                signal=f"evidence_{actuator}",
                window=(0.0, scenario.plan.duration),
                bound="< 1",
            )
            for actuator in actuators
        ],
    )
    plan = plan_of_fields(name, fields, **chosen)
    followers = len(scenario.plan.uavs.followers)
    given: dict[str, Sequence[Any]] = {"form": [form], "variant": [variants], "duration": [duration], "set": settings}
    options = "".join(f" --{key} {shlex.quote(str(one))}" for key, values in given.items() for one in values if one)
    return Calibration(
        scenario.name, scenario.case, find(name), actuators, hours, plan.draws.seed, plan, followers, options
    )


def _claim(actuator: str) -> str:
    return f"sum of {actuator}"


def _smallest_faults(scenario: Scenario, mission: Mission) -> dict[str, float]:
    """By actuator that diagnosis watches, the smallest fault that is to be found fast."""
    spec = mission.autopilots[0]
    found = {}
    level = _level_thrust(scenario, mission)
    faults = {"thrust": _SMALLEST_THRUST * level, "load_factor": _SMALLEST_LOAD}
    for actuator in spec.diagnosis.actuators:
        found[actuator] = faults.get(actuator, _SMALLEST_ANGLE)
    if not found:
        raise StudyError(f"{scenario.name}: no actuator of it is watched by diagnosis")
    return found


def _level_thrust(scenario: Scenario, mission: Mission) -> float:
    """Thrust (N) of level flight at the speed of the start, by the nominal model."""
    model, V = mission.autopilots[0].model, scenario.plan.start.V
    if V is None:
        V = next(own.V for own in scenario.plan.start.uav.values() if own.V is not None)
    if mission.scheme.plant == "position":
        return float(drag(V, 1.0, model))
    return level_deflections(V, model)["thrust"]


def _with_gains(document: dict[str, Any], gains: Mapping[str, float]) -> dict[str, Any]:
    diagnosis = document["diagnosis"]
    return document | {"diagnosis": diagnosis | {"gains": {**diagnosis.get("gains", {}), **gains}}}


def calibrate(
    calibration: Calibration,
    *,
    jobs: int | None = None,
    cluster: str | None = None,
    engine: Engine | None = None,
    report: Callable[[str, int, int], None] = lambda what, flown, of: None,
) -> Calibrated | None:
    """Fly until fresh flights raise no alarm.

    Parameters
    ----------
    calibration : Calibration
    jobs, cluster
        See `study`.
    engine : Engine, optional
        Where it flies, instead.
    report : callable
        Called whenever flights have landed: what is flown, how many flights have landed, and of how many.

    Returns
    -------
    Calibrated or None
        None if Ctrl-C interrupted it.

    Raises
    ------
    StudyError
        If the flights fail, or fresh ones still raise alarms in the end.
    """
    engine = engine or engine_for(calibration.plan, jobs, cluster, None, calibration.flights)
    try:
        with catch_ctrl_c() as raise_if_interrupted:
            engine.prepare(calibration.plan)
            raise_if_interrupted()
            return _Sets(calibration, engine, report, raise_if_interrupted).found()
    except KeyboardInterrupt:
        return None
    finally:
        engine.close()


class _Sets:
    """The sets of flights of a calibration, one after the other, each with seeds of its own."""

    def __init__(
        self,
        calibration: Calibration,
        engine: Engine,
        report: Callable[[str, int, int], None],
        raise_if_interrupted: Callable[[], None],
    ) -> None:
        self._calibration = calibration
        self._engine = engine
        self._report = report
        self._raise_if_interrupted = raise_if_interrupted
        self._seed = calibration.seed
        self._lost = 0

    def found(self) -> Calibrated:
        """Return the thresholds, see the module."""
        one = self._calibration
        drifts = self._fastest_drifts()
        largest = self._largest("calibrating", drifts, one.flights)
        hours = self._hours(one.flights)
        flown = hours
        for number in range(_SETS):
            limits = {name: self._limit(name, drifts[name], largest[name]) for name in drifts}
            fresh = self._largest(f"fresh set {number + 1}", drifts, one.flights)
            flown += hours
            largest = {name: max(largest[name], fresh[name]) for name in drifts}
            if all(fresh[name] < limits[name] for name in drifts):
                thresholds = tuple(
                    Threshold(name, drifts[name], limits[name], largest[name], self._delay(name, drifts[name], limit))
                    for name, limit in limits.items()
                )
                return Calibrated(one, thresholds, flown, hours, (one.seed, self._seed - 1), self._lost)
        raise StudyError(
            f"{one.name}: fresh flights still raise alarms after {_SETS} sets of {one.hours:g} h: fly longer, --hours"
        )

    def _hours(self, flights: int) -> float:
        one = self._calibration
        return flights * one.plan.mission.timing.duration * one.followers / 3600.0

    def _limit(self, actuator: str, drift: float, largest: float) -> float:
        """The limit as the file will have it."""
        least = _SOONEST * (self._calibration.actuators[actuator] - drift)
        return _rounded_up(max(MARGIN * largest, least))

    def _delay(self, actuator: str, drift: float, limit: float) -> float:
        return limit / (self._calibration.actuators[actuator] - drift)

    def _fastest_drifts(self) -> dict[str, float]:
        """By actuator the drift with which the smallest fault is found soonest."""
        one = self._calibration
        flights = one.flights_of(_TRIED * one.hours)
        delays: dict[str, dict[float, float]] = {name: {} for name in one.actuators}
        seed = self._seed
        for share in _SHARES:
            self._seed = seed  # the same flights for each
            drifts = {name: _rounded_up(share * fault) for name, fault in one.actuators.items()}
            largest = self._largest(f"drift {share:g} of the smallest fault", drifts, flights)
            for name, drift in drifts.items():
                delays[name][drift] = self._delay(name, drift, self._limit(name, drift, largest[name]))
        return {name: min(tried, key=lambda drift: (tried[drift], drift)) for name, tried in delays.items()}

    def _largest(self, what: str, drifts: Mapping[str, float], flights: int) -> dict[str, float]:
        """Fly a set, and return the largest sum of each actuator, in its unit times s."""
        one = self._calibration
        plan = one.with_drifts(drifts, flights, self._seed)
        self._seed += flights
        landed: list[Outcome] = []

        def land(outcomes: list[Outcome]) -> bool:
            landed.extend(outcomes)
            self._report(what, len(landed), flights)
            return False

        self._report(what, 0, flights)
        fly_all(plan, iter(range(flights)), self._engine, land, self._raise_if_interrupted)
        for outcome in landed:
            if not outcome.flew:
                raise StudyError(f"{one.name}: the flight of seed {plan.draws.seed_of(outcome.number)} failed: "
                                 f"{outcome.error}")  # fmt: skip
        whole = [outcome for outcome in landed if not outcome.lost]
        self._lost += len(landed) - len(whole)
        if not whole:
            raise StudyError(f"{one.name}: in every healthy flight an aircraft was lost, first: {landed[0].error}")
        return {
            name: max(_number(outcome.values[place]) for outcome in whole) * _NEVER * fault
            for place, (name, fault) in enumerate(one.actuators.items())
        }


def _number(value: Any) -> float:
    """The value of a claim about all followers.

    Raises
    ------
    StudyError
        If the flight has none.
    """
    if not isinstance(value, float) or not math.isfinite(value):
        raise StudyError(f"a healthy flight has no sum of the test: {value}")
    return value


def _rounded_up(value: float) -> float:
    """Three digits, as a file shows them."""
    if value == 0.0:
        return 0.0
    digit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return float(f"{math.ceil(value / digit - 1e-9) * digit:.4g}")
