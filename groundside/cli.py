"""The command line ``ftcc``: scenarios, single-process flights and reports. Flights as processes are in `cli_fly`."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Annotated

import typer

from ftcc.groundside import cli_airframe, cli_fly, cli_ground, cli_study, cli_view
from ftcc.groundside.cli_common import (
    Duration,
    Form,
    Out,
    ScenarioName,
    Seed,
    Settings,
    Variants,
    fail,
    load_mission,
    load_scenario,
    new_run_folder,
    show_summary,
    terminal,
    warn,
)
from ftcc.groundside.errors import UserError

__all__ = ["app", "main"]

app = typer.Typer(
    name="ftcc",
    help="Software in the loop for swarms of fixed-wing UAVs under fault-tolerant cooperative control.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


@app.command("list")
def list_all() -> None:
    """List schemes and shipped scenarios with their forms and variants."""
    from rich.table import Table

    from ftcc.airside import schemes
    from ftcc.airside.scheme import SchemeError
    from ftcc.groundside.scenario import forms_and_variants, read, shipped

    def table(*headings: str) -> Table:
        made = Table(header_style="bold", box=None, pad_edge=False)
        for heading in headings:
            made.add_column(heading, overflow="fold", justify="right" if heading == "s" else "left")
        return made

    laws = table("scheme", "what it is", "forms")
    for name in schemes.names():
        try:
            scheme = schemes.find(name)
        except SchemeError as error:
            laws.add_row(name, str(error), "-")
        else:
            laws.add_row(name, scheme.title, ", ".join(scheme.forms))
    scenarios = table("scenario", "what it flies", "s", "forms", "variants")
    for name, path in shipped().items():
        document = read(path)
        forms, variants = forms_and_variants(document)
        length = f"{document.get('duration', 0.0):g}"
        scenarios.add_row(name, document.get("title", ""), length, ", ".join(forms), ", ".join(variants))
    out = terminal()
    out.print(laws)
    out.print()
    out.print(scenarios)


@app.command()
def check(scenario: ScenarioName, form: Form = None, variant: Variants = "", settings: Settings = None) -> None:
    """Check a scenario without flying it: every case that it makes claims for, or the one that is asked for."""
    from ftcc.groundside.cases import cases_of, load_case
    from ftcc.groundside.mission import resolve

    first = load_scenario(scenario, form, variant, settings)
    cases = {first.case: first}
    if form is None and not variant and first.plan.flown is None:
        cases |= {case: load_case(scenario, case, settings or []) for case in cases_of(first) if case != first.case}
    out = terminal()
    warned: dict[str, list[str]] = {}
    for case, chosen in cases.items():
        mission = resolve(chosen)
        timing = mission.timing
        exchange = f"{1e6 / timing.exchange_us:g} Hz" if mission.wire else "ideal"
        out.print(
            f"{mission.name} {case}: {len(mission.graph.followers)} followers, {len(mission.graph.leaders)} leaders, "
            f"{len(mission.graph.weights)} directed edges, {timing.duration:g} s, "
            f"control {1e6 / timing.period_us:g} Hz, exchange {exchange}, {len(mission.claims)} claims: can fly",
            highlight=False,
            soft_wrap=True,
        )
        for text in mission.warnings:
            warned.setdefault(text, []).append(case)
    for text, those in warned.items():
        where = f" {', '.join(those)}" if len(those) < len(cases) else ""
        warn(f"{first.name}{where}: {text}")


@app.command()
def simulate(
    scenario: ScenarioName,
    form: Form = None,
    variant: Variants = "",
    duration: Duration = None,
    seed: Seed = None,
    out: Out = None,
    settings: Settings = None,
) -> None:
    """Fly a scenario in one process, as fast as this machine can, and record it."""
    from rich.progress import BarColumn, Progress, TextColumn

    from ftcc.groundside.simulate import simulate as fly_and_record

    mission = load_mission(scenario, form, variant, settings, seed, duration)
    folder = new_run_folder(mission, out)
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("t = {task.completed:.0f} s"))
    with Progress(*columns, console=terminal(stderr=True), transient=True) as progress:
        task = progress.add_task("preparing (the first start compiles for half a minute)", total=None)
        flying = f"simulating {mission.name} {mission.case}"
        run = fly_and_record(
            mission,
            folder,
            lambda t: progress.update(task, completed=t),
            lambda: progress.update(task, description=flying, total=mission.timing.duration),
        )
    show_summary(folder)
    for uav, text in run.lost.items():
        warn(f"UAV {uav}: {text}")
    interrupted = run.end < mission.timing.duration - mission.timing.period * mission.timing.record_every
    if run.lost or interrupted:
        raise typer.Exit(1)


@app.command()
def verify(
    scenario: ScenarioName,
    cases: Annotated[
        list[str] | None, typer.Option("--case", metavar="CASE", help="Only this one, such as flight+off; repeatable.")
    ] = None,
    every: Annotated[bool, typer.Option("--all", help="Show the claims that hold, too.")] = False,
    settings: Settings = None,
) -> None:
    """Fly every case that a scenario makes claims for, in one process, unrecorded; exit code 1 if a claim fails."""
    from ftcc.groundside.cases import cases_of, claims_in_flight, load_case
    from ftcc.groundside.claims import failed
    from ftcc.groundside.report import claims_table, summary

    first = load_scenario(scenario, None, "", settings)
    out = terminal()
    failures = 0
    for case in cases or cases_of(first):
        flight, results = claims_in_flight(load_case(scenario, case, settings or []))
        lost = "".join(f"; UAV {uav} lost at {t:g} s: {why}" for uav, (t, why) in flight.lost.items())
        out.print(f"{case}: {summary(results)}{lost}", markup=False, highlight=False, soft_wrap=True)
        failures += len(failed(results))
        if shown := results if every else failed(results):
            out.print(claims_table(shown))
    if failures:
        raise typer.Exit(1)


@app.command()
def report(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A run's folder.")],
    json: Annotated[bool, typer.Option("--json", help="Print the claims as JSON.")] = False,
    csv: Annotated[Path | None, typer.Option(metavar="FILE", help="Export the recording as CSV.")] = None,
    mat: Annotated[Path | None, typer.Option(metavar="FILE", help="Export the recording for MATLAB.")] = None,
    page: Annotated[bool, typer.Option(help="Write RUN/report: a page with all figures.")] = True,
) -> None:
    """Show what a run recorded and whether its scenario's claims hold; exit code 1 if one fails."""
    from ftcc.groundside.claims import failed
    from ftcc.groundside.report import as_json, claims_of, show
    from ftcc.groundside.report.report import write_report
    from ftcc.groundside.run import NothingRecordedError, Run, RunError

    recorded = Run(run)
    written = terminal(stderr=True)
    try:
        results = claims_of(recorded)
    except NothingRecordedError as error:
        if json or csv or mat:
            raise
        warn(str(error))
        if page:
            written.print(f"wrote {write_report(recorded)}", highlight=False, soft_wrap=True)
        raise typer.Exit(1) from None
    if json:
        print(as_json(recorded, results))
    else:
        show(terminal(), recorded, results)
    for option, file, export in (("--csv", csv, recorded.export_csv), ("--mat", mat, recorded.export_mat)):
        if file is not None:
            try:
                export(file)
            except OSError as error:
                raise RunError(f"{option} {file}: cannot be written: {error.strerror or error}") from None
            written.print(f"wrote {file}", highlight=False, soft_wrap=True)
    if page and not json:
        written.print(f"wrote {write_report(recorded)}", highlight=False, soft_wrap=True)
    if failed(results):
        raise typer.Exit(1)


@app.command()
def compare(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN RUN...", help="Folders of runs of one scheme.")],
    out: Annotated[Path, typer.Option(help="Folder of the page and its figures.")] = Path("runs/compared"),
) -> None:
    """Lay runs over each other: the same figures with a colour per run, and one table of claims."""
    from rich.table import Table
    from rich.text import Text

    from ftcc.groundside.report.comparison import Comparison
    from ftcc.groundside.run import Run, RunError

    if len(runs) < 2:
        raise RunError("compare needs two runs or more")
    comparison = Comparison([Run(path) for path in runs])
    heads, rows = comparison.rows()
    table = Table(header_style="bold", pad_edge=False)
    for head in heads:
        table.add_column(head.text, justify="right" if head.number else "left", overflow="fold")
    styles = {"holds": "green", "fails": "bold red", "open": "dim"}
    for row in rows:
        table.add_row(*(Text(cell.text, styles.get(cell.mark, "")) for cell in row))
    terminal().print(table)
    try:
        page = comparison.write(out)
    except OSError as error:
        raise RunError(f"--out {out}: cannot be written: {error.strerror or error}") from None
    terminal(stderr=True).print(f"wrote {page}", highlight=False, soft_wrap=True)


cli_airframe.register(app)
cli_fly.register(app)
cli_view.register(app)
cli_ground.register(app)
cli_study.register(app)


def main() -> None:
    """Entry point: bad input ends with one message and exit code 2."""
    warnings.showwarning = lambda message, *_, **__: warn(str(message))
    try:
        app()
    except UserError as error:
        fail(str(error))


if __name__ == "__main__":
    main()
