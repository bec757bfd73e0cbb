"""The table of a study: a row per flight, appended to a dataset while the study flies, one file in the end.

``flights/`` holds the rows in the order in which they came, with wall times, a file for every few seconds of work.
``study.parquet`` holds them by number, without what differs from computer to computer: equal studies, equal bytes.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ftcc.groundside.studies.flying import Outcome
from ftcc.groundside.studies.measures import Measure, measures_of, titles_of
from ftcc.groundside.studies.parts import Parts, write_parquet
from ftcc.groundside.studies.plan import StudyPlan
from ftcc.groundside.studies.versions import versions

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = ["SCHEMA_VERSION", "Dataset", "kind_of", "table_of", "write_table"]

SCHEMA_VERSION = 3
"""Version of the columns of ``study.parquet``."""
_TABLE = "study.parquet"
_WALL = "wall"


def schema_of(plan: StudyPlan) -> pa.Schema:
    """Return the columns of a study: names, types, and as metadata units, tolerances and sources."""
    import pyarrow as pa

    fields = [pa.field("flight", pa.int64(), metadata={"unit": "-"})]
    for variation in plan.variations:
        fields.append(pa.field(variation.key, kind_of(variation.values), metadata={"meaning": "varied"}))
    fields.append(pa.field("draw", pa.int64(), metadata={"meaning": "all combinations fly with each draw"}))
    for one in plan.draws.quantities:
        samples = one.distribution.values(np.linspace(0.001, 0.999, 101))
        about = {"meaning": "drawn", "distribution": one.distribution.text}
        fields.append(pa.field(one.key, kind_of(samples), metadata=about))
    fields.append(pa.field("seed", pa.int64(), metadata={"unit": "-"}))
    for title, group in itertools.groupby(measures_of(plan), key=lambda one: one.title):
        fields += [pa.field(measure.name, pa.float64(), metadata=_notes(measure)) for measure in group]
        fields.append(pa.field(f"{title} holds", pa.bool_()))
    tracked = plan.mission.scheme.tracking
    if tracked:
        about = {"unit": tracked[0].unit, "meaning": f"largest of all UAVs, abs({tracked[0].name})"}
        fields.append(pa.field("largest error", pa.float64(), metadata=about))
        about = {"unit": "-", "meaning": "smallest 1 - end / allowed of all tracking errors, as in the verdict"}
        fields.append(pa.field("end margin", pa.float64(), metadata=about))
    fields += [
        pa.field("verdict", pa.string(), metadata={"meaning": "how the flight went"}),
        pa.field("lost", pa.list_(pa.int32()), metadata={"meaning": "UAVs"}),
        pa.field("refused", pa.bool_(), metadata={"meaning": "the checks of scenarios found that it cannot fly"}),
        pa.field("error", pa.string()),
    ]
    about = {
        "ftcc.study": str(SCHEMA_VERSION),
        "ftcc.scenario": plan.name,
        "ftcc.case": plan.case,
        "ftcc.settings": json.dumps(plan.settings),
        "ftcc.duration": f"{plan.mission.timing.duration:g}",
        "ftcc.versions": json.dumps(versions()),
    }
    return pa.schema(fields, metadata=about)


def table_of(plan: StudyPlan, outcomes: Iterable[Outcome]) -> pa.Table:
    """Return flights as a ``pyarrow.Table``, one row per flight, by number.

    Columns: ``flight``, the varied keys, ``draw``, the drawn keys, ``seed``; for each claim its value under the claim's
    name, and ``NAME holds``; ``largest error`` (of the scheme's first tracking error), ``end margin`` (smallest of
    all), ``verdict``, ``lost`` (ids), ``refused``, ``error`` (text). Null: not flown, or no such number.
    """
    import pyarrow as pa

    ordered = sorted(outcomes, key=lambda outcome: outcome.number)
    rows = [_row(plan, outcome) for outcome in ordered]
    schema = schema_of(plan)
    columns = zip(*rows, strict=True) if rows else [()] * len(schema)
    arrays = [
        pa.array(_converted(column, field.type), field.type) for column, field in zip(columns, schema, strict=True)
    ]
    return pa.Table.from_arrays(arrays, schema=schema)


def _row(plan: StudyPlan, outcome: Outcome) -> tuple[Any, ...]:
    """Return the values of a row in the order of `schema_of`."""
    trial = plan.trial(outcome.number)
    row: list[Any] = [outcome.number, *plan.combinations[trial.combination], trial.draw]
    row += outcome.drawn or (None,) * len(plan.draws.quantities)
    row.append(trial.seed)
    titles = titles_of(plan.asked)
    for title, group in itertools.groupby(measures_of(plan), key=lambda one: one.title):
        row += [measure.of(outcome.values) for measure in group]
        row.append(outcome.holds[titles.index(title)] if outcome.holds else None)
    if plan.mission.scheme.tracking:
        row += [outcome.largest, outcome.end_margin]
    return (*row, outcome.verdict, list(outcome.lost), outcome.refused, outcome.error or None)


def _converted(column: Sequence[Any], kind: pa.DataType) -> list[Any]:
    """Return values that Arrow accepts for a type: numbers as they are, all else as text in a text column."""
    import pyarrow as pa

    if pa.types.is_string(kind):
        return [value if value is None or isinstance(value, str) else json.dumps(value) for value in column]
    if pa.types.is_floating(kind):
        return [None if value is None else float(value) for value in column]
    return list(column)


def kind_of(values: Sequence[Any]) -> pa.DataType:
    """Return the Arrow type of a varied or drawn key."""
    import pyarrow as pa

    if all(isinstance(value, bool) for value in values):
        return pa.bool_()
    if any(isinstance(value, bool) or not isinstance(value, (int, float)) for value in values):
        return pa.string()
    return pa.int64() if all(isinstance(value, int) for value in values) else pa.float64()


def _notes(measure: Measure) -> dict[str, str]:
    claim = measure.claim
    return {
        "unit": claim.unit,
        "meaning": f"{claim.metric} of {claim.signal} over {claim.window[0]:g} to {claim.window[1]:g} s",
        "expected": f"{measure.expected:.9g}",
        "tolerance": measure.tolerance.text,
        "source": claim.source,
    }


class Dataset:
    """The rows of a study on disk, while it flies and afterwards."""

    def __init__(self, plan: StudyPlan, folder: Path) -> None:
        self.plan = plan
        self._parts = Parts(folder)

    def append(self, outcomes: Sequence[Outcome]) -> None:
        """Write rows into a file of their own, which appears when it is whole."""
        import pyarrow as pa

        if outcomes:
            ordered = sorted(outcomes, key=lambda outcome: outcome.number)
            walls = pa.array([outcome.wall for outcome in ordered], pa.float64())
            field = pa.field(_WALL, pa.float64(), metadata={"unit": "s", "meaning": "wall time of the flight"})
            self._parts.append(table_of(self.plan, ordered).append_column(field, walls))

    def read(self) -> pa.Table:
        """Return all rows by number, each flight once, without wall times."""
        import pyarrow as pa

        parts = self._parts.read()
        if not parts:
            return table_of(self.plan, [])
        whole = pa.concat_tables(parts).sort_by("flight").drop_columns([_WALL])
        numbers = whole.column("flight").to_numpy()
        first = np.flatnonzero(np.diff(numbers, prepend=-1))
        whole = whole.take(first) if len(first) < len(numbers) else whole
        return whole.replace_schema_metadata(schema_of(self.plan).metadata)


def write_table(table: pa.Table, folder: Path) -> Path:
    """Write ``study.parquet`` into ``folder``, and return its path."""
    return write_parquet(table, folder / _TABLE)
