"""What a study flies: every combination of the varied values, with every seed; checked before anything starts."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomli_w

from ftcc.groundside.errors import UserError
from ftcc.groundside.mission import Mission, resolve
from ftcc.groundside.scenario import Scenario, ScenarioError, load

__all__ = ["Combination", "Study", "StudyError", "Trial", "Variation", "plan_study"]


class StudyError(UserError):
    """A study that cannot begin."""


@dataclass(frozen=True)
class Variation:
    """A key of the scenario and the values that it takes."""

    key: str
    values: tuple[Any, ...]


@dataclass(frozen=True)
class Combination:
    """One value of every variation."""

    values: tuple[Any, ...]
    """In the order of the study's variations."""
    in_case: bool
    """Whether this is the scenario's case itself, for which its claims give expected values."""
    problem: str
    """Why it cannot fly; empty if it can."""


@dataclass(frozen=True)
class Trial:
    """One flight of a study."""

    number: int
    """From 0."""
    combination: int
    """Index into the study's combinations."""
    seed: int


@dataclass(frozen=True)
class Study:
    """A scenario, and what is varied in it."""

    name: str | Path
    form: str | None
    variants: tuple[str, ...]
    settings: tuple[str, ...]
    duration: float | None
    variations: tuple[Variation, ...]
    seeds: tuple[int, ...]
    """Of every combination, so that combinations are compared in the same weather."""
    combinations: tuple[Combination, ...]

    @property
    def mission(self) -> Mission:
        """That of the first combination that can fly; what all share is read from it."""
        first = next(c for c in self.combinations if not c.problem)
        return resolve(self._load(first.values, self.seeds[0]))

    @property
    def trials(self) -> list[Trial]:
        """All flights, in order."""
        pairs = itertools.product(range(len(self.combinations)), self.seeds)
        return [Trial(number, combination, seed) for number, (combination, seed) in enumerate(pairs)]

    def scenario(self, trial: Trial) -> Scenario:
        """The scenario of one flight."""
        return self._load(self.combinations[trial.combination].values, trial.seed)

    def _load(self, values: Sequence[Any], seed: int) -> Scenario:
        varied = [f"{v.key}={_toml(value)}" for v, value in zip(self.variations, values, strict=True)]
        settings = [*self.settings, *varied]
        return load(
            self.name, form=self.form, variants=self.variants, settings=settings, seed=seed, duration=self.duration
        )

    def _planned(self) -> Study:
        """The study with all combinations, each loaded and, but for problems that it then tells, resolved."""
        published = load(self.name, form=self.form, variants=self.variants)
        # A run that was flown with settings of its own is no case of its scenario any more.
        case = None
        if not (published.plan.flown and published.plan.flown.settings):
            with contextlib.suppress(ScenarioError):
                case = _essence(resolve(published))
        combinations = []
        for values in itertools.product(*(variation.values for variation in self.variations)):
            chosen = self._load(values, self.seeds[0])
            try:
                combinations.append(Combination(values, _essence(resolve(chosen)) == case, ""))
            except ScenarioError as error:
                combinations.append(Combination(values, False, "; ".join(error.problems)))
        return dataclasses.replace(self, combinations=tuple(combinations))


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
        ``key.path=value,value,...``, values as in TOML; the study flies every combination.
    seeds : int
        Flights of each combination, with seeds that count up from ``seed``.
    seed : int, optional
        The first; default: the scenario's.

    Raises
    ------
    StudyError
        For a ``vary`` that is none, or a study of which no combination can fly.
    ScenarioError
        For a scenario that cannot fly as it stands, or a value that the scenario's format does not allow.
    """
    if seeds < 1:
        raise StudyError(f"--seeds {seeds}: must be at least 1")
    variations = tuple(_variation(text) for text in vary)
    keys = [variation.key for variation in variations]
    for key in keys:
        if keys.count(key) > 1:
            raise StudyError(f"--vary {key}: is varied twice; give all its values at once")
        if key == "seed":
            raise StudyError("--vary seed: every combination flies with every seed; use --seeds and --seed")
    first = load(name, form=form, variants=variants, settings=settings, seed=seed, duration=duration).plan.seed
    study = Study(
        name, form, tuple(variants), tuple(settings), duration, variations, tuple(range(first, first + seeds)), ()
    )._planned()
    if all(combination.problem for combination in study.combinations):
        problems = dict.fromkeys(combination.problem for combination in study.combinations)
        raise StudyError("no combination can fly:\n" + "\n".join(problems))
    return study


def _essence(mission: Mission) -> tuple[Any, ...]:
    """What makes a flight, but for its length and its chance."""
    timing = dataclasses.replace(mission.timing, ticks=0, seed=0)
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
        values = [_plain(part.strip()) for part in given.split(",")]
    if "" in values:
        raise StudyError(f"--vary {text}: a value is missing between two commas")
    if any(values.count(value) > 1 for value in values):
        raise StudyError(f"--vary {text}: a value stands there twice")
    return Variation(key, tuple(values))


def _plain(text: str) -> float | str:
    """What TOML would not take: numbers such as .1, and words without quotes."""
    try:
        return float(text)
    except ValueError:
        return text
