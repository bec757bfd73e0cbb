"""Search for the mildest disturbance that makes a claim fail: plan, loop, refinement.

Generations have a fixed size, fly in any order, and are told to Optuna in their order: the same flights on any engine.
The mildest flight that failed is then brought back towards the scenario's own values, until the boundary is met.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ftcc.groundside.scenario import resolve
from ftcc.groundside.studies.distance import distance, own_value, place_of, values_at
from ftcc.groundside.studies.errors import StudyError
from ftcc.groundside.studies.flying import Outcome
from ftcc.groundside.studies.given import GivenDraws
from ftcc.groundside.studies.measures import measures_of, titles_of
from ftcc.groundside.studies.plan import StudyPlan
from ftcc.groundside.studies.planning import plan_study
from ftcc.groundside.studies.quantities import RandomQuantity, quantity_of
from ftcc.groundside.studies.search_sampler import GENERATION, Sampler, optuna_for
from ftcc.groundside.verdict import FAILED

__all__ = [
    "GENERATION",
    "METHODS",
    "NOBODY_LOST",
    "VERDICT",
    "Flown",
    "SearchPlan",
    "flights_of",
    "plan_search",
    "toml_of",
]

METHODS = ("cmaes", "tpe")
VERDICT = "verdict is not failed"
"""What is held against a flight where no claim is named."""
NOBODY_LOST = "nobody lost"
_REPELLED = 1e7
"""Objective of a flight that cannot be judged, to which its distance is added: worse than any that can."""
_LARGEST_MARGIN = 1e6
_SECTIONS = 12
"""Flights of a round of the refinement."""
_ROUNDS = 6
_CLOSE = 0.01
"""To which share of its distance the boundary is met."""
_EDGES = (0.001, 0.999)


@dataclass(frozen=True)
class Flown:
    """One flight of a search, and what it says."""

    number: int
    stage: str
    """own: the scenario's own values; search: asked for by the sampler; line: between its worst flight and them."""
    point: tuple[float, ...]
    """What was asked for, in the unit cube of the distribution functions."""
    values: tuple[Any, ...]
    distance: float
    """From the scenario's own values, see `distance.distance`."""
    margin: float | None
    """Of the claim; None: it has no value."""
    fails: bool | None
    """None: it cannot be said, since it was refused or broke off with an error."""
    objective: float
    outcome: Outcome


@dataclass(frozen=True)
class SearchPlan:
    """What is searched, and where: everything that determines the flights."""

    study: StudyPlan
    """Its draws hold no flight yet."""
    goal: str
    """Name of a claim, `NOBODY_LOST` or `VERDICT`."""
    stated: tuple[bool, ...]
    """Whether the scenario has an own value of each quantity; False: its median stands for it."""
    budget: int
    method: str

    @property
    def draws(self) -> GivenDraws:
        """Return the quantities and their own values."""
        assert isinstance(self.study.draws, GivenDraws)
        return self.study.draws

    @property
    def quantities(self) -> tuple[RandomQuantity, ...]:
        """Return what the search may change."""
        return self.draws.quantities

    @functools.cached_property
    def own_point(self) -> tuple[float, ...]:
        """Return the place of each own value in its distribution, 0 to 1."""
        return self.places(self.draws.own)

    def places(self, values: Sequence[Any]) -> tuple[float, ...]:
        """Return the place of each value in its distribution, 0 to 1."""
        pairs = zip(self.quantities, values, strict=True)
        return tuple(place_of(one.distribution, value) for one, value in pairs)

    def judge(self, stage: str, point: Sequence[float], values: Sequence[Any], outcome: Outcome) -> Flown:
        """Return what a flight says.

        The objective is its distance if it fails, and 1 + sqrt(n) + margin if it does not: first the margin falls, then
        the distance. A flight that cannot be judged has a value above all others, which falls with its distance.
        """
        away = distance(self.quantities, values, self.draws.own)
        margin, fails = self._margin_and_failure(outcome)
        if fails is None:
            objective = _REPELLED + away
        elif fails:
            objective = away
        else:
            objective = 1.0 + math.sqrt(len(self.quantities)) + min(max(margin or 0.0, 0.0), _LARGEST_MARGIN)
        return Flown(outcome.number, stage, tuple(point), tuple(values), away, margin, fails, objective, outcome)

    def _margin_and_failure(self, outcome: Outcome) -> tuple[float | None, bool | None]:
        if outcome.refused or not outcome.flew:
            return None, None
        lost, end = bool(outcome.lost), outcome.end_margin
        if self.goal == VERDICT:
            return end, outcome.verdict == FAILED
        if self.goal == NOBODY_LOST:  # nothing says how nearly one was lost; the error at the end leads there
            return None if lost or end is None else 1.0 / (2.0 - min(end, 1.0)), lost
        place = titles_of(self.study.claims).index(self.goal)
        if not lost and outcome.values[place] is None and outcome.holds[place] is None:
            return None, None
        margin = min(one.margin(one.of(outcome.values)) for one in self._measures)
        return (margin if math.isfinite(margin) else None), lost or margin < 0.0

    @functools.cached_property
    def _measures(self) -> list[Any]:
        return [one for one in measures_of(self.study) if one.title == self.goal]


def plan_search(
    name: str | Path,
    over: Sequence[str] = (),
    *,
    claim: str | None = None,
    budget: int = 300,
    method: str | None = None,
    **options: Any,
) -> SearchPlan:
    """Plan a search.

    Parameters
    ----------
    name, options
        See `plan_study`: form, variants, settings, seed, duration.
    over : sequence of str
        ``key.path=distribution(...)``; default: the random quantities that the scenario's [study] declares.
    claim : str, optional
        Name of a claim, or "nobody lost"; default: the verdict must not be "failed".
    budget : int
        Number of flights before the refinement.
    method : str, optional
        "cmaes" or "tpe"; default: CMA-ES, for a single quantity TPE.

    Raises
    ------
    StudyError, DistributionError
        For an invalid search.
    ScenarioError
        If the unchanged scenario cannot fly, or a value is invalid in the format of scenarios.
    """
    if budget < 1:
        raise StudyError(f"--budget {budget}: must be at least 1")
    if method not in (None, *METHODS):
        raise StudyError(f"--method {method}: must be {' or '.join(METHODS)}")
    given = tuple(quantity_of(text, "--over") for text in over)
    # What is given replaces the scenario's [study], as in a study.
    declared = plan_study(name, seeds=1, **options) if given else plan_study(name, **options)
    quantities = given or declared.draws.quantities
    _check_keys(quantities)
    if method == "cmaes" and len(quantities) == 1:
        raise StudyError("--method cmaes: needs two quantities or more; give another --over, or take --method tpe")
    goal, claims = _goal(name, claim, declared, options)
    own, stated = _own_values(declared, quantities)
    study = replace(
        declared,
        documents=declared.documents[:1],
        varied=(),
        draws=GivenDraws(quantities, "given", 0, declared.draws.seed, own=own),
        redraw=False,
        claims=claims,
        published=None,
    )
    for place in range(len(quantities)):
        for edge in _EDGES:
            (value,) = values_at(quantities[place : place + 1], [edge])
            study.scenario(0, (*own[:place], value, *own[place + 1 :]), study.draws.seed)
    chosen = method or ("tpe" if len(quantities) == 1 else "cmaes")
    optuna_for(chosen)
    return SearchPlan(study, goal, stated, budget, chosen)


def _check_keys(quantities: Sequence[RandomQuantity]) -> None:
    if not quantities:
        raise StudyError(
            "--over: is missing: what may the search change? such as --over 'channel.loss=uniform(low=0, high=0.6)'"
        )
    keys = [one.key for one in quantities]
    for key in keys:
        if keys.count(key) > 1:
            raise StudyError(f"--over {key}: given twice")
        if key == "seed":
            raise StudyError("--over seed: all flights have the seed of --seed; a seed has no distance")


def _goal(name: str | Path, claim: str | None, declared: StudyPlan, options: dict[str, Any]) -> tuple[str, Any]:
    """Return what is asked, and the claims of all flights: those of the study, or of the scenario's case."""
    if claim is None or claim in (VERDICT, NOBODY_LOST):
        return claim or VERDICT, declared.claims
    claims = declared.claims
    if claim not in titles_of(claims):  # of the scenario's case, or of its [study]
        others = (plan_study(name, seeds=1, **options), plan_study(name, **options))
        claims = next((one.claims for one in others if claim in titles_of(one.claims)), others[0].claims)
    titles = titles_of(claims)
    if claim not in titles:
        there_are = ", ".join(dict.fromkeys([*titles_of(declared.claims), *titles, NOBODY_LOST]))
        raise StudyError(f"--claim: there is no claim {claim!r} in this case; there are: {there_are}")
    window, duration = claims[titles.index(claim)].window, declared.mission.timing.duration
    if window[1] > duration + 1e-6:
        raise StudyError(
            f"--claim: {claim!r} is about {window[0]:g} to {window[1]:g} s; the flights end at {duration:g} s"
        )
    return claim, claims


def _own_values(declared: StudyPlan, quantities: Sequence[RandomQuantity]) -> tuple[tuple[Any, ...], tuple[bool, ...]]:
    """Return the scenario's own value of each quantity, from its file, its gains or the format's defaults."""
    import tomllib

    draws = replace(
        declared, varied=(), documents=declared.documents[:1], draws=GivenDraws((), "given", 0, declared.draws.seed)
    )
    scenario = draws.scenario(0, (), declared.draws.seed)
    places = [tomllib.loads(resolve(scenario).toml), scenario.plan.model_dump(by_alias=True, mode="json")]
    found = []
    for one in quantities:
        own = [own_value(place, one) for place in places]
        found.append(next((pair for pair in own if pair[1]), own[0]))
    return tuple(value for value, _ in found), tuple(stated for _, stated in found)


Fly = Callable[[int, str, Sequence[tuple[float, ...]], Sequence[tuple[Any, ...]]], list[Flown]]
"""Number of the first flight, stage, points and values: returns the flights in their order."""


def flights_of(search: SearchPlan, fly: Fly) -> tuple[list[Flown], float | None]:
    """Fly a whole search; return all flights, and the width of the last bracket on the line, as a distance.

    Raises
    ------
    StudyError
        If the scenario's own flight cannot be judged.
    """
    flights = fly(0, "own", [search.own_point], [search.draws.own])
    if flights[0].fails is None:
        why = flights[0].outcome.error or "the claim has no value"
        raise StudyError(f"the scenario's own flight cannot be judged: {why}")
    if flights[0].fails:
        return flights, None
    sampler = Sampler(search.method, search.own_point, search.draws.seed, flights[0].objective)
    while len(flights) < search.budget:
        points = sampler.ask(min(GENERATION, search.budget - len(flights)))
        generation = fly(len(flights), "search", points, [values_at(search.quantities, point) for point in points])
        sampler.tell([one.objective for one in generation])
        flights += generation
    failing = [one for one in flights if one.fails]
    if not failing:
        return flights, None
    return _refined(search, flights, min(failing, key=lambda one: (one.distance, one.number)), fly)


def _refined(search: SearchPlan, flights: list[Flown], worst: Flown, fly: Fly) -> tuple[list[Flown], float]:
    """Fly points between the scenario's own values and the mildest failing flight, in sections of the last bracket."""
    own, far = search.own_point, search.places(worst.values)
    holds, fails = 0.0, 1.0
    known = {search.draws.own: flights[0], worst.values: worst}
    for _ in range(_ROUNDS):
        if fails - holds <= _CLOSE * fails:
            break
        shares = [holds + (fails - holds) * n / (_SECTIONS + 1) for n in range(1, _SECTIONS + 1)]
        points = [tuple(a + share * (b - a) for a, b in zip(own, far, strict=True)) for share in shares]
        rows = [_on_line(search, point, worst.values, share) for point, share in zip(points, shares, strict=True)]
        new = {row: point for row, point in zip(rows, points, strict=True) if row not in known}
        if not new:
            break
        landed = fly(len(flights), "line", list(new.values()), list(new))
        flights += landed
        known |= {one.values: one for one in landed}
        for share, row in zip(shares, rows, strict=True):
            if known[row].fails:
                fails = share
                break
            holds = share
    return flights, (fails - holds) * worst.distance


def _on_line(search: SearchPlan, point: Sequence[float], worst: Sequence[Any], share: float) -> tuple[Any, ...]:
    """Return the values at a point of the line; words, which have no order, are those of the worst flight."""
    there = values_at(search.quantities, point)
    triples = zip(search.quantities, there, worst, strict=True)
    return tuple(value if one.distribution.ordered else far for one, value, far in triples)


def toml_of(search: SearchPlan, flown: Flown) -> str:
    """Return a complete scenario file that repeats a flight, with the claims of the search.

    Raises
    ------
    ScenarioError
        If it cannot fly.
    """
    claims = [claim.model_dump(by_alias=True, exclude_none=True) for claim in search.study.claims]
    return resolve(search.study.scenario(0, flown.values, search.draws.seed, claims)).toml
