"""A study that has flown: its plan, its table, its answers and figures."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ftcc.groundside.results import require
from ftcc.groundside.studies.answers import Answers, percent
from ftcc.groundside.studies.errors import StudyError
from ftcc.groundside.studies.folder import load_plan
from ftcc.groundside.studies.rows import Dataset

if TYPE_CHECKING:
    import pyarrow as pa

    from ftcc.groundside.canvas import Drawn

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
        """Return the table as a ``pandas.DataFrame``.

        Raises
        ------
        MissingPackageError
            If pandas is not installed.
        """
        require("pandas", "to_pandas", "table")
        return self.table.to_pandas()

    def to_polars(self) -> Any:
        """Return the table as a ``polars.DataFrame``.

        Raises
        ------
        MissingPackageError
            If polars is not installed.
        """
        return require("polars", "to_polars", "table").from_arrow(self.table)

    def draw(self, folder: str | Path | None = None) -> list[Path]:
        """Draw the figures, by default into the study's folder, and return their files."""
        from ftcc.groundside.studies.figures import draw

        return draw(self.answers, Path(folder) if folder else self.folder)

    def figure(self, name: str) -> Drawn:
        """Draw one figure into the study's folder, and return it; a notebook shows it.

        Parameters
        ----------
        name : str
            "study" (values of the claims), "shares", "influences" or "sensitivities".

        Raises
        ------
        StudyError
            There is no such figure, or the study has nothing for it.
        """
        from ftcc.groundside.studies.figures import FIGURES, draw_figure

        if name not in FIGURES:
            raise StudyError(f"figure {name!r}: must be one of {', '.join(FIGURES)}")
        if not self.answers.draws or (found := draw_figure(name, self.answers, self.folder)) is None:
            raise StudyError(f"{self.folder}: has nothing to draw for figure {name!r}")
        return found

    def report(self, folder: str | Path | None = None) -> Path:
        """Write the report, by default into ``report`` in the study's folder, and return the page.

        Raises
        ------
        StudyError
            If no flight is finished, or the folder cannot be written.
        """
        from ftcc.groundside.studies.page import write_page

        folder = Path(folder) if folder else self.folder / "report"
        try:
            return write_page(self, folder)
        except OSError as error:
            raise StudyError(f"{folder}: cannot be written: {error.strerror or error}") from None

    def latex(self) -> str:
        """Return the table of answers for LaTeX, with the package booktabs."""
        from ftcc.groundside.studies.documents import as_latex

        return as_latex(self.answers)

    def _repr_html_(self) -> str:
        """Return the answers as a notebook shows them."""
        from html import escape

        answers = self.answers
        if not answers.draws:
            return f"<p>{escape(self.plan.title)}: no flight is finished yet</p>"
        sentences = "".join(f"<p>{escape(sentence)}</p>" for sentence in answers.sentences())
        combinations = range(len(answers.labels))
        heads = "".join(f"<th>{escape(answers.labels[n] or self.plan.case)}</th>" for n in combinations)
        rows = ""
        for title in answers.titles:
            cells = "".join(f"<td>{escape(percent(answers.share(title, n)))}</td>" for n in combinations)
            rows += f"<tr><th>{escape(title)}</th>{cells}</tr>"
        return f"{sentences}<table><thead><tr><th></th>{heads}</tr></thead><tbody>{rows}</tbody></table>"
