"""The answers of a study on a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ftcc.groundside.studies.answers import Answers, percent
from ftcc.groundside.studies.reasons import reasons_in

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

__all__ = ["show", "summary", "summary_of_sensitivities"]

_COLUMNS = 8
"""Largest number of combinations on a terminal."""


def show(console: Console, answers: Answers) -> None:
    """Print the answers, and by kind why flights were refused or broke off."""
    console.print(summary(answers))
    if (indices := summary_of_sensitivities(answers)) is not None:
        console.print(indices)
    reasons = reasons_in([*answers.errors(refused=True), *answers.errors(refused=False)])
    for line in [*answers.sentences(), *(reason.line for reason in reasons)]:
        console.print(line, markup=False, highlight=False, soft_wrap=True)


def summary(answers: Answers) -> Table:
    """Return shares with intervals, and quantiles of every claim's value, a column per combination."""
    from rich.markup import escape
    from rich.table import Table

    caption = "share \\[exact 95 % interval]; values: median, 5 % to 95 % quantile"
    shown = Table(header_style="bold", pad_edge=False, caption=caption)
    shown.add_column("", overflow="fold")
    places = range(min(len(answers.labels), _COLUMNS))
    for n in places:
        shown.add_column(escape(answers.labels[n] or answers.plan.case), justify="right")
    shown.add_row("flights", *(str(int(answers.flown[:, n].sum())) for n in places))
    shown.add_row("refused by the checks", *(str(int(answers.refused[:, n].sum())) for n in places))
    shown.add_section()
    for title in answers.titles:
        shown.add_row(escape(title), *(escape(percent(answers.share(title, n))) for n in places))
    shown.add_section()
    for measure in answers.measures:
        cells = []
        for n in places:
            found = answers.quantiles(measure, n)
            cells.append(
                "-" if found is None else f"{found[1].value:.4g}, {found[0].value:.3g} to {found[2].value:.3g}"
            )
        unit = measure.claim.unit
        shown.add_row(escape(measure.name + (f", {unit}" if unit else "")), *cells)
    return shown


def summary_of_sensitivities(answers: Answers) -> Table | None:
    """Return the total Sobol' indices with intervals, a row per random quantity; None if there are none."""
    from rich.markup import escape
    from rich.table import Table

    found = answers.sensitivities()
    if not found:
        return None
    shown = Table(header_style="bold", pad_edge=False, caption="total Sobol' index \\[95 %], first-order index")
    shown.add_column("")
    for one in found:
        shown.add_column(escape(f"{one.name} ({one.used} of {one.of})"), justify="right", overflow="fold")
    for key in found[0].indices:
        cells = []
        for one in found:
            index = one.indices[key]
            cells.append(
                escape(f"{index.total:.2f} [{index.total_low:.2f}, {index.total_high:.2f}], {index.first:.2f}")
                if np.isfinite(index.total)
                else "-"
            )
        shown.add_row(escape(key), *cells)
    return shown
