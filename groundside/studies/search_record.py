"""The folder of a search: its plan as ``search.toml``, its flights as they land, and as one table in the end."""

from __future__ import annotations

import time
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomli_w

from ftcc.groundside.results import lock_until_exit, new_folder
from ftcc.groundside.studies.errors import StudyError
from ftcc.groundside.studies.flying import Outcome
from ftcc.groundside.studies.folder import refuse_another
from ftcc.groundside.studies.parts import Parts, write_parquet
from ftcc.groundside.studies.rows import table_of
from ftcc.groundside.studies.search import Flown, SearchPlan
from ftcc.groundside.studies.search_sampler import GENERATION
from ftcc.groundside.studies.versions import versions

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = ["TABLE", "Record", "open_search_folder", "save_search"]

TABLE = "search.parquet"
_PLAN = "search.toml"
_APPEND = 2.0
"""Wall time between two files of flights of one generation, s."""


def open_search_folder(search: SearchPlan, out: str | Path | None, resume: bool = False) -> Path:
    """Return the folder of a search, created or, with ``resume``, the one where it was begun.

    Raises
    ------
    StudyError
        If there is nothing to go on with, or another search.
    RunError
        If the folder cannot be written or is taken.
    """
    if not resume:
        return new_folder(search.study.name, out, "studies")
    if out is None or not (Path(out) / _PLAN).is_file():
        raise StudyError(f"--resume: {out or 'no folder given with --out'}: holds no search to go on with")
    place = Path(out)
    try:
        there = tomllib.loads((place / _PLAN).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise StudyError(f"{place / _PLAN}: damaged: {error}") from None
    refuse_another("search", place, tomllib.loads(tomli_w.dumps(_document(search))), there)
    lock_until_exit(place)
    return place


def save_search(search: SearchPlan, folder: Path) -> None:
    """Write ``search.toml``."""
    (folder / _PLAN).write_text(tomli_w.dumps(_document(search)), encoding="utf-8")


def _document(search: SearchPlan) -> dict[str, Any]:
    """Return everything that determines the flights."""
    study = search.study
    return {
        "claim": search.goal,
        "budget": search.budget,
        "method": search.method,
        "generation": GENERATION,
        "seed": search.draws.seed,
        "over": {one.key: one.distribution.text for one in search.quantities},
        "own": {one.key: own for one, own in zip(search.quantities, search.draws.own, strict=True)},
        "versions": versions(),
        "name": study.name,
        "case": study.case,
        "settings": list(study.settings),
        "claims": [claim.model_dump(by_alias=True, exclude_none=True) for claim in study.claims],
        "files": dict(study.files),
        "scenario": study.documents[0][1],
    }


class Record:
    """The flights of a search on disk."""

    def __init__(self, search: SearchPlan, folder: Path) -> None:
        self._search = search
        self._folder = folder
        self._parts = Parts(folder)
        self._pending: list[Flown] = []
        self._written = time.monotonic()

    def add(self, flights: Sequence[Flown]) -> None:
        """Take note of flights; they are written now and then."""
        self._pending += flights
        if time.monotonic() - self._written > _APPEND:
            self.flush()

    def flush(self) -> None:
        """Write what has landed since the last time."""
        self._written = time.monotonic()
        if self._pending:
            self._parts.append(self.table(self._pending))
            self._pending = []

    def write(self, flights: Sequence[Flown]) -> Path:
        """Write ``search.parquet``, all flights by number, and return its path."""
        return write_parquet(self.table(flights), self._folder / TABLE)

    def read(self) -> dict[int, dict[str, Any]]:
        """Return the rows of all flights that have landed, by number."""
        return {row["flight"]: row for part in self._parts.read() for row in part.to_pylist()}

    def table(self, flights: Sequence[Flown]) -> pa.Table:
        """Return flights as a table: the columns of a study, and what the search made of each."""
        import pyarrow as pa

        ordered = sorted(flights, key=lambda one: one.number)
        table = table_of(self._search.study, [one.outcome for one in ordered])
        lists = pa.list_(pa.float64())
        for name, kind, meaning in (
            (
                "stage",
                pa.string(),
                "own: the scenario's values; search; line: between its mildest failing flight and them",
            ),
            ("point", lists, "asked for, in the unit cube of the distribution functions"),
            ("distance", pa.float64(), "from the scenario's own values, in units of the distributions"),
            ("margin", pa.float64(), f"of '{self._search.goal}', as a share of what it allows; null: it has no value"),
            ("fails", pa.bool_(), "null: it cannot be said"),
            ("objective", pa.float64(), "what the search makes small"),
        ):
            column = [getattr(one, name) for one in ordered]
            field = pa.field(name, kind, metadata={"meaning": meaning})
            table = table.append_column(field, pa.array(column, kind))
        return table

    def flown(self, row: dict[str, Any], stage: str, point: Sequence[float], values: Sequence[Any]) -> Flown:
        """Return a flight from its row.

        Raises
        ------
        StudyError
            If the row is of another point.
        """
        if row["stage"] != stage or tuple(row["point"]) != tuple(point):
            raise StudyError(
                f"{self._folder}: flight {row['flight']} is not the one that this search flies; it is damaged"
            )
        outcome = self._outcome(row, values)
        return Flown(
            row["flight"], stage, tuple(point), tuple(values), row["distance"], row["margin"], row["fails"],
            row["objective"], outcome,
        )  # fmt: skip

    def _outcome(self, row: dict[str, Any], values: Sequence[Any]) -> Outcome:
        from ftcc.groundside.studies.measures import measures_of, titles_of

        study, found, holds = self._search.study, [], []
        for place, title in enumerate(titles_of(study.claims)):
            measures = [one for one in measures_of(study) if one.place == place]
            numbers = [row[one.name] for one in measures]
            single = measures[0].part is None
            found.append(numbers[0] if single else None if None in numbers else numbers)
            holds.append(row[f"{title} holds"])
        flew = row["verdict"] is not None
        return Outcome(
            row["flight"],
            tuple(values),
            tuple(found) if flew else (),
            tuple(holds) if flew else (),
            tuple(row["lost"] or ()),
            row["verdict"],
            row.get("largest error"),
            end_margin=row.get("end margin"),
            refused=row["refused"],
            error=row["error"] or "",
        )
