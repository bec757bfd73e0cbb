"""Write the report as one page that needs no network: verdict, claims, figures, comparison, events, links."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ftcc.groundside.claims import Result
from ftcc.groundside.report.readings import Compared
from ftcc.groundside.report.terminal import number, summary
from ftcc.groundside.text import ids
from ftcc.groundside.verdict import AS_IT_SHOULD, FAILED, REMARKS, Verdict, with_unit

if TYPE_CHECKING:
    from ftcc.groundside.canvas import Drawn

__all__ = [
    "AT_TOP",
    "Cell",
    "Head",
    "Page",
    "Section",
    "claims_section",
    "compared_section",
    "events_section",
    "plural",
    "verdict_section",
    "write",
    "write_html",
]


AT_TOP = ("verdict", "claims", "faults", "alarms")
"""Anchors of the sections before the figures."""


@dataclass(frozen=True)
class Head:
    """Heading of a column; numbers are aligned right."""

    text: str
    number: bool = False


@dataclass(frozen=True)
class Cell:
    """A cell with an optional mark: "holds", "fails", "open", "warning" or "error"; and a link to an anchor."""

    text: str
    mark: str = ""
    anchor: str = ""


@dataclass(frozen=True)
class Section:
    """A table with text around it, and an optional figure."""

    anchor: str
    title: str
    before: Sequence[str] = ()
    svg: str = ""
    heads: Sequence[Head] = ()
    rows: Sequence[Sequence[Cell]] = ()
    after: Sequence[str] = ()


@dataclass
class Page:
    """Content of the page, in order."""

    title: str
    subtitle: str
    facts: list[tuple[str, str]]
    notes: list[str] = field(default_factory=list)
    sections: list[Section] = field(default_factory=list)
    summary: Drawn | None = None
    """The picture at the top."""
    figures: list[Drawn] = field(default_factory=list)
    style: str = ""
    """Folder of the figures in the style of a journal, beside those of the page; empty: there are none."""
    figures_note: str = ""
    scenario: str = ""

    @property
    def contents(self) -> list[tuple[str, str]]:
        """Return anchors and titles of the sections."""
        found = [(section.anchor, section.title) for section in self.sections]
        if self.figures:
            before = sum(anchor in AT_TOP for anchor, _ in found)
            found.insert(before, ("figures", "Figures"))
        if self.scenario:
            found.append(("scenario", "Scenario as flown"))
        return found


def write(page: Page, path: Path) -> Path:
    """Write a page as one HTML file that includes its figures, and return its path."""
    return write_html("page.html.jinja", path, **vars(page), contents=page.contents, at_top=AT_TOP)


def write_html(template: str, path: Path, beside: Path | None = None, **content: Any) -> Path:
    """Fill a template of this room, or of the folder ``beside``, write it as a page, and return its path."""
    import jinja2

    here = Path(__file__).parent
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader([here] if beside is None else [beside, here]),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(environment.get_template(template).render(**content), encoding="utf-8")
    return path


def verdict_section(verdict: Verdict) -> Section:
    """Return the verdict, its reasons, and all findings."""
    mark = {AS_IT_SHOULD: "holds", REMARKS: "warning", FAILED: "fails"}[verdict.word]
    rows = [[Cell("verdict"), Cell(""), Cell(verdict.word, mark), Cell("")]]
    rows += [[Cell(""), Cell(""), Cell(text, "error"), Cell("")] for text in verdict.failures]
    rows += [[Cell(""), Cell(""), Cell(text, "warning"), Cell("")] for text in verdict.remarks]
    for error in verdict.tracking:
        largest = f"{with_unit(error.largest, error.unit)} at {error.at:.1f} s"
        allowed = "" if error.allowed is None else f" ({with_unit(error.allowed, error.unit)} allowed)"
        end = (
            "" if error.end is None else f"in the end {with_unit(error.end, error.unit)}, UAV {error.end_uav}{allowed}"
        )
        rows.append([Cell(f"{error.meaning}, {error.name}"), Cell(str(error.uav)), Cell(largest), Cell(end)])
    for left in verdict.outside:
        until = "in the end" if left.at_end else f"until {left.until:.1f} s"
        rows.append([Cell(f"{left.name} left"), Cell(str(left.uav)), Cell(f"{left.seconds:.3g} s"), Cell(until)])
    for one in verdict.saturation:
        what = f"{one.actuator.replace('_', ' ')} at its limits"
        rows.append([Cell(what), Cell(str(one.uav)), Cell(f"{100.0 * one.share:.2g} % of the time"), Cell("")])
    for cycle in verdict.limit_cycles:
        about = f"+-{with_unit(cycle.amplitude, cycle.unit)}"
        what = f"limit cycle of {cycle.signal.replace('_', ' ')}"
        rows.append([Cell(what), Cell(str(cycle.uav)), Cell(f"{cycle.frequency:.3g} rad/s"), Cell(about)])
    heads = [Head("what"), Head("UAV"), Head("found"), Head("")]
    return Section("verdict", "Verdict", heads=heads, rows=rows)


_VERDICTS = {True: Cell("holds", "holds"), False: Cell("fails", "fails"), None: Cell("not flown", "open")}


def claims_section(results: Sequence[Result], case: str, shown: Mapping[int, Cell]) -> Section:
    """Return the claims of the scenario with expected and measured values.

    ``shown`` says where the signal of a claim is drawn, by the claim's place in ``results``.
    """
    if not results:
        return Section("claims", "Claims", before=[f"The scenario makes no claims for case {case}."])
    rows = []
    for n, result in enumerate(results):
        claim = result.claim
        start, end = claim.window
        verdict = _VERDICTS[result.ok]
        if result.remark and result.ok is False:
            verdict = Cell(f"{verdict.text} ({result.remark})", verdict.mark)
        rows.append(
            [
                Cell(claim.name),
                Cell(ids(result.uavs)),
                Cell(f"{start:g}" if start == end else f"{start:g} - {end:g}"),
                Cell(f"{number(result.value)} {claim.unit}" if result.value is not None else "-"),
                Cell(number(result.expected)),
                Cell(result.tolerance),
                verdict,
                shown.get(n, Cell("")),
                Cell(claim.source),
            ]
        )
    heads = [Head("claim"), Head("UAV"), Head("window, s"), Head("measured", True), Head("expected", True)]
    heads += [Head("tolerance"), Head("verdict"), Head("shown in"), Head("source")]
    return Section("claims", "Claims", before=[summary(results) + "."], heads=heads, rows=rows)


def compared_section(
    compared: Iterable[Compared], source: str, form: str, variants: Sequence[str], notes: Sequence[str]
) -> Section:
    """Return the comparison of the run with the monograph."""
    rows = []
    agreed = differing = 0
    for one in compared:
        verdict = {True: Cell("agrees", "holds"), False: Cell("differs", "fails"), None: Cell("-", "open")}[one.agrees]
        agreed += one.agrees is True
        differing += one.agrees is False
        unit = "" if one.unit in ("", "-") else f" {one.unit}"
        cells = [Cell(one.figure), Cell(one.what), Cell(one.monograph + unit), Cell(one.measured + unit)]
        rows.append([*cells, verdict, Cell(one.difference)])
    before = [
        f"Values in the figures and the text of {source}, compared with this run: {agreed} of {len(rows)} agree, "
        f"{differing} differ. A value read off a plot agrees within a quarter of its range."
    ]
    if form != "monograph" or variants:
        what = f"form {form}" + (f", variant {', '.join(variants)}" if variants else "")
        before.append(
            f"This run flew {what}; the monograph simulates the printed law in continuous time with ideal exchange "
            "(form monograph); differences are expected."
        )
    heads = [
        Head("figure"),
        Head("quantity"),
        Head("monograph", True),
        Head("this run", True),
        Head(""),
        Head("remark"),
    ]
    return Section("monograph", "Compared with the monograph", before, heads=heads, rows=rows, after=notes)


def events_section(events: Sequence[dict[str, Any]], svg: str) -> Section:
    """Return the events, as a timeline and a list."""
    if not events:
        return Section("events", "Events", before=["No events were recorded."])
    rows = []
    for event in events:
        severity = str(event.get("severity", "info"))
        text = str(event["text"])
        uav = event.get("uav")
        mark = "" if severity == "info" else severity
        rows.append([Cell(f"{float(event['t']):.2f}"), Cell("" if uav is None else str(uav)), Cell(text, mark)])
    heads = [Head("t, s", True), Head("UAV"), Head("event")]
    return Section("events", "Events", svg=svg, heads=heads, rows=rows)


def plural(count: int, what: str) -> str:
    """Return a count with its noun: 1 UAV, 2 UAVs."""
    return f"{count} {what}" + ("" if count == 1 else "s")
