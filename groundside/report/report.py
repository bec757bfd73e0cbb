"""Write a run's report: ``report/index.html`` and its figures, also for an incomplete run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ftcc.groundside.canvas import PAGE, Drawn, Look
from ftcc.groundside.claims import Result, evaluate
from ftcc.groundside.report.curves import Flown
from ftcc.groundside.report.definitions import Figure, Sheet, sheet_of
from ftcc.groundside.report.diagnosis import diagnosis_sections
from ftcc.groundside.report.drawing import draw, draw_timeline
from ftcc.groundside.report.lies import lies_section
from ftcc.groundside.report.links import links_section, network_section
from ftcc.groundside.report.overview import overview
from ftcc.groundside.report.page import (
    Cell,
    Head,
    Page,
    Section,
    claims_section,
    compared_section,
    events_section,
    plural,
    verdict_section,
    write,
)
from ftcc.groundside.report.plates import Plates, look_of
from ftcc.groundside.report.readings import compare
from ftcc.groundside.report.shown import figure_of_claims, links_of_claims
from ftcc.groundside.report.trust import trust_sections
from ftcc.groundside.results import NothingRecordedError, Run, sole_writer
from ftcc.groundside.verdict import is_diagnosed

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission

__all__ = ["draw_figures", "write_report"]


class _EmptyRecording:
    """A recording without rows."""

    uavs: tuple[int, ...] = ()
    names: tuple[str, ...] = ()

    def column(self, name: str, uav: int) -> Any:
        import numpy as np

        return np.empty(0)


def write_report(run: Run, folder: Path | None = None, style: str | None = None) -> Path:
    """Write the report of a run, complete or not, and return its page.

    The report of a run without a recording has its scenario, its events, and its claims marked as not flown. With a
    ``style``, a name in ``canvas.LOOKS``, the figures are also written in it, into a folder of its name.

    Raises
    ------
    UserError
        If there is no such style.
    BusyFolderError
        If another process is writing a report there.
    """
    look = look_of(style)
    with sole_writer(folder or run.path / "report"):
        return _write(run, folder or run.path / "report", look)


def _write(run: Run, folder: Path, look: Look) -> Path:
    mission = run.mission
    notes = []
    try:
        signals: Any = run
        end = run.end
    except NothingRecordedError as error:
        notes.append(f"{error}. The report shows the scenario and the log only.")
        signals, end = _EmptyRecording(), 0.0
    events = run.events
    results = evaluate(signals, mission.claims, mission.case, mission.graph)
    event_times = tuple(sorted({round(float(event["t"]), 3) for event in events}))
    flown = Flown(mission.case, signals, mission, event_times)
    sheet = sheet_of(mission)
    notes += _unfinished(run, mission, end)
    plates = Plates(folder, look, _caption([flown]))
    figures = list(_own_figures(sheet, [flown]))
    if (others := figure_of_claims(results, figures, flown)) is not None:
        figures.append(others)
    page = Page(
        title=mission.title,
        subtitle=_subtitle(run, mission),
        facts=[*([("verdict", run.verdict.word)] if signals is run else []), *_facts(run, mission, end, results)],
        notes=notes,
        figures=_draw(figures, [flown], plates),
        style="" if look is PAGE else look.name,
        figures_note=_figures_note(sheet, mission),
        scenario=mission.toml,
    )
    timeline = plates.add("timeline", "Events by time", "", lambda look: draw_timeline(events, mission, end, look))
    svg = "" if timeline is None else timeline.svg
    if signals is run:
        page.summary = overview(run, sheet, flown, results, plates)
        page.sections.append(verdict_section(run.verdict))
    page.sections.append(claims_section(results, mission.case, links_of_claims(results, figures, flown)))
    if signals is run and is_diagnosed(mission):
        page.sections += diagnosis_sections(run, plates)
    if sheet.source and mission.name in sheet.scenarios:
        compared = compare(sheet, flown)
        page.sections.append(compared_section(compared, sheet.source, mission.form, mission.variants, sheet.notes))
    page.sections.append(events_section(events, svg))
    if len(run.lies["t"]):
        page.sections.append(lies_section(run.lies, mission, plates))
    page.sections.append(links_section(run.links, mission, plates))
    if run.network:
        page.sections.append(network_section(run.network))
    page.sections += trust_sections(run.links, mission, plates)
    page.sections += _late_section(run)
    page.sections += _versions_section(run)
    return write(page, folder / "index.html")


def draw_figures(sheet: Sheet, flights: Sequence[Flown], folder: Path, look: Look = PAGE) -> list[Drawn]:
    """Draw and write all figures of a sheet for which the flights have data.

    Details show time windows of the sheet's own scenarios; they are left out for other scenarios.
    """
    return _draw(_own_figures(sheet, flights), flights, Plates(folder, look, _caption(flights)))


def _own_figures(sheet: Sheet, flights: Sequence[Flown]) -> list[Figure]:
    """Return the figures of a sheet, without details where the flights are of other scenarios."""
    if all(flight.mission.name in sheet.scenarios for flight in flights):
        return sheet.figures
    without = ([panel for panel in figure.panels if panel.window is None] for figure in sheet.figures)
    return [
        figure.model_copy(update={"panels": panels})
        for figure, panels in zip(sheet.figures, without, strict=True)
        if panels
    ]


def _draw(figures: Sequence[Figure], flights: Sequence[Flown], plates: Plates) -> list[Drawn]:
    drawn = []
    for figure in figures:

        def made(look: Look, figure: Figure = figure) -> Any | None:
            return draw(figure.panels, flights, figure.columns, look)

        number = f"Figure {figure.number}" if figure.number else ""
        drawn.append(plates.add(figure.name, figure.title, number, made))
    return [one for one in drawn if one is not None]


def _caption(flights: Sequence[Flown]) -> str:
    """Return what flew, for the captions of figures."""
    names = dict.fromkeys(f"scenario {flight.mission.name}, {flight.mission.case}" for flight in flights)
    return "; ".join(names)


def _subtitle(run: Run, mission: Mission) -> str:
    variants = f", variant {', '.join(mission.variants)}" if mission.variants else ""
    flown = f"Scenario {mission.name}, form {mission.form}{variants}"
    return f"{mission.scheme.title}. {flown}; run {run.path.resolve().name}."


def _facts(run: Run, mission: Mission, end: float, results: Sequence[Result]) -> list[tuple[str, str]]:
    held = sum(result.ok is True for result in results)
    timing = mission.timing
    facts = [
        ("claims that hold", f"{held} of {len(results)}" if results else "none made"),
        ("flown", f"{end:g} of {timing.duration:g} s"),
        (
            "swarm",
            f"{plural(len(mission.graph.followers), 'follower')}, {plural(len(mission.graph.leaders), 'leader')}",
        ),
        ("control", f"{1e6 / timing.period_us:g} Hz"),
        ("exchange", f"{1e6 / timing.exchange_us:g} Hz" if mission.wire else "ideal"),
        ("seed", str(timing.seed)),
        ("late ticks", _late(run, mission)),
        *_pace(run),
    ]
    flown = run.scenario.plan.flown
    if flown is not None and flown.settings:
        facts.append(("settings", ", ".join(flown.settings)))
    return facts


def _pace(run: Run) -> list[tuple[str, str]]:
    """Return the pace of a swarm of processes, and what limited it."""
    over = next((event for event in reversed(run.events) if event.get("factor")), None)
    if over is None:
        return []
    asked = "as fast as possible" if over["asked"] is None else f"requested {over['asked']:g}"
    facts = [("times real time", f"{over['factor']:.3g} ({asked})")]
    if over["limit"]:
        facts.append(("limited by", over["limit"]))
    return facts


def _late(run: Run, mission: Mission) -> str:
    for event in reversed(run.events):
        if "late" in event:
            return f"{event['late']} of {event['ticks']}"
    return "not known" if _has_processes(run) else "none (one process)"


def _has_processes(run: Run) -> bool:
    return (run.path / "parts").is_dir() or (run.path / "logs").is_dir()


def _unfinished(run: Run, mission: Mission, end: float) -> list[str]:
    """Return notes about lost UAVs and an early end, which limit what the numbers mean."""
    notes = [f"UAV {uav} lost at {t:.2f} s: {why}" for uav, (t, why) in run.lost.items()]
    over = any("flight over" in str(event["text"]) for event in run.events)
    step = mission.timing.record_every * mission.timing.period
    if end < mission.timing.duration - 1.5 * step:
        how = "" if over or not _has_processes(run) else " and did not end normally: the last seconds may be missing"
        notes.append(f"The flight ended at {end:g} s of {mission.timing.duration:g} s{how}.")
    return notes


def _figures_note(sheet: Sheet, mission: Mission) -> str:
    if sheet.source and mission.name in sheet.scenarios:
        return f"Same quantities and axes as the figures of {sheet.source}. Gray lines: events."
    if sheet.source:
        return f"Same quantities as the figures of {sheet.source}, for another scenario. Gray lines: events."
    return "Signals of the scheme: motion, errors with bounds, commands with limits. Gray lines: events."


def _late_section(run: Run) -> list[Section]:
    """Return late ticks by UAV, if there were any."""
    late_by_uav: dict[str, int] = next((event["late_of"] for event in reversed(run.events) if "late_of" in event), {})
    rows = [[Cell(f"UAV {uav}"), Cell(str(late))] for uav, late in late_by_uav.items() if late]
    if not rows:
        return []
    before = ["In these ticks a command arrived too late and the previous one was held: the computer was overloaded."]
    return [Section("late", "Late ticks", before, heads=[Head("UAV"), Head("late ticks", True)], rows=rows)]


def _versions_section(run: Run) -> list[Section]:
    flown = run.scenario.plan.flown
    if flown is None or not flown.versions:
        return []
    rows = [[Cell(name), Cell(version)] for name, version in sorted(flown.versions.items())]
    return [Section("versions", "Versions", heads=[Head("program"), Head("version")], rows=rows)]
