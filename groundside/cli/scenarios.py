"""The commands that begin with a scenario and need no processes: list, check, simulate, verify."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ftcc.groundside.cli.common import (
    STRICTLY_FAILED,
    Duration,
    Form,
    Out,
    ScenarioName,
    Seed,
    Settings,
    Strict,
    Variants,
    fail,
    judged,
    load_mission,
    load_scenario,
    new_run_folder,
    show_summary,
    terminal,
    warn,
)

if TYPE_CHECKING:
    from pathlib import Path

    from ftcc.groundside.results import Run
    from ftcc.groundside.scenario import Mission, Scenario

__all__ = ["check", "list_all", "simulate", "verify"]


_SILENT = 10.0
"""Wall time after which a start that compiles says so, also where no bar is shown, s."""
_COMPILING = "compiling, once per version of the sources: half a minute, or some minutes on a busy computer"


def list_all() -> None:
    """List schemes and bundled scenarios, with their forms and variants."""
    from rich.table import Table

    from ftcc.airside import schemes
    from ftcc.groundside.scenario import shipped, summary

    def table(*headings: str) -> Table:
        made = Table(header_style="bold", box=None, pad_edge=False)
        for heading in headings:
            made.add_column(heading, overflow="fold", justify="right" if heading == "s" else "left")
        return made

    laws = table("scheme", "what it is", "forms")
    for name in schemes.names():
        title, forms = schemes.summary(name)
        laws.add_row(name, title, ", ".join(forms) or "-")
    scenarios = table("scenario", "what it flies", "s", "forms", "variants")
    for name, path in shipped().items():
        told = summary(path)
        scenarios.add_row(name, told.title, f"{told.duration:g}", ", ".join(told.forms), ", ".join(told.variants))
    out = terminal()
    out.print(laws)
    out.print()
    out.print(scenarios)


def check(
    scenario: ScenarioName,
    form: Form = None,
    variant: Variants = "",
    settings: Settings = None,
    where: Annotated[
        str | None,
        typer.Option(metavar="KEY", help="Only show which file, block and line a value came from: plant.lag.thrust."),
    ] = None,
) -> None:
    """Check a scenario without flying it: all cases with claims, or the one that the options name."""
    from ftcc.groundside.scenario import resolve, robustness_text
    from ftcc.groundside.simulation import cases_of, load_case

    first = load_scenario(scenario, form, variant, settings)
    if where is not None:
        _show_origin(first, where)
        return
    cases = {first.case: first}
    if form is None and not variant and first.plan.flown is None:
        cases |= {case: load_case(scenario, case, settings or []) for case in cases_of(first) if case != first.case}
    out = terminal()
    assert first.places is not None
    for file, held in first.places.files().items():
        out.print(f"{file.name}: {held}", markup=False, highlight=False, soft_wrap=not out.is_terminal)
    warned: dict[str, list[str]] = {}
    graphs: dict[str, None] = {}
    for case, chosen in cases.items():
        mission = resolve(chosen)
        timing = mission.timing
        exchange = f"{1e6 / timing.exchange_us:g} Hz" if mission.wire else "ideal"
        out.print(
            f"{mission.name} {case}: {len(mission.graph.followers)} followers, {len(mission.graph.leaders)} leaders, "
            f"{len(mission.graph.weights)} directed edges, {timing.duration:g} s, "
            f"control {1e6 / timing.period_us:g} Hz, exchange {exchange}, {len(mission.claims)} claims: can fly",
            highlight=False,
            soft_wrap=not out.is_terminal,
        )
        graphs[robustness_text(mission.scheme, mission.graph, mission.autopilots[0].defence)] = None
        for text in mission.warnings:
            warned.setdefault(text, []).append(case)
    for text in graphs:
        out.print(text, markup=False, highlight=False, soft_wrap=not out.is_terminal)
    for text, those in warned.items():
        where = f" {', '.join(those)}" if len(those) < len(cases) else ""
        warn(f"{first.name}{where}: {text}")


def _show_origin(scenario: Scenario, key: str) -> None:
    """Print the values at ``key``, each with the file, line and block that gave it last."""
    out = terminal()
    assert scenario.places is not None
    places = scenario.places.of(key)
    if not places:
        value = _at(scenario.plan.model_dump(by_alias=True), key)
        if value is None:
            fail(f"--where {key}: nothing in this scenario gives it, and it has no default")
        out.print(f"{key} = {value!r}: the default, no file gives it", markup=False, highlight=False)
    for leaf, place in places.items():
        value = repr(_at(scenario.source | scenario.document, leaf))
        given = f"{leaf} = {value if len(value) <= 80 else value[:77] + '...'}"
        at = f"{place}, {place.layer}" if place.file else place.layer
        same = "" if place.key == leaf else f" ({place.key})"
        out.print(f"{given}: {at}{same}", markup=False, highlight=False, soft_wrap=not out.is_terminal)


def _at(document: Any, key: str) -> Any:
    """The value at a path of keys, and of numbers in lists; None where there is none."""
    for part in key.split("."):
        if isinstance(document, dict):
            document = document.get(part)
        elif isinstance(document, list) and part.isdecimal() and int(part) < len(document):
            document = document[int(part)]
        else:
            return None
    return document


def simulate(
    scenario: ScenarioName,
    form: Form = None,
    variant: Variants = "",
    duration: Duration = None,
    seed: Seed = None,
    out: Out = None,
    settings: Settings = None,
    row: Annotated[
        int | None, typer.Option("--row", metavar="N", help="Fly flight N of a study: its folder, or its scenario.")
    ] = None,
    json: Annotated[
        bool, typer.Option("--json", help="Print progress, events and outcome as JSON, an object per line.")
    ] = False,
    strict: Strict = False,
) -> None:
    """Fly a scenario in one process, as fast as possible, and record it."""
    from rich.progress import BarColumn, Progress, TextColumn

    from ftcc.groundside.simulation import simulate as simulate_mission

    if row is None:
        mission = load_mission(scenario, form, variant, settings, seed, duration)
    else:
        mission = _mission_of_row(scenario, row, form, variant, settings, seed, duration)
    folder = new_run_folder(mission, out)
    if json:
        _simulate_in_lines(mission, folder, strict)
        return
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("t = {task.completed:.0f} s"))
    with Progress(*columns, console=terminal(stderr=True), transient=True) as progress:
        task = progress.add_task("preparing (the first start compiles for half a minute)", total=None)
        compiling = threading.Timer(_SILENT, lambda: progress.console.print(_COMPILING, soft_wrap=True))
        compiling.daemon = True
        compiling.start()

        def ready() -> None:
            compiling.cancel()
            progress.update(
                task, description=f"simulating {mission.name} {mission.case}", total=mission.timing.duration
            )

        try:
            run = simulate_mission(mission, folder, lambda t: progress.update(task, completed=t), ready)
        finally:
            compiling.cancel()
    _show_divergence(run)
    show_summary(folder, run.claims())
    judged(run.verdict, strict)
    if run.lost or run.verdict.flown < mission.timing.duration:
        raise typer.Exit(1)


def _simulate_in_lines(mission: Mission, folder: Path, strict: bool) -> None:
    """Fly and record a mission, and print it as JSON lines; its events follow the flight."""
    from ftcc.groundside.cli.flight_output import JSON_PERIOD, print_end, print_line, print_start
    from ftcc.groundside.simulation import simulate as simulate_mission
    from ftcc.groundside.verdict import FAILED

    begun = last = time.monotonic()

    def ready() -> None:
        nonlocal begun
        begun = time.monotonic()
        print_line("ready")

    def progress(t: float) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= JSON_PERIOD:
            last = now
            print_line("progress", t=t, wall=now - begun)

    print_start(mission, folder)
    run = simulate_mission(mission, folder, progress, ready)
    wall = time.monotonic() - begun
    for event in run.events:
        print_line("event", **{name: event[name] for name in ("t", "severity", "uav", "text")})
    incomplete = bool(run.lost) or run.verdict.flown < mission.timing.duration
    code = STRICTLY_FAILED if strict and run.verdict.word == FAILED else int(incomplete)
    print_end(folder, run.verdict, run.verdict.flown, wall, code)
    if code:
        raise typer.Exit(code)


def _show_divergence(run: Run) -> None:
    """Print which number of a law was not finite; that a UAV is lost by it says the verdict."""
    from ftcc.airside.law_errors import NOT_FINITE

    out = terminal(stderr=True)
    for event in run.events:
        if NOT_FINITE in event["text"]:
            text = f"{event['t']:8.2f} s  UAV {event['uav']}: {event['text']}"
            out.print(text, style="bold red", markup=False, highlight=False, soft_wrap=not out.is_terminal)


def _mission_of_row(
    study: str,
    row: int,
    form: str | None,
    variant: str,
    settings: list[str] | None,
    seed: int | None,
    duration: float | None,
) -> Mission:
    """One flight of a study: of its folder, or as the study of a file would fly it."""
    from ftcc.groundside.studies import is_study, load_plan, mission_of_row, plan_study

    if is_study(study):
        if form or variant or settings or seed is not None or duration is not None:
            fail(f"--row: {study} says what flies; it takes no other options")
        plan = load_plan(study)
    else:
        options = {"form": form, "variants": variant, "settings": settings or [], "seed": seed, "duration": duration}
        plan = plan_study(study, **options)  # type: ignore[arg-type]
    if not 0 <= row < plan.count:
        fail(f"--row {row}: the study has flights 0 to {plan.count - 1}")
    return mission_of_row(plan, row)


def verify(
    scenario: ScenarioName,
    cases: Annotated[
        list[str] | None,
        typer.Option("--case", metavar="CASE", help="Only this case, such as flight+off; can be repeated."),
    ] = None,
    every: Annotated[bool, typer.Option("--all", help="Also show the claims that hold.")] = False,
    settings: Settings = None,
) -> None:
    """Check all claims of a scenario, in one process, without recording; exit code 1 if a claim fails."""
    from ftcc.groundside.claims import failed
    from ftcc.groundside.report import claims_table, summary
    from ftcc.groundside.simulation import cases_of, claims_in_flight, load_case

    first = load_scenario(scenario, None, "", settings)
    out = terminal()
    failures = 0
    for case in cases or cases_of(first):
        flight, results = claims_in_flight(load_case(scenario, case, settings or []))
        lost = "".join(f"; UAV {uav} lost at {t:g} s: {why}" for uav, (t, why) in flight.lost.items())
        out.print(f"{case}: {summary(results)}{lost}", markup=False, highlight=False, soft_wrap=not out.is_terminal)
        failures += len(failed(results))
        if shown := results if every else failed(results):
            out.print(claims_table(shown))
    if failures:
        raise typer.Exit(1)
