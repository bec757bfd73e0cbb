"""Plan a study: every combination of the varied values, with every seed, checked before anything starts."""

from __future__ import annotations

import functools
import itertools
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomli_w

from ftcc.groundside.errors import UserError
from ftcc.groundside.scenario import Mission, Scenario, ScenarioError, load, resolve

__all__ = ["Combination", "Study", "StudyError", "Trial", "Variation", "plan_study"]


class StudyError(UserError):
    """A study that cannot start."""


@dataclass(frozen=True)
class Variation:
    """A key of the scenario and its values."""

    key: str
    values: tuple[Any, ...]


@dataclass(frozen=True)
class Combination:
    """One value of every variation."""

    values: tuple[Any, ...]
    """Values in the order of the study's variations."""
    mission: Mission | None
    """Mission with the first seed; None if it cannot fly."""
    in_case: bool
    """Whether this is the scenario's own case, for which its claims give expected values."""
    problem: str = ""
    """Why it cannot fly; empty if it can."""


@dataclass(frozen=True)
class Trial:
    """One flight of a study."""

    number: int
    """Number of the flight, from 0."""
    combination: int
    """Index into the study's combinations."""
    seed: int


@dataclass(frozen=True)
class Study:
    """A scenario and its variations; everything is read and checked before the first flight."""

    settings: tuple[str, ...]
    """Settings of all flights."""
    variations: tuple[Variation, ...]
    combinations: tuple[Combination, ...]
    seeds: tuple[int, ...]
    """Seeds of every combination, so that all combinations are compared under the same disturbances."""

    @property
    def trials(self) -> list[Trial]:
        """Return all flights, in order."""
        pairs = itertools.product(range(len(self.combinations)), self.seeds)
        return [Trial(number, combination, seed) for number, (combination, seed) in enumerate(pairs)]

    @property
    def mission(self) -> Mission:
        """Return the mission of the first combination that can fly, for properties that all share."""
        return next(c.mission for c in self.combinations if c.mission is not None)

    def mission_of(self, trial: Trial) -> Mission | None:
        """Return the mission of one flight; None if it cannot fly."""
        mission = self.combinations[trial.combination].mission
        return None if mission is None else mission.with_seed(trial.seed)


def plan_study(
    name: str | Path,
    vary: Sequence[str] = (),
    *,
    seeds: int = 1,
    form: str | None = None,
    variants: Sequence[str] = (),
    settings: Sequence[str] = (),
    seed: int | None = None,
    duration: float | None = None,
) -> Study:
    """Plan a study.

    Parameters
    ----------
    name : str
        A scenario, see `scenario.load`, as are ``form``, ``variants``, ``settings`` and ``duration``.
    vary : sequence of str
        ``key.path=value,value,...`` with values as in TOML; the study flies every combination.
    seeds : int
        Number of flights of each combination, with consecutive seeds from ``seed``.
    seed : int, optional
        First seed; default: that of the scenario.

    Raises
    ------
    StudyError
        For an invalid ``vary``, or if no combination can fly.
    ScenarioError
        If the unchanged scenario cannot fly, or a value is invalid in the format of scenarios.
    """
    if seeds < 1:
        raise StudyError(f"--seeds {seeds}: must be at least 1")
    variations = tuple(_variation(text) for text in vary)
    keys = [variation.key for variation in variations]
    for key in keys:
        if keys.count(key) > 1:
            raise StudyError(f"--vary {key}: given twice; give all values in one --vary")
        if key == "seed":
            raise StudyError("--vary seed: every combination flies with every seed; use --seeds and --seed")
    load_variant = functools.partial(load, name, form=form, variants=variants)
    first = load_variant(settings=settings, seed=seed, duration=duration)
    case = _conditions_of_case(load_variant())
    combinations = []
    for values in itertools.product(*(variation.values for variation in variations)):
        varied = [f"{key}={_toml(value)}" for key, value in zip(keys, values, strict=True)]
        scenario = load_variant(settings=[*settings, *varied], seed=first.plan.seed, duration=duration)
        try:
            mission = resolve(scenario)
            combinations.append(Combination(values, mission, _conditions_of(mission) == case))
        except ScenarioError as error:
            combinations.append(Combination(values, None, False, "; ".join(error.problems)))
    if all(combination.problem for combination in combinations):
        problems = dict.fromkeys(combination.problem for combination in combinations)
        raise StudyError("no combination can fly:\n" + "\n".join(problems))
    return Study(
        first.settings, variations, tuple(combinations), tuple(range(first.plan.seed, first.plan.seed + seeds))
    )


def _conditions_of_case(published: Scenario) -> tuple[Any, ...] | None:
    """Return the conditions of the scenario's own case, to which its claims refer; None if it cannot fly."""
    if published.plan.flown and published.plan.flown.settings:
        return None  # a recorded run with changed settings
    try:
        return _conditions_of(resolve(published))
    except ScenarioError:
        return None


def _conditions_of(mission: Mission) -> tuple[Any, ...]:
    """Return everything that determines a flight, except its duration and seed."""
    timing = mission.timing._replace(ticks=0, seed=0)
    return mission.scheme.name, mission.wire, timing, mission.graph.weights, mission.vehicles, mission.autopilots


def _toml(value: Any) -> str:
    return tomli_w.dumps({"value": value}).partition("=")[2].strip()


def _variation(text: str) -> Variation:
    key, equals, given = text.partition("=")
    key = key.strip()
    if not equals or not key or not given.strip():
        raise StudyError(f"--vary {text}: must be key.path=value,value,..., such as channel.loss=0,0.1,0.3")
    try:
        values = tomllib.loads(f"values = [{given}]")["values"]
    except tomllib.TOMLDecodeError:
        values = [_number_or_text(part.strip()) for part in given.split(",")]
    if "" in values:
        raise StudyError(f"--vary {text}: a value is missing between two commas")
    if any(values.count(value) > 1 for value in values):
        raise StudyError(f"--vary {text}: a value is listed twice")
    return Variation(key, tuple(values))


def _number_or_text(text: str) -> float | str:
    """Read a value that TOML refuses: a number such as .1, or a word without quotes."""
    try:
        return float(text)
    except ValueError:
        return text
