"""The command ``ftcc calibrate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ftcc.groundside.cli.common import Duration, Form, ScenarioName, Seed, Settings, Variants, fail, terminal
from ftcc.groundside.cli.study import Cluster, Jobs

__all__ = ["calibrate"]


def calibrate(
    scenario: ScenarioName,
    hours: Annotated[
        float, typer.Option(help="Hours of healthy aircraft in flight that calibrate, and again that check, at least.")
    ] = 10.0,
    form: Form = None,
    variant: Variants = "",
    settings: Settings = None,
    seed: Seed = None,
    duration: Duration = None,
    jobs: Jobs = None,
    cluster: Cluster = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="File of the thresholds; default: SCENARIO.diagnosis.toml beside SCENARIO."),
    ] = None,
) -> None:
    """Find thresholds of diagnosis with which no healthy flight raises an alarm."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    from ftcc.groundside.studies import calibrate as fly
    from ftcc.groundside.studies import plan_calibration

    if jobs is not None and jobs < 1:
        fail(f"--jobs {jobs}: must be at least 1")
    planned = plan_calibration(
        scenario,
        hours=hours,
        form=form,
        variants=variant,
        settings=settings or [],
        seed=seed,
        duration=duration,
    )
    file = out if out is not None else planned.file.with_suffix(".diagnosis.toml")
    if not file.parent.is_dir():
        fail(f"--out {file}: there is no folder {file.parent}")
    if file.suffix != ".toml" or file.is_dir():
        fail(f"--out {file}: must be a file NAME.toml")
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, console=terminal(stderr=True), transient=True) as bar:
        task = bar.add_task("preparing (the first start compiles for half a minute)", total=planned.flights)

        def report(what: str, flown: int, of: int) -> None:
            bar.update(task, completed=flown, total=of, description=f"{planned.name} {planned.case}: {what}")

        found = fly(planned, jobs=jobs, cluster=cluster, report=report)
    screen = terminal()
    if found is None:
        screen.print("interrupted: nothing was written", highlight=False)
        raise typer.Exit(1)
    file.write_text(found.toml(), encoding="utf-8")
    screen.print(found.toml(), markup=False, highlight=False, soft_wrap=True, end="")
    screen.print(f"wrote {file}", markup=False, highlight=False, soft_wrap=True)
