"""Flies the chapters and writes what the pages of the schemes show: ``python docs/scheme_pages.py [SCHEME ...]``.

Of each chapter both forms of its scenario fly, and a few of its variants. Into the page go, between their markers,
tables of readings, claims and limits; into `pictures/schemes` the figures. The rest of a page is written by hand. The
table of the index comes from the schemes themselves.
"""

from __future__ import annotations

import re
import sys
import tempfile
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from PIL import Image

from ftcc.airside.schemes import find
from ftcc.groundside.claims import Result, by_case, evaluate
from ftcc.groundside.report.curves import Flown
from ftcc.groundside.report.definitions import Sheet, sheet_of
from ftcc.groundside.report.readings import Compared, compare
from ftcc.groundside.report.report import draw_figures
from ftcc.groundside.results.run import Run
from ftcc.groundside.scenario.loading import load, read, shipped
from ftcc.groundside.scenario.mission import Mission, resolve
from ftcc.groundside.schema import Claim
from ftcc.groundside.simulation import simulate
from ftcc.groundside.verdict.verdict import with_unit

PAGES = Path(__file__).parent / "schemes"
PICTURES = Path(__file__).parent / "pictures" / "schemes"
FORMS = ("monograph", "flight")
MOST = 7
"""Claims of a form that a page shows."""
FAULTS = 3
"""Among them, those that name a fault before others are chosen."""
COLORS = 256
"""Of a picture, those of the UAVs among them."""

_ASIDE = re.compile(r" \((reference|docs)[^)]*\)|; \d+ s$")
"""What the title of a variant says of its source and its duration."""


@dataclass(frozen=True)
class Chapter:
    """What is drawn and flown of a chapter; its scenario has the name of its scheme."""

    number: int
    scheme: str
    problem: str
    pictures: tuple[tuple[str, str], ...]
    """Form and name of the figure."""
    limits: tuple[tuple[str, str], ...]
    """Form and variants, with a plus between them."""


CHAPTERS = (
    Chapter(
        3,
        "prescribed_performance",
        "three followers keep their altitude errors to one leader inside a shrinking tube",
        (("monograph", "altitude_error"), ("flight", "altitude_error"), ("flight", "commands")),
        (
            ("monograph", "printed_200"),
            ("flight", "control_50"),
            ("flight", "unsmoothed"),
            ("flight", "loss_80"),
            ("flight", "cut_uav1_20s"),
            ("flight", "no_estimator"),
            ("flight", "off"),
        ),
    ),
    Chapter(
        4,
        "nearest_neighbour",
        "four followers on a ring follow the mean of their neighbours' speeds and altitudes",
        (("monograph", "altitude_error"), ("flight", "altitude_error"), ("flight", "commands")),
        (
            ("flight", "unfiltered"),
            ("flight", "control_50"),
            ("flight", "exchange_5"),
            ("flight", "loss_80"),
            ("flight", "cut_uav1_20s"),
            ("flight", "lag+no_lead"),
            ("flight", "off"),
        ),
    ),
    Chapter(
        5,
        "containment",
        "six followers fly between the altitudes of two leaders",
        (("monograph", "altitude"), ("monograph", "altitude_tracking"), ("flight", "altitude_tracking")),
        (
            ("monograph", "deep"),
            ("flight", "deep"),
            ("flight", "rate_50"),
            ("flight", "held"),
            ("flight", "loss80"),
            ("flight", "P+cut_uav1_20s"),
            ("flight", "off"),
        ),
    ),
    Chapter(
        6,
        "finite_time_containment",
        "four followers come between two leaders in position and altitude, without a model",
        (("flight", "paths"), ("monograph", "containment_errors"), ("flight", "containment_errors")),
        (
            ("monograph", "infinite_time"),
            ("flight", "off"),
            ("flight", "held"),
            ("flight", "loss80"),
            ("flight", "cut_uav1_20s_at_100"),
            ("flight", "rate_50"),
            ("flight", "noise_gnss"),
        ),
    ),
    Chapter(
        7,
        "attitude_synchronization",
        "four aircraft keep their attitude errors close to each other, inside a funnel",
        (("monograph", "bank_synchronization"), ("flight", "bank_synchronization"), ("flight", "swarm_errors")),
        (
            ("monograph", "traditional"),
            ("monograph", "printed_200"),
            ("flight", "off"),
            ("flight", "rate_100"),
            ("flight", "delay_15"),
            ("flight", "loss_80"),
            ("flight", "no_lead"),
            ("flight", "travel_30"),
        ),
    ),
    Chapter(
        8,
        "directed_attitude",
        "the same over directed edges, by networks and disturbance observers",
        (("flight", "attitude"), ("monograph", "synchronization"), ("flight", "synchronization")),
        (
            ("flight", "off"),
            ("flight", "no_observers"),
            ("flight", "no_networks"),
            ("flight", "alone"),
            ("flight", "undirected"),
            ("flight", "delay_40"),
            ("flight", "too_tight"),
            ("flight", "too_stiff"),
        ),
    ),
    Chapter(
        9,
        "fire_monitoring",
        "four aircraft circle the border of a growing fire",
        (("flight", "ellipse"), ("monograph", "position_errors"), ("flight", "position_errors")),
        (
            ("monograph", "hz100"),
            ("flight", "off"),
            ("flight", "alone"),
            ("flight", "integer"),
            ("flight", "slow_loop"),
            ("flight", "loop_1_5"),
            ("flight", "no_model"),
            ("flight", "noise"),
        ),
    ),
)


def chosen(claims: Sequence[Claim], case: str) -> list[Claim]:
    """Return the claims of a case that a page shows, in the order of the file.

    These are the first ones of the file that name a fault, up to `FAULTS`; then the first of every source; then the
    next of the file, up to `MOST` in all.
    """
    of_case = [claim for claim in claims if case in claim.expected]
    at_faults = [n for n, claim in enumerate(of_case) if "fault" in claim.name][:FAULTS]
    firsts = {claim.source: n for n, claim in reversed([*enumerate(of_case)])}
    ranked = dict.fromkeys([*at_faults, *sorted(firsts.values()), *range(len(of_case))])
    return [of_case[n] for n in sorted([*ranked][:MOST])]


def text_of(value: Any) -> str:
    """Return a number, or one for each UAV, with four digits."""
    if value is None:
        return "-"
    return ", ".join(f"{one:.4g}" for one in value) if isinstance(value, list) else f"{value:.4g}"


def escaped(text: str) -> str:
    """Return a text as a cell of a table, in which a bar would end the cell."""
    return text.replace("|", "\\|").replace("\n", " ")


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join("| " + " | ".join(escaped(one) for one in line) + " |" for line in lines)


def wrapped(text: str) -> str:
    """Return a paragraph in lines of at most 118 characters."""
    return textwrap.fill(text, 118, break_on_hyphens=False, break_long_words=False)


def claim_cells(form: str, claim: Claim, case: str) -> list[str]:
    """Return what the claims file says of a claim: form, name, expected value, tolerance."""
    unit = f" {claim.unit}" if claim.unit else ""
    return [form, claim.name, f"{text_of(claim.expected[case])}{unit}", str(by_case(claim.tolerance, case))]


def claim_row(form: str, case: str, result: Result) -> list[str]:
    """Return the row of a claim."""
    name, expected, tolerance = claim_cells(form, result.claim, case)[1:]
    measured = text_of(result.value) if result.value is not None else result.remark or "-"
    return [form, name, expected, measured, tolerance, {True: "yes", False: "**no**", None: "not flown"}[result.ok]]


CLAIM_HEADS = ("form", "claim", "reference", "measured", "tolerance", "holds")


def claims_table(flights: dict[str, tuple[Mission, Run, list[Result]]]) -> str:
    """Return the claims of both forms, and how many hold of all."""
    rows, counts = [], []
    for form, (mission, run, results) in flights.items():
        shown = [id(claim) for claim in chosen(mission.claims, mission.case)]
        rows += [claim_row(form, mission.case, result) for result in results if id(result.claim) in shown]
        held = sum(result.ok is True for result in results)
        counts.append(f"`{form}` holds {held} of {len(results)} claims, verdict *{run.verdict.word}*")
    name = next(mission.name for mission, _, _ in flights.values())
    cases = [case for claim in read(shipped()[name])["claims"] for case in claim["expected"]]
    text = (
        f"All claims of these two flights: {'; '.join(counts)}. The claims files expect {len(cases)} values in "
        f"{len(set(cases))} cases, which `ftcc verify {name}` flies. Shown are, for each form, up to {FAULTS} claims "
        f"that name a fault, then the first of every source, then the next of the file, {MOST} at most. Several values "
        "are those of the UAVs in their order."
    )
    return f"{table(CLAIM_HEADS, rows)}\n\n{wrapped(text)}"


def figures_table(sheet: Sheet, flights: dict[str, tuple[Mission, Run, list[Result]]]) -> str:
    """Return the monograph's readings beside both forms, by figure."""
    both = [list(compare(sheet, flown(mission, run))) for mission, run, _ in flights.values()]
    rows = []
    for printed, own in zip(*both, strict=True):
        what = f"{printed.what}, {printed.unit}" if printed.unit else printed.what
        values = (measured_of(printed), measured_of(own))
        rows.append([printed.figure or "-", what, printed.monograph, *values])
    agree = [sum(one.agrees is True for one in compared) for compared in both]
    text = (
        f"Of {len(rows)} readings the `monograph` form agrees with {agree[0]}, the `flight` form with {agree[1]}. "
        "**Bold** values do not agree: they are farther off than a quarter of the span that is read off the plot, or "
        "more than 2 % beyond an axis."
    )
    heads = ("figure", "what it shows", "monograph", *(f"`{form}` form" for form in FORMS))
    return f"{table(heads, rows)}\n\n{wrapped(text)}"


def measured_of(compared: Compared) -> str:
    """Return what a flight shows, bold if it does not agree."""
    return f"**{compared.measured}**" if compared.agrees is False else compared.measured


def limits_table(chapter: Chapter, folder: Path) -> str:
    """Return how flights end whose variants take the law to its limits."""
    titles = read(shipped()[chapter.scheme])["variant"]
    rows = []
    for n, (form, variants) in enumerate(chapter.limits):
        names = tuple(variants.split("+"))
        _, run, results = fly(chapter.scheme, form, names, folder / f"limit_{n}")
        changes = "; ".join(_ASIDE.sub("", titles[name]["title"]) for name in names)
        held = sum(result.ok is True for result in results)
        claims = f"{held} of {len(results)}" if results else "none made"
        rows.append([f"`{form}`, `{variants}`", changes, outcome_of(run), errors_of(run), claims])
    return table(("case", "what changes", "verdict", "errors: largest, in the end", "claims that hold"), rows)


def outcome_of(run: Run) -> str:
    """Return the verdict with its first reason."""
    reasons = [*run.verdict.failures, *run.verdict.remarks]
    return run.verdict.word + (f": {reasons[0]}" if reasons else "")


def errors_of(run: Run) -> str:
    """Return the largest value of every tracking error that the scheme declares, and that in the end."""
    return "; ".join(
        f"{error.name}: {with_unit(error.largest, error.unit)}, {with_unit(error.end, error.unit)}"
        for error in run.verdict.tracking
    )


def flown(mission: Mission, run: Run) -> Flown:
    """Return a flight as the report draws it."""
    return Flown(mission.case, run, mission, tuple(sorted({event[0] for event in mission.events})))


def fly(scheme: str, form: str, variants: tuple[str, ...], folder: Path) -> tuple[Mission, Run, list[Result]]:
    """Fly a case, and hold its claims against it."""
    mission = resolve(load(scheme, form=form, variants=variants))
    run = simulate(mission, folder)
    print(f"{scheme}, {mission.case}", flush=True)
    return run.mission, run, evaluate(run, run.mission.claims, run.mission.case, run.mission.graph)


def write_picture(source: Path, target: Path) -> None:
    """Write a picture in few colours."""
    Image.open(source).convert("RGB").quantize(COLORS, kmeans=4, dither=Image.Dither.NONE).save(target, optimize=True)
    print(f"{target.name}: {target.stat().st_size // 1000} kB")


def draw(chapter: Chapter, flights: dict[str, tuple[Mission, Run, list[Result]]], folder: Path) -> None:
    """Draw a chapter's pictures with the figures of the report."""
    for form, name in chapter.pictures:
        mission, run, _ = flights[form]
        sheet = sheet_of(mission)
        one = sheet.model_copy(update={"figures": [figure for figure in sheet.figures if figure.name == name]})
        (drawn,) = draw_figures(one, [flown(mission, run)], folder / form)
        png = next(file for file in drawn.files if file.suffix == ".png")
        write_picture(png, PICTURES / picture_name(chapter, form, name))


def picture_name(chapter: Chapter, form: str, name: str) -> str:
    """Return the file of a picture."""
    return f"{chapter.scheme}_{name}_{form}.png"


def replaced(page: str, marker: str, content: str) -> str:
    """Return a page with what stands between its two markers replaced."""
    begin, end = f"<!-- begin {marker} -->", f"<!-- end {marker} -->"
    before, _, rest = page.partition(begin)
    _, found, after = rest.partition(end)
    if not found:
        raise ValueError(f"no {begin} ... {end}")
    return f"{before}{begin}\n\n{content}\n\n{end}{after}"


def index_table() -> str:
    """Return the table of all chapters."""
    rows = []
    for chapter in CHAPTERS:
        scheme = find(chapter.scheme)
        actuators = ", ".join(name.replace("_", " ") for name in scheme.commands)
        form, name = chapter.pictures[0]
        picture = f"![{chapter.problem}](../pictures/schemes/{picture_name(chapter, form, name)})"
        page = f"[{chapter.number}]({chapter.scheme}.md)"
        rows.append(
            [page, chapter.problem, scheme.graph.value, actuators, scheme.plant, f"`{chapter.scheme}`", picture]
        )
    return table(("chapter", "problem", "assumption on the graph", "actuators", "plant", "scenario", "picture"), rows)


def parts_of(chapter: Chapter, folder: Path) -> Iterator[tuple[str, str]]:
    """Fly a chapter, draw its pictures, and yield what goes between the markers of its page."""
    flights = {form: fly(chapter.scheme, form, (), folder / form) for form in FORMS}
    draw(chapter, flights, folder)
    yield "figures", figures_table(sheet_of(flights["flight"][0]), flights)
    yield "claims", claims_table(flights)
    yield "limits", limits_table(chapter, folder)


def main() -> None:
    """All chapters, or those that are named."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    index = PAGES / "README.md"
    index.write_text(replaced(index.read_text(encoding="utf-8"), "index", index_table()), encoding="utf-8")
    for chapter in CHAPTERS:
        if len(sys.argv) > 1 and chapter.scheme not in sys.argv[1:]:
            continue
        page = PAGES / f"{chapter.scheme}.md"
        with tempfile.TemporaryDirectory() as name:
            for marker, content in parts_of(chapter, Path(name)):
                page.write_text(replaced(page.read_text(encoding="utf-8"), marker, content), encoding="utf-8")


if __name__ == "__main__":
    main()
