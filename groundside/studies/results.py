"""A study that has flown: its plan, its table, its answers and figures."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ftcc.groundside.studies.answers import Answers
from ftcc.groundside.studies.folder import load_plan
from ftcc.groundside.studies.rows import Dataset

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = ["Study"]


class Study:
    """A study on disk: its plan, its table, its answers."""

    def __init__(self, folder: str | Path) -> None:
        """Read a study.

        Raises
        ------
        StudyError
            If the folder holds none.
        """
        self.folder = Path(folder)
        self.plan = load_plan(self.folder, same_version=False)

    @functools.cached_property
    def table(self) -> pa.Table:
        """Return a row per flight by number, see ``rows.table_of``; of an unfinished study the flights so far."""
        import pyarrow.parquet as pq

        path = self.folder / "study.parquet"
        return pq.read_table(path) if path.is_file() else Dataset(self.plan, self.folder).read()

    @functools.cached_property
    def answers(self) -> Answers:
        """Return what the table says."""
        return Answers(self.plan, self.table)

    def to_pandas(self) -> Any:
        """Return the table as a pandas data frame."""
        return self.table.to_pandas()

    def draw(self, folder: str | Path | None = None) -> list[Path]:
        """Draw the figures, by default into the study's folder, and return their files."""
        from ftcc.groundside.studies.figures import draw

        return draw(self.answers, Path(folder) if folder else self.folder)
