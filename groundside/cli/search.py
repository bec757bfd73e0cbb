"""The command ``ftcc search``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from ftcc.groundside.cli.common import Duration, Form, Out, Seed, Settings, Variants, fail, scenario_names, terminal
from ftcc.groundside.cli.study import Cluster, Jobs

if TYPE_CHECKING:
    from ftcc.groundside.studies import Flown

__all__ = ["search"]


def search(
    scenario: Annotated[
        str,
        typer.Argument(
            metavar="SCENARIO", help="A scenario, or a TOML file with [study].", autocompletion=scenario_names
        ),
    ],
    over: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY.PATH=DIST(...)",
            help="What may change, and its distribution: uniform(low=0, high=.6); can be repeated.",
        ),
    ] = None,
    claim: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="What is to fail: a claim, or 'nobody lost'; default: the verdict."),
    ] = None,
    budget: Annotated[int, typer.Option(help="Number of flights before the boundary is refined.")] = 300,
    method: Annotated[
        str | None, typer.Option(help="cmaes (default), or tpe, which also searches a single quantity.")
    ] = None,
    jobs: Jobs = None,
    cluster: Cluster = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on in the folder of --out, where it was stopped.")
    ] = False,
    form: Form = None,
    variant: Variants = "",
    duration: Duration = None,
    seed: Seed = None,
    out: Out = None,
    settings: Settings = None,
) -> None:
    """Look for the mildest disturbance, fault or loss with which a claim fails."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    from ftcc.groundside.studies import draw_search, fly_search, open_search_folder, plan_search

    if jobs is not None and jobs < 1:
        fail(f"--jobs {jobs}: must be at least 1")
    planned = plan_search(
        scenario,
        over or [],
        claim=claim,
        budget=budget,
        method=method,
        form=form,
        variants=variant,
        settings=settings or [],
        seed=seed,
        duration=duration,
    )
    folder = open_search_folder(planned, out, resume)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, console=terminal(stderr=True), transient=True) as bar:
        task = bar.add_task("preparing (the first start compiles for half a minute)", total=budget)

        def report(landed: Sequence[Flown]) -> None:
            failing = [one.distance for one in landed if one.fails]
            nearest = f", the mildest at a distance of {min(failing):.3g}" if failing else ""
            text = f"{planned.study.name} {planned.study.case}: {len(failing)} failing{nearest}"
            bar.update(task, completed=len(landed), total=max(budget, len(landed)), description=text)

        found = fly_search(planned, folder, jobs=jobs, cluster=cluster, report=report)
    screen = terminal()

    def show(text: str) -> None:
        screen.print(text, markup=False, highlight=False, soft_wrap=True)

    if found is None:
        show(f"interrupted; to go on, repeat the command with --out {folder} --resume")
        raise typer.Exit(1)
    for sentence in found.sentences():
        show(sentence)
    files = [folder / "search.parquet", *draw_search(found, folder)]
    show(f"wrote {', '.join(map(str, files))}")
    if found.worst is not None:
        which = "the mildest failure" if found.failing else "the smallest margin"
        show(f"{which} again: ftcc simulate {folder / 'worst.toml'}")
