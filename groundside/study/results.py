"""Tabulate a study: a table with a row per flight, and a summary."""

from __future__ import annotations

import importlib.metadata
import itertools
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ftcc.groundside.claims import Result, Tolerance, by_case, tolerance_of, uavs_of
from ftcc.groundside.schema import Claim
from ftcc.groundside.study.flights import Outcome
from ftcc.groundside.study.plan import Study
from ftcc.groundside.verdict import AS_IT_SHOULD, FAILED, REMARKS

if TYPE_CHECKING:
    from rich.table import Table

__all__ = ["SCHEMA_VERSION", "Quantity", "kind_of", "label", "quantities", "summary", "table", "verdict", "write"]

SCHEMA_VERSION = 1
"""Version of the columns of ``study.parquet``."""

_VERSIONS = ("ftcc-sitl", "numba", "numpy")

_COLUMNS_OF_SUMMARY = 8
"""Largest number of combinations on a terminal."""


@dataclass(frozen=True)
class Quantity:
    """A number that every flight has: the value of a claim, or of one UAV if each has its own."""

    name: str
    title: str
    """Title of its claim."""
    claim: Claim
    place: int
    """Index of the claim."""
    part: int | None
    """Index into the claim's UAVs."""
    expected: float
    """Expected value in the scenario's case."""
    tolerance: Tolerance

    def of(self, outcome: Outcome) -> float | None:
        """Return the number of a flight; None if it has none."""
        value = outcome.results[self.place].value if outcome.results else None
        return value[self.part or 0] if isinstance(value, list) else value

    def among(self, outcomes: Iterable[Outcome]) -> list[float]:
        """Return the numbers of all flights that have one."""
        return [value for value in map(self.of, outcomes) if value is not None]


def quantities(study: Study) -> list[Quantity]:
    """Return the quantities that the claims of the study's case measure, in their order."""
    mission = study.mission
    found: list[Quantity] = []
    for place, claim in enumerate(mission.claims):
        expected = claim.expected[mission.case]
        tolerance = tolerance_of(by_case(claim.tolerance, mission.case))
        title = claim.name
        while any(quantity.title == title for quantity in found):
            title = f"{title}, again"
        if isinstance(expected, list):
            for part, (uav, one) in enumerate(zip(uavs_of(claim, mission.graph), expected, strict=True)):
                found.append(Quantity(f"{title}, UAV {uav}", title, claim, place, part, one, tolerance))
        else:
            found.append(Quantity(title, title, claim, place, None, expected, tolerance))
    return found


def verdict(result: Result, in_case: bool) -> bool | None:
    """Return whether a claim holds; None if the claim does not apply.

    A band around an expected number applies only to the scenario's case; with other settings the number is a result,
    not a failure. A bound applies to every flight. A claim also fails if its UAV was lost, or if the event that it
    times did not occur.
    """
    if in_case or tolerance_of(result.tolerance).bound or (result.ok is False and result.value is None):
        return result.ok
    return None


def table(study: Study, outcomes: Sequence[Outcome]) -> Any:
    """Return all flights as a ``pyarrow.Table``, one row per flight.

    Columns: ``flight``, the varied keys, ``seed``; for each claim its value under the claim's name, and ``NAME holds``;
    ``largest error`` (of the scheme's first tracking error), ``verdict``, ``lost`` (ids), ``error`` (text), ``wall``
    (s). Null: not flown, or no such number. Units, tolerances and sources are in the columns' metadata, the rest in the
    table's.
    """
    import pyarrow as pa

    outcomes = sorted(outcomes, key=lambda outcome: outcome.trial.number)
    combinations = [study.combinations[outcome.trial.combination] for outcome in outcomes]
    columns: list[tuple[str, Any, list[Any], dict[str, str]]] = [
        ("flight", pa.int32(), [outcome.trial.number for outcome in outcomes], {"unit": "-"})
    ]
    for n, variation in enumerate(study.variations):
        kind, convert = kind_of(variation.values)
        values = [convert(combination.values[n]) for combination in combinations]
        columns.append((variation.key, kind, values, {"meaning": "varied"}))
    columns.append(("seed", pa.int64(), [outcome.trial.seed for outcome in outcomes], {"unit": "-"}))
    mission = study.mission
    for (place, title), group in itertools.groupby(quantities(study), key=lambda one: (one.place, one.title)):
        for quantity in group:
            notes = _notes(quantity)
            columns.append((quantity.name, pa.float64(), [quantity.of(outcome) for outcome in outcomes], notes))
        verdicts = [
            verdict(outcome.results[place], combination.in_case) if outcome.results else None
            for outcome, combination in zip(outcomes, combinations, strict=True)
        ]
        columns.append((f"{title} holds", pa.bool_(), verdicts, {}))
    verdicts_of = [outcome.verdict for outcome in outcomes]
    tracked = mission.scheme.tracking
    if tracked:
        notes = {"unit": tracked[0].unit, "meaning": f"largest of all UAVs, abs({tracked[0].name})"}
        largest = [one.tracking[0].largest if one and one.tracking else None for one in verdicts_of]
        columns.append(("largest error", pa.float64(), largest, notes))
    words = [one.word if one else None for one in verdicts_of]
    columns += [
        ("verdict", pa.string(), words, {"meaning": "how the flight went"}),
        ("lost", pa.list_(pa.int32()), [list(outcome.lost) for outcome in outcomes], {"meaning": "UAVs"}),
        ("error", pa.string(), [outcome.error or None for outcome in outcomes], {}),
        ("wall", pa.float64(), [outcome.wall for outcome in outcomes], {"unit": "s", "meaning": "wall time"}),
    ]
    about = {
        "ftcc.study": str(SCHEMA_VERSION),
        "ftcc.scenario": mission.name,
        "ftcc.case": mission.case,
        "ftcc.settings": json.dumps(study.settings),
        "ftcc.duration": f"{mission.timing.duration:g}",
        "ftcc.versions": json.dumps({name: importlib.metadata.version(name) for name in _VERSIONS}),
    }
    schema = pa.schema([pa.field(name, kind, metadata=notes) for name, kind, _, notes in columns], metadata=about)
    return pa.Table.from_arrays([pa.array(values, kind) for _, kind, values, _ in columns], schema=schema)


def _notes(quantity: Quantity) -> dict[str, str]:
    claim = quantity.claim
    return {
        "unit": claim.unit,
        "meaning": f"{claim.metric} of {claim.signal} over {claim.window[0]:g} to {claim.window[1]:g} s",
        "expected": f"{quantity.expected:.9g}",
        "tolerance": quantity.tolerance.text,
        "source": claim.source,
    }


def kind_of(values: Sequence[Any]) -> tuple[Any, Any]:
    """Return the Arrow type of a varied key, and the function that converts its values to it."""
    import pyarrow as pa

    if all(isinstance(value, bool) for value in values):
        return pa.bool_(), bool
    if all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in values):
        return pa.float64(), float
    return pa.string(), str


def write(study: Study, outcomes: Sequence[Outcome], folder: Path) -> Path:
    """Write ``study.parquet`` into ``folder``, where it appears once it is complete, and return its path."""
    import pyarrow.parquet as pq

    path = folder / "study.parquet"
    unfinished = path.with_suffix(".unfinished")
    pq.write_table(table(study, outcomes), unfinished)
    unfinished.replace(path)
    return path


def label(study: Study, combination: int, skip: int = 0) -> str:
    """Return the values of a combination as text, without the first ``skip`` keys."""
    values = study.combinations[combination].values
    pairs = list(zip(study.variations, values, strict=True))[skip:]
    return ", ".join(f"{v.key} = {value:g}" if isinstance(value, float) else f"{v.key} = {value}" for v, value in pairs)


def summary(study: Study, outcomes: Sequence[Outcome]) -> Table:
    """Return medians and quartiles of every claim, a column per combination, for the terminal."""
    from rich.markup import escape
    from rich.table import Table

    caption = "median \\[quartiles], flights that hold of those judged"
    shown = Table(header_style="bold", pad_edge=False, caption=caption)
    shown.add_column("claim", overflow="fold")
    places = range(min(len(study.combinations), _COLUMNS_OF_SUMMARY))
    groups = [[outcome for outcome in outcomes if outcome.trial.combination == n] for n in places]
    for n in places:
        shown.add_column(escape(label(study, n) or study.mission.case), justify="right")
    shown.add_row("flights", *(str(len(group)) for group in groups))
    shown.add_row("with lost aircraft", *(str(sum(bool(outcome.lost) for outcome in group)) for group in groups))
    for word in (AS_IT_SHOULD, REMARKS, FAILED):
        words = [[outcome.verdict.word for outcome in group if outcome.verdict] for group in groups]
        shown.add_row(f"verdict: {word}", *(str(those.count(word)) for those in words))
    shown.add_row("not flown", *(str(sum(bool(outcome.problem) for outcome in group)) for group in groups))
    shown.add_section()
    for quantity in quantities(study):
        cells = []
        for n, group in zip(places, groups, strict=True):
            in_case = study.combinations[n].in_case
            verdicts = [verdict(outcome.results[quantity.place], in_case) for outcome in group if outcome.results]
            judged = [one for one in verdicts if one is not None]
            cells.append(_spread(quantity.among(group)) + (f"  {sum(judged)}/{len(judged)}" if judged else ""))
        unit = quantity.claim.unit
        shown.add_row(escape(quantity.name + (f", {unit}" if unit else "")), *cells)
    return shown


def _spread(values: Sequence[float]) -> str:
    if not values:
        return "-"
    low, middle, high = np.percentile(values, [25, 50, 75])
    return f"{middle:.4g}" + (f" \\[{low:.3g}, {high:.3g}]" if high > low else "")
