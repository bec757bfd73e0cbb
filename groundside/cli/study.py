"""The command ``ftcc study``."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ftcc.groundside.cli.common import Duration, Form, Out, ScenarioName, Seed, Settings, Variants, fail, terminal

if TYPE_CHECKING:
    from ftcc.groundside.study import Outcome, Study

__all__ = ["study"]


def study(
    scenario: ScenarioName,
    vary: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY.PATH=V1,V2", help="Values of a field; can be repeated: every combination is flown."),
    ] = None,
    seeds: Annotated[int, typer.Option(help="Flights per combination; seeds count up from --seed.")] = 1,
    jobs: Annotated[int | None, typer.Option(help="Number of processes; default: one per core.")] = None,
    form: Form = None,
    variant: Variants = "",
    duration: Duration = None,
    seed: Seed = None,
    out: Out = None,
    settings: Settings = None,
    record: Annotated[bool, typer.Option("--record", help="Also record every flight, in OUT/runs.")] = False,
) -> None:
    """Fly a scenario many times, on all cores, over settings and seeds."""
    from ftcc.groundside.results import new_folder
    from ftcc.groundside.study import plan_study

    processes = _processes(jobs)
    planned = plan_study(
        scenario,
        vary or [],
        seeds=seeds,
        form=form,
        variants=[one.strip() for one in variant.split(",") if one.strip()],
        settings=settings or [],
        seed=seed,
        duration=duration,
    )
    folder = new_folder(planned.mission.name, out, "studies")
    (folder / "scenario.toml").write_text(planned.mission.toml, encoding="utf-8")
    begun = time.monotonic()
    outcomes, complete = _fly_all(planned, processes, folder if record else None)
    took = time.monotonic() - begun
    if outcomes:
        _show_results(planned, outcomes, folder)
    flown = [outcome for outcome in outcomes if not outcome.problem]
    mean = sum(outcome.wall for outcome in flown) / len(flown) if flown else 0.0
    terminal().print(
        f"{len(flown)} of {len(planned.trials)} flights of {planned.mission.timing.duration:g} s in {took:.1f} s of "
        f"wall time ({processes} processes, {mean:.2f} s a flight){'' if complete else ', interrupted'}",
        highlight=False,
        soft_wrap=True,
    )
    if not complete or len(flown) < len(planned.trials):
        raise typer.Exit(1)


def _processes(jobs: int | None) -> int:
    """How many to use: as many as asked for, or one for each core that this process may use."""
    if jobs is None:
        jobs = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if jobs < 1:
        fail(f"--jobs {jobs}: must be at least 1")
    return jobs


def _fly_all(planned: Study, processes: int, record_in: Path | None) -> tuple[list[Outcome], bool]:
    """Fly all trials, with progress on the terminal; their outcomes, and whether none is missing."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    from ftcc.groundside.study import fly_all

    outcomes: list[Outcome] = []
    wrong = 0
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn(),
    )  # fmt: skip
    with Progress(*columns, console=terminal(stderr=True), transient=True) as progress:
        preparing = "preparing (the first start compiles for half a minute)"
        task = progress.add_task(preparing, total=len(planned.trials))

        def report(outcome: Outcome) -> None:
            nonlocal wrong
            outcomes.append(outcome)
            wrong += bool(outcome.error)
            text = f"flying {planned.mission.name} {planned.mission.case}" + (f", {wrong} with errors" if wrong else "")
            progress.update(task, completed=len(outcomes), description=text)

        complete = fly_all(planned, processes, report, record_in)
    return outcomes, complete


def _show_results(planned: Study, outcomes: list[Outcome], folder: Path) -> None:
    """Write the table and the figure; show the summary, the errors, and what was written."""
    from ftcc.groundside.study import draw, summary, write

    screen = terminal()
    files = [write(planned, outcomes, folder), *draw(planned, outcomes, folder)]
    screen.print(summary(planned, outcomes))
    for error, those in _errors(outcomes).items():
        screen.print(f"{those} x {error}", markup=False, highlight=False, soft_wrap=True)
    screen.print(f"wrote {', '.join(map(str, files))}", markup=False, highlight=False, soft_wrap=True)


def _errors(outcomes: list[Outcome]) -> dict[str, int]:
    """What went wrong, and how often."""
    counted: dict[str, int] = {}
    for outcome in outcomes:
        if outcome.problem:
            counted[outcome.problem] = counted.get(outcome.problem, 0) + 1
    return counted
