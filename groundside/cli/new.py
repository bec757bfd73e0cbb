"""The command ``ftcc new``: a scenario from one line."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer

from ftcc.groundside.cli.common import fail, terminal, warn
from ftcc.groundside.cli.new_law import new_law

__all__ = ["new"]


def new(
    ctx: typer.Context,
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="The scenario to be written: NAME.toml; the folder of a law.")
    ],
    law: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Write the package of a control law into the folder FILE instead."),
    ] = None,
    scheme: Annotated[str, typer.Option(help="Control law; `ftcc list` names them.")] = "containment",
    followers: Annotated[int, typer.Option(help="Number of followers.")] = 6,
    leaders: Annotated[int | None, typer.Option(help="Number of leaders; default: what the scheme needs.")] = None,
    graph: Annotated[
        str, typer.Option(help="Who hears whom: ring, chain, star, grid, complete, nearest:K or random:P.")
    ] = "ring",
    directed: Annotated[bool, typer.Option("--directed", help="Records go one way along each edge.")] = False,
    seed: Annotated[int, typer.Option(help="Seed of the random graph, starts, faults and lost records.")] = 1,
    spacing: Annotated[float, typer.Option(help="Between neighbours side by side, or around a fire, m.")] = 40.0,
    faults: Annotated[int, typer.Option(help="Number of UAVs with an actuator fault.")] = 1,
    loss: Annotated[float, typer.Option(help="Share of records lost.")] = 0.0,
    duration: Annotated[float, typer.Option(help="Simulated time, s.")] = 60.0,
) -> None:
    """Write a scenario for a swarm of any size and graph, checked and flown before; or a control law to begin with."""
    if law is not None:
        given = [name for name in ctx.params if name not in ("file", "law") and _is_given(ctx, name)]
        if given:
            fail(f"--law: takes no --{', --'.join(given)}; change the scenario that comes with the law")
        new_law(law, file)
        return
    if file.suffix != ".toml" or file.name.count(".") > 1:
        fail(f"{file}: must be NAME.toml")
    if file.exists():
        fail(f"{file}: exists already; choose another name, or remove it")
    if not file.parent.is_dir():
        fail(f"{file}: there is no folder {file.parent}")
    from ftcc.groundside.generator import Request, make_scenario

    request = Request(scheme, followers, leaders, graph, directed, seed, spacing, faults, loss, duration)
    made = make_scenario(request, shlex.join(["ftcc", *sys.argv[1:]]))
    for text in made.warnings:
        warn(text)
    file.write_text(made.text, encoding="utf-8")
    out = terminal()
    out.print(
        f"{file}: {followers} followers, flown for {duration:g} s; all {len(made.results)} claims hold",
        markup=False,
        highlight=False,
        soft_wrap=True,
    )
    out.print(f"see it: ftcc fly {file}", markup=False, highlight=False, soft_wrap=True)


def _is_given(ctx: typer.Context, name: str) -> bool:
    source = ctx.get_parameter_source(name)
    return source is not None and source.name != "DEFAULT"
