"""The command ``ftcc study``."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ftcc.groundside.cli.common import Duration, Form, Out, Seed, Settings, Variants, fail, scenario_names, terminal

if TYPE_CHECKING:
    from ftcc.groundside.studies import Progress, StudyPlan

__all__ = ["Cluster", "Jobs", "fly_with_progress", "study"]

Jobs = Annotated[int | None, typer.Option(help="Number of processes; default: one per core.")]
Cluster = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Fly on a Dask cluster instead: its scheduler's address, or local:N."),
]


def study(
    scenario: Annotated[
        str,
        typer.Argument(
            metavar="SCENARIO",
            help="A scenario, a TOML file with [study], or with --resume the folder of a study.",
            autocompletion=scenario_names,
        ),
    ],
    vary: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY.PATH=V1,V2", help="Values of a field; can be repeated: every combination is flown."),
    ] = None,
    random: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY.PATH=DIST(...)",
            help="Distribution of a field, by scipy's name: uniform(low=0, high=.6); can be repeated.",
        ),
    ] = None,
    samples: Annotated[int | None, typer.Option(help="Number of draws; with --until, the most.")] = None,
    seeds: Annotated[int | None, typer.Option(help="Flights per combination; seeds count up from --seed.")] = None,
    design: Annotated[str | None, typer.Option(help="sobol (default), lhs, or random for independent draws.")] = None,
    redraw: Annotated[
        bool | None, typer.Option("--redraw/--no-redraw", help="Draw again what cannot fly; default: a row says why.")
    ] = None,
    against: Annotated[
        list[str] | None,
        typer.Option(metavar="VARIANT", help="Fly every draw with this variant, too, and compare; can be repeated."),
    ] = None,
    until: Annotated[
        str | None, typer.Option(metavar="RULE", help="Stop when 'width < 0.01', or 'P(lost) < 1e-3 at 95 %'.")
    ] = None,
    sensitivity: Annotated[
        bool, typer.Option("--sensitivity", help="Sobol' indices: --samples times (quantities + 3) flights.")
    ] = False,
    jobs: Jobs = None,
    cluster: Cluster = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on where a study ended or was stopped.")] = False,
    form: Form = None,
    variant: Variants = "",
    duration: Duration = None,
    seed: Seed = None,
    out: Out = None,
    settings: Settings = None,
    record: Annotated[bool, typer.Option("--record", help="Also record every flight, in OUT/runs.")] = False,
) -> None:
    """Fly a scenario many times: over settings, seeds, and random values; say how often its claims hold."""
    from ftcc.groundside.statistics import DESIGNS, until_of
    from ftcc.groundside.studies import is_study, open_folder

    if jobs is not None and jobs < 1:
        fail(f"--jobs {jobs}: must be at least 1")
    if design is not None and design not in DESIGNS:
        fail(f"--design {design}: must be {', '.join(DESIGNS[:-1])} or {DESIGNS[-1]}")
    rule = until_of(until) if until is not None else None
    options: dict[str, Any] = {
        "vary": vary or [],
        "random": random or [],
        "samples": samples,
        "seeds": seeds,
        "design": design,
        "redraw": redraw,
        "against": against or [],
        "sensitivity": sensitivity,
        "form": form,
        "variants": variant,
        "settings": settings or [],
        "seed": seed,
        "duration": duration,
    }
    if resume and out is None and not is_study(scenario):
        fail(f"--resume: {scenario}: holds no study to go on with")
    if resume and is_study(scenario):
        planned, out = _resumed(Path(scenario), options), Path(scenario)
    else:
        planned = _planned(scenario, options, rule is not None)
    folder = open_folder(planned, out, resume)
    begun = time.monotonic()
    complete, last = fly_with_progress(planned, folder, jobs=jobs, cluster=cluster, until=rule, record=record)
    took = time.monotonic() - begun
    broken = _show(folder)
    terminal().print(
        f"{last.flown} of {planned.count} flights of {planned.mission.timing.duration:g} s"
        f"{'' if complete else ', interrupted'}; {took:.1f} s of wall time, {last.rate:.2f} flights a second",
        highlight=False,
        soft_wrap=True,
    )
    if not complete:
        terminal().print(f"to go on: ftcc study {folder} --resume", highlight=False, soft_wrap=True)
    if not complete or broken:
        raise typer.Exit(1)


def _planned(scenario: str, options: dict[str, Any], open_end: bool) -> StudyPlan:
    """The study that the options ask for."""
    from ftcc.groundside.studies import WITHOUT_END, is_study, plan_study

    if is_study(scenario):
        fail(f"{scenario}: is a study already; to go on with it: ftcc study {scenario} --resume")
    if open_end and options["samples"] is None and options["seeds"] is None:
        options = {**options, "samples": WITHOUT_END}
    return plan_study(scenario, options.pop("vary"), **options)


def _resumed(folder: Path, options: dict[str, Any]) -> StudyPlan:
    """The study of a folder; only the number of its draws may change."""
    from ftcc.groundside.studies import larger, load_plan

    given = [name for name, value in options.items() if value and name not in ("samples", "seeds")]
    if given:
        fail(f"--resume: {folder} says what flies; --{given[0]} cannot change it")
    plan = load_plan(folder)
    samples = options["samples"] or options["seeds"]
    return larger(plan, samples) if samples else plan


def fly_with_progress(planned: StudyPlan, folder: Path, **options: Any) -> tuple[bool, Progress]:
    """Fly a study with progress on the terminal; return whether none is missing, and how far it came."""
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
    from rich.progress import Progress as Bar

    from ftcc.groundside.statistics import Share
    from ftcc.groundside.studies import HEADLINE, Progress, fly_study, percent

    last = Progress(0, planned.count, 0.0, Share(0, 0, 0.0, 0.0, 1.0), 0, 0)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[left]}"))
    with Bar(*columns, console=terminal(stderr=True), transient=True) as bar:
        preparing = "preparing (the first start compiles for half a minute)"
        task = bar.add_task(preparing, total=planned.count, left="")

        def report(now: Progress) -> None:
            nonlocal last
            last = now
            text = f"{planned.name} {planned.case}: {HEADLINE} {percent(now.answer)}"
            text += f", {now.refused} refused" if now.refused else ""
            text += f", {now.broken} with losses or errors" if now.broken else ""
            left = f"{now.rate:.1f}/s, {_duration((now.of - now.flown) / now.rate)} left" if now.rate else ""
            bar.update(task, completed=now.flown, description=text, left=left)

        complete = fly_study(planned, folder, report=report, **options)
    return complete, last


def _duration(seconds: float) -> str:
    """A time as hours, minutes and seconds."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


def _show(folder: Path) -> int:
    """Draw the figures; show the answers, the errors, and what was written; return how many flights broke off."""
    from ftcc.groundside.studies import Study, show

    screen, read = terminal(), Study(folder)
    if not len(read.table):
        return 0
    show(screen, read.answers)
    files = [folder / "study.parquet", *read.draw()]
    screen.print(f"wrote {', '.join(map(str, files))}", markup=False, highlight=False, soft_wrap=True)
    broken = len(read.answers.errors(refused=False))
    return broken if read.plan.draws.quantities else broken + len(read.answers.errors(refused=True))
