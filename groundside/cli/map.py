"""The command ``ftcc map``."""

from __future__ import annotations

from typing import Annotated

import typer

from ftcc.groundside.cli.common import Duration, Form, Out, ScenarioName, Seed, Settings, Variants, fail, terminal
from ftcc.groundside.cli.study import Cluster, Jobs, fly_with_progress

__all__ = ["map_"]


def map_(
    scenario: ScenarioName,
    x: Annotated[str, typer.Option(metavar="KEY=LOW:HIGH:COUNT", help="Field along the horizontal axis.")],
    y: Annotated[str, typer.Option(metavar="KEY=LOW:HIGH:COUNT", help="Field along the vertical axis.")],
    claim: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Claim whose margin is drawn; default: the tracking error at the end."),
    ] = None,
    form: Form = None,
    variant: Variants = "",
    settings: Settings = None,
    seed: Seed = None,
    duration: Duration = None,
    jobs: Jobs = None,
    cluster: Cluster = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on in --out where a map was stopped.")] = False,
    out: Out = None,
) -> None:
    """Draw where a claim holds over two settings, and what theory says; the folder is that of a study."""
    from ftcc.groundside.studies import Map, axis_of, check_claim, draw_map, open_folder, plan_map

    if jobs is not None and jobs < 1:
        fail(f"--jobs {jobs}: must be at least 1")
    planned, faults = plan_map(
        scenario,
        axis_of(x, "--x"),
        axis_of(y, "--y"),
        form=form,
        variants=variant,
        settings=settings or [],
        seed=seed,
        duration=duration,
    )
    check_claim(planned, claim)
    folder = open_folder(planned, out, resume)
    say = terminal()
    for n in faults:
        say.print(f"faults.{n} flies without a level trim, too (without_trim = true)", markup=False, highlight=False)
    complete, last = fly_with_progress(planned, folder, jobs=jobs, cluster=cluster)
    if not complete:
        say.print(f"{last.flown} of {planned.count} flights, interrupted; to go on: the same command with --resume "
                  f"--out {folder}", markup=False, highlight=False, soft_wrap=True)  # fmt: skip
        raise typer.Exit(1)
    flown = Map(folder, claim)
    for sentence in flown.sentences():
        say.print(sentence, markup=False, highlight=False, soft_wrap=True)
    files = [folder / "study.parquet", *draw_map(flown, folder)]
    say.print(f"wrote {', '.join(map(str, files))}", markup=False, highlight=False, soft_wrap=True)
