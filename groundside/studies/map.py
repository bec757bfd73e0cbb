"""A map: where over two settings a claim holds, and what theory says of the same settings."""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.scenario import ScenarioError, resolve, trims_under_faults
from ftcc.groundside.studies.errors import StudyError
from ftcc.groundside.studies.folder import load_plan
from ftcc.groundside.studies.measures import Measure, measures_of, titles_of
from ftcc.groundside.studies.plan import StudyPlan, Variation
from ftcc.groundside.studies.planning import plan_study
from ftcc.groundside.studies.results import Study

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = ["END", "Curve", "Map", "axis_of", "check_claim", "plan_map"]

END = "tracking error at the end"
"""The question of a map without a claim: the verdict's tracking errors against what the verdict allows."""
_FINE = 200
"""Points along each axis of a curve that needs no flight plan per point."""
_MOST_CELLS = 100_000
_FAULT = re.compile(r"faults\.(\d+)\.(.+)")
_VALUE = re.compile(r" = [-+\d.e]+( [^:,]+)?:")
"""The value of one cell in the text of a check."""
_NUMBER = re.compile(r"[-+]?\d[\d.]*(?:e[-+]?\d+)?")

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Curve:
    """A boundary that theory draws: ``height`` over ``x`` and ``y`` is 0 there, and positive where theory agrees."""

    label: str
    x: Array
    y: Array
    height: Array
    """Array (len(y), len(x))."""
    trim: bool
    """Whether it is the boundary of level trim; else a condition that the scenario's checks state."""


def axis_of(text: str, option: str) -> Variation:
    """Read ``KEY=low:high:count``.

    Raises
    ------
    StudyError
    """
    key, equals, given = (part.strip() for part in text.partition("="))
    wrong = StudyError(f"{option} {text}: must be KEY=low:high:count, such as faults.0.effectiveness=0.1:1:40")
    parts = given.split(":")
    if not equals or not key or len(parts) != 3:
        raise wrong
    try:
        low, high, count = float(parts[0]), float(parts[1]), int(parts[2])
    except ValueError:
        raise wrong from None
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise StudyError(f"{option} {text}: low must be less than high, both finite")
    if count < 2:
        raise StudyError(f"{option} {text}: count must be at least 2")
    # Decimal, so that the file of the study and the axis show 0.3, not 0.30000000000000004.
    return Variation(key, tuple(float(f"{value:.12g}") for value in np.linspace(low, high, count)))


def plan_map(
    name: str | Path, x: Variation, y: Variation, *, settings: Sequence[str] = (), **options: Any
) -> tuple[StudyPlan, tuple[int, ...]]:
    """Plan the flights of a map; return the study, and the faults that fly without a level trim because axes vary them.

    Raises
    ------
    StudyError, ScenarioError
    """
    if x.key == y.key:
        raise StudyError(f"--x and --y: both vary {x.key}; a map needs two keys")
    if (cells := len(x.values) * len(y.values)) > _MOST_CELLS:
        raise StudyError(f"--x and --y: {cells} cells; at most {_MOST_CELLS} fly")
    faults = tuple(sorted({int(found[1]) for axis in (x, y) if (found := _FAULT.fullmatch(axis.key))}))
    flown = [*settings, *(f"faults.{n}.without_trim=true" for n in faults)]
    plan = plan_study(name, {x.key: x.values, y.key: y.values}, settings=flown, **options)
    return plan, faults


def check_claim(plan: StudyPlan, claim: str | None) -> None:
    """Refuse a claim that the flights do not have, or whose window they do not reach.

    Raises
    ------
    StudyError
    """
    titles = titles_of(plan.claims)
    if claim is None:
        if not plan.mission.scheme.tracking:
            raise StudyError(f"--claim: needed, as scheme {plan.mission.scheme.name} declares no tracking error")
        return
    if claim not in titles:
        there_are = f"there are {', '.join(titles)}" if titles else "this case has none"
        raise StudyError(f"--claim: there is no claim {claim!r} in this case; {there_are}")
    begin, end = plan.claims[titles.index(claim)].window
    if end > plan.mission.timing.duration:
        raise StudyError(
            f"--claim {claim!r}: its window, {begin:g} to {end:g} s, ends after the flight, "
            f"at {plan.mission.timing.duration:g} s; fly longer"
        )


class Map:
    """A study of two keys as a map. Grids are arrays (values of y, values of x)."""

    def __init__(self, folder: str | Path, claim: str | None = None) -> None:
        """Read the map of a claim, or of the tracking error at the end, from a study's folder.

        Raises
        ------
        StudyError
            If the folder holds no study of two varied keys with numbers.
        """
        self.plan = load_plan(folder, same_version=False)
        self.claim = claim
        if len(self.plan.documents) > 1 or [len(self.plan.varied), self.plan.draws.count] != [2, 1]:
            raise StudyError(f"{folder}: no map: needs one flight for each combination of two varied keys")
        x, y = self.plan.varied
        self.x, self.y = x, y
        self._table: pa.Table = Study(folder).table

    @property
    def question(self) -> str:
        """Return what the margin is of."""
        return self.claim or END

    @functools.cached_property
    def margins(self) -> Array:
        """Return the margin: >= 0: it holds; -inf: an aircraft was lost; nan: refused, not flown, or no number."""
        values = np.full(self.plan.count, np.nan)
        rows = self._table.to_pylist()
        measures = [one for one in measures_of(self.plan) if one.title == self.claim]
        for row in rows:
            values[row["flight"]] = self._margin(row, measures)
        return self._grid(values)

    @functools.cached_property
    def refused(self) -> NDArray[np.bool_]:
        """Return where the checks of scenarios found that it cannot fly."""
        values = np.zeros(self.plan.count)
        for number, refused in zip(*(self._table.column(n).to_pylist() for n in ("flight", "refused")), strict=True):
            values[number] = refused
        return np.equal(self._grid(values), 1.0)

    def _grid(self, values: Array) -> Array:
        return values.reshape(len(self.x.values), len(self.y.values)).T

    def _margin(self, row: dict[str, Any], measures: Sequence[Measure]) -> float:
        if row["verdict"] is None:
            return math.nan
        if row["lost"]:
            return -math.inf
        if self.claim is None:
            return math.nan if row["end margin"] is None else float(row["end margin"])
        found = [row[one.name] for one in measures]
        if any(value is None for value in found):
            # An event that a claim times did not occur, or there is nothing to say.
            return -math.inf if row[f"{self.claim} holds"] is False else math.nan
        return min(one.margin(value) for one, value in zip(measures, found, strict=True))

    @functools.cached_property
    def curves(self) -> list[Curve]:
        """Return the boundaries that theory draws."""
        return [*self._trims(), *self._conditions()]

    @functools.cached_property
    def trimmed(self) -> NDArray[np.bool_] | None:
        """Return the cells in which all varied faults leave a level trim; None if the axes vary no such fault."""
        found = [self._trim_heights(n, np.array(self.x.values), np.array(self.y.values)) for n in self._faults()]
        known = [height for height in found if height is not None]
        return np.all([height > 0.0 for height in known], axis=0) if known else None

    def _faults(self) -> list[int]:
        """Return the numbers of the faults that the axes vary."""
        return sorted({int(found[1]) for axis in (self.x, self.y) if (found := _FAULT.fullmatch(axis.key))})

    def _trims(self) -> list[Curve]:
        curves = []
        for n in self._faults():
            x, y = np.array(self.x.values), np.array(self.y.values)
            if self._alone(n):
                x, y = (np.linspace(values[0], values[-1], _FINE) for values in (x, y))
            height = self._trim_heights(n, x, y)
            if height is not None:
                actuator = self.plan.documents[0][1]["faults"][n]["actuator"]
                text = f"level trim ends: |({actuator} of trim - bias) / effectiveness| = travel"
                curves.append(Curve(f"{text} (faults.{n})" if len(self._faults()) > 1 else text, x, y, height, True))
        return curves

    def _alone(self, n: int) -> bool:
        """Return whether only effectiveness and bias of fault ``n`` vary, so that all cells ask the same of it."""
        return {self.x.key, self.y.key} == {f"faults.{n}.effectiveness", f"faults.{n}.bias"}

    def _trim_heights(self, n: int, x: Array, y: Array) -> Array | None:
        """Return the smallest margin of the command of level trim, see ``TrimDemand.margin``; None if there is none."""
        height = np.full((len(y), len(x)), np.nan)
        same = None
        for column, one in enumerate(x):
            for row, other in enumerate(y):
                try:
                    scenario = self.plan.scenario(0, (), self.plan.draws.seed) if same else self._scenario(one, other)
                    demands = same or trims_under_faults(scenario)[n]
                except (ScenarioError, KeyError):
                    continue
                if self._alone(n):
                    same = demands
                size = {self.x.key: one, self.y.key: other}
                fault = scenario.plan.faults[n]
                left = 0.0 if fault.kind == "off" else size.get(f"faults.{n}.effectiveness", fault.effectiveness)
                bias = size.get(f"faults.{n}.bias", fault.bias)
                height[row, column] = min((one.margin(left, bias) for one in demands), default=np.nan)
        return None if np.isnan(height).all() else height

    def _scenario(self, x: float, y: float) -> Any:
        combination = self.plan.combinations.index((x, y))
        return self.plan.scenario(combination, (), self.plan.draws.seed)

    def _conditions(self) -> list[Curve]:
        """Return what the scenario's checks state in some cells and not in others, except about faults."""
        where: dict[str, list[int]] = {}
        words: dict[str, str] = {}
        for n in range(self.plan.count):
            try:
                texts: Sequence[str] = resolve(self.plan.scenario(n, (), self.plan.draws.seed)).warnings
            except ScenarioError as error:
                texts = error.problems
            for text in texts:
                kind = _NUMBER.sub("#", text)
                if "faults." not in text:
                    words.setdefault(kind, text)
                    where.setdefault(kind, []).append(n)
        curves = []
        for kind, cells in where.items():
            if len(cells) < self.plan.count:
                violated = np.zeros(self.plan.count)
                violated[cells] = 1.0
                height = 0.5 - self._grid(violated)
                x, y = np.array(self.x.values), np.array(self.y.values)
                curves.append(Curve(f"check: {_VALUE.sub(':', words[kind])}", x, y, height, False))
        return curves

    def sentences(self) -> list[str]:
        """Return the map in words."""
        holds, known = self.margins >= 0.0, ~np.isnan(self.margins)
        lost = np.isneginf(self.margins)
        count = int(known.sum())
        share = f" ({100.0 * holds.sum() / count:.1f} %)" if count else ""
        lines = [f"{self.question}: holds in {holds.sum()} of {count} cells{share}"]
        if lost.any():
            lines.append(f"{int(lost.sum())} cells lost an aircraft, or never reached what the claim times")
        if (absent := self.plan.count - count) > 0:
            refused = int(self.refused.sum())
            lines.append(f"{refused} cells were refused by the checks, {absent - refused} gave no number")
        if self.trimmed is not None:
            beyond = int((holds & ~self.trimmed).sum())
            within = int((known & ~holds & self.trimmed).sum())
            lines.append(
                f"level trim: {int(self.trimmed.sum())} cells have one; it holds in {beyond} cells beyond the trim "
                f"boundary, and fails in {within} within it"
            )
        lines += [f"{int((one.height < 0.0).sum())} cells: {one.label}" for one in self.curves if not one.trim]
        return lines
