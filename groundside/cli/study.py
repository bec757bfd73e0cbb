"""The command ``ftcc study``."""

from __future__ import annotations

import os
import time
from typing import TYPE_CHECKING, Annotated

import typer

from ftcc.groundside.cli.common import Duration, Form, Out, ScenarioName, Seed, Settings, Variants, fail, terminal

if TYPE_CHECKING:
    from ftcc.groundside.study import Outcome

__all__ = ["study"]


def study(
    scenario: ScenarioName,
    vary: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY.PATH=V1,V2", help="Values to fly; repeatable: every combination is flown."),
    ] = None,
    seeds: Annotated[int, typer.Option(help="Flights of each combination, with seeds counted up from --seed.")] = 1,
    jobs: Annotated[int | None, typer.Option(help="Processes; default: one per core.")] = None,
    form: Form = None,
    variant: Variants = "",
    duration: Duration = None,
    seed: Seed = None,
    out: Out = None,
    settings: Settings = None,
    record: Annotated[
        bool, typer.Option("--record", help="Record every flight in OUT/runs, as simulate does.")
    ] = False,
) -> None:
    """Fly a scenario many times in memory, on all cores, over values of its settings and seeds of its chance."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    from ftcc.groundside.results import new_folder
    from ftcc.groundside.study import draw, fly_all, plan_study, summary, write

    jobs = len(os.sched_getaffinity(0)) if jobs is None and hasattr(os, "sched_getaffinity") else jobs or os.cpu_count()
    if jobs is None or jobs < 1:
        fail(f"--jobs {jobs}: must be at least 1")
    variants = [one.strip() for one in variant.split(",") if one.strip()]
    planned = plan_study(
        scenario,
        vary or [],
        seeds=seeds,
        form=form,
        variants=variants,
        settings=settings or [],
        seed=seed,
        duration=duration,
    )
    mission, trials = planned.mission, planned.trials
    folder = new_folder(mission.name, out, "studies")
    (folder / "scenario.toml").write_text(mission.toml, encoding="utf-8")

    outcomes: list[Outcome] = []
    wrong = 0
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn(),
    )  # fmt: skip
    with Progress(*columns, console=terminal(stderr=True), transient=True) as progress:
        task = progress.add_task("preparing (the first start compiles for half a minute)", total=len(trials))
        begun = time.monotonic()

        def report(outcome: Outcome) -> None:
            nonlocal wrong
            outcomes.append(outcome)
            wrong += bool(outcome.error)
            text = f"flying {mission.name} {mission.case}" + (f", {wrong} with errors" if wrong else "")
            progress.update(task, completed=len(outcomes), description=text)

        complete = fly_all(planned, jobs, report, folder if record else None)
        took = time.monotonic() - begun

    screen = terminal()
    flown = [outcome for outcome in outcomes if not outcome.problem]
    if outcomes:
        files = [write(planned, outcomes, folder), *draw(planned, outcomes, folder)]
        screen.print(summary(planned, outcomes))
        for error, those in _errors(outcomes).items():
            screen.print(f"{those} x {error}", markup=False, highlight=False, soft_wrap=True)
        screen.print(f"wrote {', '.join(map(str, files))}", markup=False, highlight=False, soft_wrap=True)
    mean = sum(outcome.wall for outcome in flown) / len(flown) if flown else 0.0
    screen.print(
        f"{len(flown)} of {len(trials)} flights of {mission.timing.duration:g} s in {took:.1f} s of wall time "
        f"({jobs} processes, {mean:.2f} s a flight){'' if complete else ', interrupted'}",
        highlight=False,
        soft_wrap=True,
    )
    if not complete or len(flown) < len(trials):
        raise typer.Exit(1)


def _errors(outcomes: list[Outcome]) -> dict[str, int]:
    """What went wrong, and how often."""
    counted: dict[str, int] = {}
    for outcome in outcomes:
        if outcome.problem:
            counted[outcome.problem] = counted.get(outcome.problem, 0) + 1
    return counted
