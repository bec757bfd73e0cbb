"""Compare runs: the same figures with a colour per run, and one table of claims."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ftcc.groundside.claims import Result, evaluate
from ftcc.groundside.errors import UserError
from ftcc.groundside.report.curves import Flown
from ftcc.groundside.report.definitions import sheet_of
from ftcc.groundside.report.page import Cell, Head, Page, Section, write
from ftcc.groundside.report.report import draw_figures
from ftcc.groundside.report.terminal import number
from ftcc.groundside.results import Run, sole_writer

__all__ = ["Comparison", "labels_of"]


Key = tuple[str, str, tuple[float, float]]
"""Name, signal and window, which identify a claim across scenarios and cases."""


def labels_of(runs: Sequence[Run]) -> list[str]:
    """Return labels that distinguish the runs: scenario and case, and the folder if these are equal."""
    scenarios = {run.mission.name for run in runs}
    labels = []
    for run in runs:
        flown = run.scenario.plan.flown
        parts = [run.mission.name] if len(scenarios) > 1 else []
        parts += [run.mission.case, *(flown.settings if flown is not None else ())]
        labels.append(" ".join(parts))
    if len(set(labels)) < len(labels):
        labels = [f"{label} ({run.path.resolve().name})" for label, run in zip(labels, runs, strict=True)]
    return labels


class Comparison:
    """Several runs of one scheme.

    Raises
    ------
    UserError
        If they fly different schemes.
    """

    def __init__(self, runs: Sequence[Run]) -> None:
        schemes = sorted({run.mission.scheme.name for run in runs})
        if len(schemes) > 1:
            raise UserError(f"runs of different schemes have no figures in common: {', '.join(schemes)}")
        self.runs = runs
        self.labels = labels_of(runs)
        self.table = self._table()

    def _table(self) -> list[tuple[Result, list[Result | None]]]:
        """Return each claim of any run with the results of all runs; a run that does not make it has no verdict."""
        claims: dict[Key, Result] = {}
        shown: dict[Key, list[Result | None]] = {}
        made: set[Key] = set()
        for place, run in enumerate(self.runs):
            mission = run.mission
            for claim in run.scenario.plan.claims:
                key = (claim.name, claim.signal, claim.window)
                claimed = mission.case in claim.expected
                case = mission.case if claimed else next(iter(claim.expected))
                (result,) = evaluate(run, [claim], case, mission.graph)
                claims.setdefault(key, result)
                made |= {key} if claimed else set()
                row = shown.setdefault(key, [None] * len(self.runs))
                row[place] = result if claimed else _without_verdict(result)
        return [(claims[key], shown[key]) for key in claims if key in made]

    def rows(self) -> tuple[list[Head], list[list[Cell]]]:
        """Return the table, a column per run; expected values follow the measured ones."""
        heads = [Head("claim"), Head("window, s"), *(Head(label, True) for label in self.labels)]
        rows = []
        for claim, results in self.table:
            start, end = claim.claim.window
            window = f"{start:g}" if start == end else f"{start:g} - {end:g}"
            cells = [Cell(claim.claim.name), Cell(window)]
            for result in results:
                cells.append(_cell(result, claim.claim.unit))
            rows.append(cells)
        return heads, rows

    def write(self, folder: Path) -> Path:
        """Draw the figures and write the page; refuse if another process is writing one."""
        with sole_writer(folder):
            return self._write(folder)

    def _write(self, folder: Path) -> Path:
        flights = [
            Flown(label, run, run.mission) for label, run in zip(self.labels, self.runs, strict=True) if run.uavs
        ]
        heads, rows = self.rows()
        first = self.runs[0].mission
        page = Page(
            title=first.title if len({run.mission.title for run in self.runs}) == 1 else "Runs compared",
            subtitle=f"{first.scheme.title}. {len(self.runs)} runs compared.",
            facts=[
                (label, f"{run.path.resolve().name}, {run.end:g} s, seed {run.mission.timing.seed}")
                for label, run in zip(self.labels, self.runs, strict=True)
            ],
            figures=draw_figures(sheet_of(first), flights, folder),
            figures_note="A colour per run; all UAVs of a run have the colour of the run.",
        )
        after = ["A value has no verdict if the scenario makes no claim for that case."]
        page.sections.append(Section("claims", "Claims", heads=heads, rows=rows, after=after))
        return write(page, folder / "index.html")


def _without_verdict(result: Result) -> Result:
    return Result(result.claim, result.uavs, result.value, float("nan"), "", None, result.remark)


def _cell(result: Result | None, unit: str) -> Cell:
    if result is None:
        return Cell("")
    if result.value is None:
        return Cell(result.remark or "-", "fails" if result.ok is False else "open")
    value = f"{number(result.value)} {unit}".strip()
    if result.ok is None:
        return Cell(value)
    mark = "holds" if result.ok else "fails"
    return Cell(f"{value} ({number(result.expected)})", mark)
