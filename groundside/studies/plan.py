"""The plan of a study: which values fly in which flight, and what each is asked."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ftcc.groundside.scenario import Mission, Scenario, ScenarioError, resolve, scenario_of, with_value
from ftcc.groundside.schema import Claim
from ftcc.groundside.studies.diagnosed import asked_of_diagnosis
from ftcc.groundside.studies.errors import StudyError
from ftcc.groundside.studies.quantities import Draws

__all__ = ["CASE", "StudyPlan", "Trial", "Variation"]

CASE = "case"
"""Key of the variation over the scenario's cases, form and variants."""
_ATTEMPTS = 200
"""Draws after which a study with ``redraw`` gives up on a flight."""
_TRIED, _SHOWN = 32, 10
"""Draws among which a flight is looked for that can fly, and reasons that are shown if none can."""


@dataclass(frozen=True)
class Variation:
    """A key of the scenario and its values."""

    key: str
    values: tuple[Any, ...]


@dataclass(frozen=True)
class Trial:
    """One flight of a study."""

    number: int
    """Number of the flight, from 0."""
    combination: int
    """Index into the study's combinations."""
    draw: int
    """Number of the draw, from 0; all combinations fly with each."""
    seed: int


@dataclass(frozen=True)
class StudyPlan:
    """A scenario, its variations and its draws: everything that determines the flights, without a file beside it."""

    name: str
    title: str
    question: str
    form: str
    variants: tuple[str, ...]
    settings: tuple[str, ...]
    """Settings of all flights."""
    documents: tuple[tuple[str, dict[str, Any]], ...]
    """Case and merged scenario; the first is compared with the others. Without claims."""
    varied: tuple[Variation, ...]
    """Every combination of the values, in each case."""
    draws: Draws
    redraw: bool
    claims: tuple[Claim, ...]
    """What every flight is asked; ``expected`` and ``tolerance`` in the first case."""
    published: dict[str, Any] | None = None
    """The scenario's own case, for which its claims give expected values; None: no flight is of that case."""
    files: tuple[tuple[str, str], ...] = ()
    """Name and text of the files to which the documents refer."""

    @functools.cached_property
    def variations(self) -> tuple[Variation, ...]:
        """Return what differs between combinations."""
        cases = tuple(case for case, _ in self.documents)
        return ((Variation(CASE, cases),) if len(cases) > 1 else ()) + self.varied

    @functools.cached_property
    def combinations(self) -> tuple[tuple[Any, ...], ...]:
        """Return the values of `variations` in each combination."""
        return tuple(itertools.product(*(variation.values for variation in self.variations)))

    @functools.cached_property
    def asked(self) -> tuple[Claim, ...]:
        """Return `claims`, then what diagnosis on board is asked if some flights have it."""
        on = any(document.get("diagnosis", {}).get("on") for _, document in self.documents)
        keys = [*(one.key for one in self.varied), *(one.key for one in self.draws.quantities)]
        if not on and "diagnosis.on" not in keys:
            return self.claims
        return (*self.claims, *asked_of_diagnosis(self.case, self.mission.timing.duration))

    @property
    def case(self) -> str:
        """Return form and variants of the first combination."""
        return self.documents[0][0]

    @property
    def count(self) -> int:
        """Return the number of flights."""
        return self.draws.count * len(self.combinations)

    @functools.cached_property
    def flyable(self) -> tuple[int, tuple[Any, ...]]:
        """Return a combination, and values of the random quantities, that can fly: the medians, or else a draw's.

        Raises
        ------
        StudyError
            If there is none among the first draws.
        """
        problems: list[str] = []
        first = range(min(self.draws.count, _TRIED) if self.draws.quantities else 0)
        for values in itertools.chain([self.draws.middle()], map(self.draws.values, first)):
            for n in range(len(self.combinations)):
                try:
                    self._resolved(n, values, self.draws.seed)
                except ScenarioError as error:
                    problems += error.problems
                else:
                    return n, values
        raise StudyError("no combination can fly:\n" + "\n".join(list(dict.fromkeys(problems))[:_SHOWN]))

    @functools.cached_property
    def mission(self) -> Mission:
        """Return the mission of `flyable`, for properties that all flights share."""
        return self._resolved(*self.flyable, self.draws.seed)

    def is_own_case(self, mission: Mission) -> bool:
        """Return whether a mission is the scenario's own case, but for its seed and duration."""
        return self._published is not None and _conditions_of(mission) == self._published

    @functools.cached_property
    def _published(self) -> tuple[Any, ...] | None:
        if self.published is None:
            return None
        form, *variants = self.case.split("+")
        file = _folder(self.files) / "study.toml"
        try:
            return _conditions_of(
                resolve(scenario_of(self.published, file, name=self.name, form=form, variants=variants))
            )
        except ScenarioError:
            return None

    def trial(self, number: int) -> Trial:
        """Return flight ``number``: all combinations of draw 0, then of draw 1, ..."""
        draw, combination = divmod(number, len(self.combinations))
        return Trial(number, combination, draw, self.draws.seed_of(draw))

    def drawn(self, trial: Trial) -> tuple[tuple[Any, ...], Mission | None, str]:
        """Return the values of the random quantities, and the mission; if it cannot fly, None and the reason.

        With ``redraw``, they are the first values with which all combinations can fly.
        """
        problem = ""
        values = self.draws.values(trial.draw)
        for attempt in range(_ATTEMPTS if self.redraw else 1):
            values = self.draws.values(trial.draw, attempt)
            try:
                mission = self._resolved(trial.combination, values, trial.seed)
                if self.redraw:
                    for n in range(len(self.combinations)):
                        self._resolved(n, values, trial.seed)
                return values, mission, ""
            except ScenarioError as error:
                problem = "; ".join(error.problems)
        return values, None, problem

    def scenario(
        self, combination: int, values: Sequence[Any], seed: int, claims: Sequence[dict[str, Any]] = ()
    ) -> Scenario:
        """Return the scenario of a combination with these values of the random quantities.

        Raises
        ------
        ScenarioError
        """
        case = self.case_of(combination)
        document = dict(self.documents)[case]
        form, *variants = case.split("+")
        for key, value in self._changes(combination, values):
            try:
                document = with_value(document, key.split("."), value)
            except LookupError as error:
                raise ScenarioError(self.name, [f"{key}: {error.args[0]}"]) from None
        document = {**document, "seed": seed, "claims": list(claims)}
        file = _folder(self.files) / "study.toml"
        return scenario_of(document, file, name=self.name, form=form, variants=variants)

    def case_of(self, combination: int) -> str:
        """Return form and variants of a combination."""
        return self.combinations[combination][0] if len(self.documents) > 1 else self.case

    def _changes(self, combination: int, values: Sequence[Any]) -> Iterable[tuple[str, Any]]:
        chosen = zip(self.variations, self.combinations[combination], strict=True)
        yield from ((variation.key, value) for variation, value in chosen if variation.key != CASE)
        yield from ((one.key, value) for one, value in zip(self.draws.quantities, values, strict=True))

    def _resolved(self, combination: int, values: Sequence[Any], seed: int) -> Mission:
        return resolve(self.scenario(combination, values, seed))


@functools.lru_cache(maxsize=4)
def _folder(files: tuple[tuple[str, str], ...]) -> Path:
    """Return a folder that holds these files until this process ends."""
    import atexit
    import shutil
    import tempfile

    if not files:
        return Path()
    folder = Path(tempfile.mkdtemp(prefix="ftcc-study-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    for name, text in files:
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def _conditions_of(mission: Mission) -> tuple[Any, ...]:
    """Return everything that determines a flight, except its duration and seed."""
    timing = mission.timing._replace(ticks=0, seed=0)
    vehicles = tuple(
        replace(spec, gust=spec.gust._replace(seed=0), turbulence=spec.turbulence._replace(seed=0))
        for spec in mission.vehicles
    )
    return mission.scheme.name, mission.wire, timing, mission.graph.weights, vehicles, mission.autopilots
