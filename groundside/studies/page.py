"""The report of a study as one page that needs no network."""

from __future__ import annotations

import math
import shlex
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ftcc.groundside.studies.answers import HEADLINE, Answers, percent
from ftcc.groundside.studies.documents import interval_kind
from ftcc.groundside.studies.folder import PLAN_FILE
from ftcc.groundside.studies.reasons import reasons_in

if TYPE_CHECKING:
    from ftcc.groundside.report import Cell, Section
    from ftcc.groundside.statistics import Estimate
    from ftcc.groundside.studies.results import Study

__all__ = ["write_page"]

_LISTED = 200
"""Largest number of failed flights on the page."""
_DESIGNS = {
    "sobol": "scrambled Sobol' points",
    "lhs": "Latin hypercube",
    "random": "independent draws",
}


def write_page(study: Study, folder: Path) -> Path:
    """Write ``index.html`` and the figures into a folder, and return the page.

    Raises
    ------
    StudyError
        No flight of the study is finished.
    """
    from ftcc.groundside.report import write_html
    from ftcc.groundside.studies.errors import StudyError
    from ftcc.groundside.studies.figures import draw_figures

    answers = study.answers
    if not answers.draws:
        raise StudyError(f"{study.folder}: no flight is finished yet; to go on: ftcc study {study.folder} --resume")
    plan = study.plan
    figures = draw_figures(answers, folder)
    sections = [
        _answer(answers),
        _differences(answers),
        _values(answers),
        _sensitivities(answers),
        _draws(answers),
        _reasons(answers, True),
        _reasons(answers, False),
        _intervals(answers),
        _failed(answers, study.folder),
        _versions(study.folder),
    ]
    sections = [one for one in sections if one.rows or one.before]
    contents = [(one.anchor, one.title) for one in sections]
    if figures:
        contents.insert(1, ("figures", "Figures"))
    case = f"Scenario {plan.name}, {plan.case}"
    return write_html(
        "study.html.jinja",
        folder / "index.html",
        Path(__file__).parent,
        title=plan.question or plan.title,
        subtitle=f"{f'{plan.title}. ' if plan.question else ''}{case}; study {study.folder.resolve().name}.",
        notes=_notes(answers),
        facts=_facts(answers),
        contents=contents,
        sections=sections,
        figures=figures,
    )


def _section(anchor: str, title: str, heads: Sequence[str], rows: Sequence[Sequence[Any]], **around: Any) -> Section:
    """Return a table; a heading that ends with > is one of numbers, a row may contain cells and text."""
    from ftcc.groundside.report import Cell, Head, Section

    shown = [[one if isinstance(one, Cell) else Cell(str(one)) for one in row] for row in rows]
    return Section(
        anchor, title, heads=[Head(head.rstrip(">"), head.endswith(">")) for head in heads], rows=shown, **around
    )


def _notes(answers: Answers) -> list[str]:
    plan, flights = answers.plan, answers.table.num_rows
    if flights >= plan.count:
        return []
    return [f"{flights} of {plan.count} planned flights are finished: it was stopped, or precise enough."]


def _facts(answers: Answers) -> list[tuple[str, str]]:
    draws = answers.plan.draws
    design = _DESIGNS[draws.design] if draws.quantities else "seeds only"
    return [
        (f"{HEADLINE}, {_label(answers, 0)}", percent(answers.share(HEADLINE, 0))),
        ("draws", f"{answers.draws}"),
        ("flights", f"{int(answers.flown.sum())} of {answers.plan.mission.timing.duration:g} s"),
        ("refused by the checks", f"{int(answers.refused.sum())}"),
        ("design", f"{design}, for sensitivities" if draws.sensitivity else design),
        ("seed", str(draws.seed)),
    ]


def _label(answers: Answers, n: int) -> str:
    return answers.labels[n] or answers.plan.case


def _answer(answers: Answers) -> Section:
    rows = []
    for title in answers.titles:
        row = [title]
        for n in range(len(answers.labels)):
            found = answers.share(title, n)
            row.append(f"{percent(found)} ({found.count} of {found.of})")
        rows.append(row)
    heads = ["share of flights in which it holds", *(f"{_label(answers, n)}>" for n in range(len(answers.labels)))]
    sentences = [f"{sentence}." for sentence in answers.sentences()]
    return _section(
        "answer", "Answer", heads, rows, before=sentences, after=[f"In brackets: {interval_kind(answers)}."]
    )


def _differences(answers: Answers) -> Section:
    rows = []
    for title in answers.titles:
        for n in range(1, len(answers.labels)):
            found = answers.paired(title, n)
            if math.isfinite(found.difference):
                counts = (found.both, found.only_first, found.only_second, found.neither)
                points = f"{100 * found.difference:.1f} [{100 * found.low:.1f}, {100 * found.high:.1f}]"
                rows.append([title, _label(answers, n), *counts, points, f"{found.p:.2g}"])
    first = _label(answers, 0)
    heads = ["", "compared with", "both>", f"only {first}>", "only the other>", "neither>", "difference, points>", "p>"]
    after = [
        "Draws by which of the two holds; the difference with its 95 % interval (Newcombe's method 10, approximate); p "
        "of McNemar's exact test."
    ]
    return _section("differences", f"{first} against the others, on the same draws", heads, rows, after=after)


def _values(answers: Answers) -> Section:
    rows = []
    for measure in answers.measures:
        for n in range(len(answers.labels)):
            found = answers.quantiles(measure, n)
            if found is not None:
                unit = measure.claim.unit
                name = measure.name + (f", {unit}" if unit not in ("", "-") else "")
                rows.append([name, _label(answers, n), *map(_estimate, found), measure.tolerance.text])
    heads = ["value", "", "5 % quantile>", "median>", "95 % quantile>", "claimed"]
    after = ["95 % intervals by order statistics, for any distribution; inf: too few flights to bound that end."]
    return _section("values", "Values of the claims", heads, rows, after=after)


def _estimate(found: Estimate) -> str:
    return f"{found.value:.4g} [{found.low:.3g}, {found.high:.3g}]"


def _sensitivities(answers: Answers) -> Section:
    rows = []
    for one in answers.sensitivities():
        for key, index in one.indices.items():
            first = f"{index.first:.2f} [{index.first_low:.2f}, {index.first_high:.2f}]"
            total = f"{index.total:.2f} [{index.total_low:.2f}, {index.total_high:.2f}]"
            rows.append([one.name, key, first, total, f"{one.used} of {one.of}"])
    heads = ["value", "random quantity", "first order>", "total>", "base samples>"]
    after = [
        "Sobol' indices with 95 % intervals: share of the variance that a quantity explains alone (first order), and "
        "alone or together with others (total). A base sample counts if all its flights gave a number."
    ]
    return _section("sensitivities", "What matters", heads, rows, after=after)


def _draws(answers: Answers) -> Section:
    plan, draws = answers.plan, answers.plan.draws
    rows = [[one.key, "random", one.distribution.text] for one in draws.quantities]
    rows += [[one.key, "varied", ", ".join(map(str, one.values))] for one in plan.variations]
    if draws.sensitivity:
        before = [
            f"{draws.samples} base samples with {draws.of_each} draws each (Saltelli 2010); the seed is drawn, too."
        ]
        rows.append(["seed", "random", draws.varied[-1].distribution.text])
    else:
        what = f"{_DESIGNS[draws.design]} from seed {draws.seed}, and " if draws.quantities else ""
        before = [
            f"{draws.samples} draws: {what}seeds {draws.seed} to {draws.seed + draws.samples - 1} for the flights."
        ]
    before.append(f"Every draw flies in each of {len(answers.labels)} combinations." if len(answers.labels) > 1 else "")
    if plan.settings:
        before.append(f"Settings of all flights: {', '.join(plan.settings)}.")
    if plan.redraw:
        before.append(
            "A draw that cannot fly in all combinations was drawn again: distributions are conditional on that."
        )
    before = [line for line in before if line]
    return _section("draws", "What was drawn", ["key", "", "values"], rows, before=before)


def _reasons(answers: Answers, refused: bool) -> Section:
    rows = [[reason.count, reason.text, reason.example] for reason in reasons_in(answers.errors(refused))]
    if refused:
        before = ["The checks of scenarios refused these flights; they are in no share."] if rows else []
        return _section("refused", "Refused", ["flights>", "reason", "for example"], rows, before=before)
    before = ["These flights count as failed."] if rows else []
    return _section("errors", "Broken off with an error", ["flights>", "error", "for example"], rows, before=before)


def _intervals(answers: Answers) -> Section:
    draws = answers.plan.draws
    before = [
        "The shares are those of the distributions above; they say nothing of conditions that were not drawn.",
        "Intervals of shares are those of Clopper and Pearson, which cover the true share in at least 95 % of studies "
        "if flights are independent.",
    ]
    if draws.sensitivity:
        before.append(
            "This study drew for sensitivities: its draws repeat values of each other and are not independent; take "
            "intervals of shares and quantiles as an orientation, and fly a study without --sensitivity for them."
        )
    elif draws.quantities and draws.design != "random":
        before.append(
            f"Points of this design ({_DESIGNS[draws.design]}) spread more evenly than independent ones: the same "
            "intervals are as a rule wider than needed, but not proven so. With --design random they are exact."
        )
    else:
        before.append("The draws of this study are independent: the intervals are exact.")
    if int(answers.refused.sum()):
        before.append("Refused draws are left out: all shares are of draws that can fly.")
    if len(answers.titles) * len(answers.labels) > 1:
        before.append("Every interval and every p is for itself; none is corrected for their number.")
    return _section("intervals", "What the intervals mean", [], [], before=before)


def _failed(answers: Answers, folder: Path) -> Section:
    numbers = answers.failed()
    if not numbers:
        return _section("failed", "Failed flights", [], [], before=["None."])
    places = {number: place for place, number in enumerate(answers.table.column("flight").to_pylist())}
    questions = [title for title in answers.titles if title != HEADLINE]
    holds = {title: answers.holds(title) for title in questions}
    keys = [one.key for one in answers.plan.draws.quantities]
    columns = {name: answers.table.column(name).to_pylist() for name in (*keys, "seed", "error")}
    rows = []
    for number in numbers[:_LISTED]:
        draw, n = divmod(number, len(answers.labels))
        at = places[number]
        failing = [title for title in questions if holds[title][draw, n] == 0.0]
        drawn = [_value(columns[key][at]) for key in keys]
        command = f"ftcc simulate {shlex.quote(str(folder))} --row {number}"
        what = [*failing, *([columns["error"][at]] if columns["error"][at] else [])]
        rows.append([number, _label(answers, n), *drawn, columns["seed"][at], _bad("; ".join(what)), command])
    before = [
        f"{len(numbers)} flights in which not all holds; each command repeats one, bit for bit, by the versions below."
    ]
    if len(numbers) > _LISTED:
        before.append(f"The first {_LISTED} are listed; study.parquet contains all.")
    heads = ["flight>", "", *(f"{key}>" for key in keys), "seed>", "what fails", "command"]
    return _section("failed", "Failed flights", heads, rows, before=before)


def _bad(text: str) -> Cell:
    from ftcc.groundside.report import Cell

    return Cell(text, "error")


def _value(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _versions(folder: Path) -> Section:
    document = tomllib.loads((folder / PLAN_FILE).read_text(encoding="utf-8"))
    rows = list(document["versions"].items())
    before = [
        "Each flight was simulated in one process, of this computer or of a Dask cluster; its numbers do not depend on "
        "where and in which order it flew. All flew with these versions."
    ]
    return _section("versions", "Engine and versions", ["", "version"], rows, before=before)
