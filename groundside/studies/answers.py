"""The answers of a study: how often, how large, which difference, what matters."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.statistics import (
    Estimate,
    Index,
    Paired,
    Share,
    paired,
    quantile,
    share,
    sobol_indices_of,
)
from ftcc.groundside.studies.measures import Measure, measures_of, titles_of
from ftcc.groundside.studies.plan import CASE, StudyPlan
from ftcc.groundside.verdict import FAILED

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = ["HEADLINE", "NOBODY_LOST", "NOT_FAILED", "QUANTILES", "Answers", "Sensitivity", "label_of", "percent"]

HEADLINE = "all of it"
"""The answer that comes first: nobody was lost and every judged claim holds; without judged claims, the verdict."""
NOBODY_LOST = "nobody lost"
NOT_FAILED = "verdict is not failed"
QUANTILES = (0.05, 0.5, 0.95)

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Sensitivity:
    """Sobol' indices of a number, by random quantity."""

    name: str
    """A measure, or the title of a claim: then whether it holds, 0 or 1."""
    indices: dict[str, Index]
    used: int
    """Base samples that count: all their flights gave a number."""
    of: int


class Answers:
    """What the table of a study says. Arrays are by draw and combination; nan: no such flight, or nothing to say."""

    def __init__(self, plan: StudyPlan, table: pa.Table) -> None:
        self.plan = plan
        self.table = table
        self.labels = [label_of(plan, n) for n in range(len(plan.combinations))]
        numbers = table.column("flight").to_numpy()
        self.draw_of, self._combination = np.divmod(numbers, len(self.labels))
        self.draws = int(self.draw_of.max()) + 1 if len(numbers) else 0
        self.refused = self._column("refused") == 1.0
        """Flights that the checks refused."""
        self.flown = self._spread([word is not None for word in table.column("verdict").to_pylist()]) == 1.0
        """Flights that there are to judge."""

    def rows_of(self, combination: int) -> NDArray[np.intp]:
        """Return the places in the table of a combination's flights."""
        return np.flatnonzero(self._combination == combination)

    def _spread(self, values: Sequence[Any] | Array) -> Array:
        """Return a column by draw and combination."""
        spread = np.full((self.draws, len(self.labels)), np.nan)
        spread[self.draw_of, self._combination] = np.array([np.nan if one is None else one for one in values], float)
        return spread

    def _column(self, name: str) -> Array:
        return self._spread(self.table.column(name).to_pylist())

    @functools.cached_property
    def measures(self) -> list[Measure]:
        """Return the numbers that the claims measure."""
        return measures_of(self.plan)

    @functools.cached_property
    def titles(self) -> list[str]:
        """Return the questions that are answered with yes or no, the headline first."""
        claims = list(dict.fromkeys(measure.title for measure in self.measures))
        judged = [title for title in claims if np.isfinite(self._column(f"{title} holds")).any()]
        own = titles_of(self.plan.claims)
        in_headline = [title for title in judged if title in own]
        return [HEADLINE, *in_headline, NOBODY_LOST, NOT_FAILED, *(title for title in judged if title not in own)]

    def holds(self, title: str) -> Array:
        """Return 1 where the answer is yes, 0 where no."""
        if title == HEADLINE:
            judged = [self.holds(one) for one in self.titles[1 : self.titles.index(NOBODY_LOST)]]
            if not judged:
                return self.holds(NOT_FAILED)
            whole = np.where(self.refused | ~self._there, np.nan, np.minimum(self.holds(NOBODY_LOST), 1.0))
            for one in judged:
                whole = np.where(one == 0.0, 0.0, whole)
            return whole
        if title == NOBODY_LOST:
            lost = self._spread([len(one) for one in self.table.column("lost").to_pylist()])
            return self._of_begun(lost == 0.0)
        if title == NOT_FAILED:
            return self._of_begun(
                self._spread([one == FAILED for one in self.table.column("verdict").to_pylist()]) == 0.0
            )
        return self._column(f"{title} holds")

    def _of_begun(self, good: NDArray[np.bool_]) -> Array:
        """Return 1 or 0 for every flight that began; one that broke off with an error counts as 0."""
        return np.where(self.refused | ~self._there, np.nan, np.where(self.flown, good, 0.0))

    @functools.cached_property
    def _there(self) -> NDArray[np.bool_]:
        there = np.zeros((self.draws, len(self.labels)), bool)
        there[self.draw_of, self._combination] = True
        return there

    def share(self, title: str, combination: int) -> Share:
        """Return how often the answer is yes, with its exact 95 % interval."""
        known = self._known(self.holds(title), combination)
        return share(int(known.sum()), len(known))

    def values(self, measure: Measure) -> Array:
        """Return the number that a claim measures."""
        return self._column(measure.name)

    def quantiles(self, measure: Measure, combination: int) -> tuple[Estimate, ...] | None:
        """Return the 5 %, 50 % and 95 % quantiles, with intervals by order statistics; None without numbers."""
        known = self._known(self.values(measure), combination)
        return tuple(quantile(known, q) for q in QUANTILES) if len(known) else None

    def errors(self, refused: bool) -> list[str]:
        """Return why flights were refused by the checks, or else why they broke off, a text per flight."""
        columns = (self.table.column(name).to_pylist() for name in ("error", "verdict", "refused"))
        return [error or "" for error, word, no in zip(*columns, strict=True) if word is None and bool(no) == refused]

    def failed(self) -> list[int]:
        """Return the numbers of all flights in which not all holds."""
        draw, combination = np.nonzero(self.holds(HEADLINE) == 0.0)
        return [int(number) for number in draw * len(self.labels) + combination]

    def paired(self, title: str, combination: int) -> Paired:
        """Compare the first combination with another one, draw by draw."""
        both = self.holds(title)[:, [0, combination]]
        both = both[np.isfinite(both).all(axis=1)] == 1.0
        return paired(both[:, 0], both[:, 1])

    def sensitivities(self, combination: int = 0) -> list[Sensitivity]:
        """Return Sobol' indices of each claim's value, and of the headline; empty without a design for them."""
        draws = self.plan.draws
        whole = self.draws // draws.of_each
        if not draws.sensitivity or whole < 2:
            return []
        keys = [one.key for one in draws.varied]
        found = []
        headline = [(HEADLINE, self.holds(HEADLINE))]
        for name, values in [*headline, *((one.name, self.values(one)) for one in self.measures)]:
            samples = values[: whole * draws.of_each, combination].reshape(whole, draws.of_each)
            used = int(np.isfinite(samples).all(axis=1).sum())
            if used < 2:
                continue
            indices, used = sobol_indices_of(samples, seed=draws.seed)
            if any(np.isfinite(one.total) for one in indices):
                found.append(Sensitivity(name, dict(zip(keys, indices, strict=True)), used, whole))
        return found

    def sentences(self) -> list[str]:
        """Return the headline in words: each combination, then the pairs."""
        first = self.share(HEADLINE, 0)
        lines = [f"{self._subject(0)} holds in {percent(first)} of {first.of} flights"]
        for n in range(1, min(len(self.labels), 9)):
            other, pairs = self.share(HEADLINE, n), self.paired(HEADLINE, n)
            both = sum((pairs.both, pairs.only_first, pairs.only_second, pairs.neither))
            lines.append(
                f"{self._subject(n)} in {percent(other)} of {other.of}; {self._subject(0)} holds {_points(pairs)} more "
                f"often on the same {both} draws (exact McNemar test: p = {pairs.p:.2g})"
            )
        refused = {n: int(count) for n, count in enumerate(self.refused.sum(axis=0)[:9]) if count}
        if len(set(refused.values())) == 1 and len(refused) == min(len(self.labels), 9):
            lines.append(f"{refused[0]} of {self.draws} draws cannot fly and are not counted")
        else:
            lines += [
                f"{count} draws cannot fly and are not counted ({self.labels[n]})" for n, count in refused.items()
            ]
        return lines

    def _subject(self, combination: int) -> str:
        return self.labels[combination] or self.plan.case

    @staticmethod
    def _known(values: Array, combination: int) -> Array:
        column = values[:, combination]
        return column[np.isfinite(column)]


def percent(found: Share) -> str:
    """Return a share with its interval as text."""
    if not found.of:
        return "- %"
    digits = 1 if found.high - found.low > 0.002 else 2
    return f"{100 * found.value:.{digits}f} % [{100 * found.low:.{digits}f}, {100 * found.high:.{digits}f}]"


def _points(pairs: Paired) -> str:
    return f"{100 * pairs.difference:.1f} points [{100 * pairs.low:.1f}, {100 * pairs.high:.1f}]"


def label_of(plan: StudyPlan, combination: int, skip: int = 0) -> str:
    """Return the values of a combination as text, without the first ``skip`` keys."""
    pairs = itertools.islice(zip(plan.variations, plan.combinations[combination], strict=True), skip, None)
    return ", ".join(_value_text(variation.key, value) for variation, value in pairs)


def _value_text(key: str, value: Any) -> str:
    if key == CASE:
        return str(value)
    return f"{key} = {value:g}" if isinstance(value, float) else f"{key} = {value}"
