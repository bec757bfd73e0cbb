"""The command that films a recorded flight."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from ftcc.groundside.cli.common import fail, terminal

__all__ = ["movie"]


def movie(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run.")],
    out: Annotated[
        Path | None, typer.Argument(metavar="[OUT.mp4|gif]", help="File to write; default: RUN/movie.mp4.")
    ] = None,
    seconds: Annotated[float, typer.Option(help="Length of the film, s.")] = 20.0,
    fps: Annotated[float, typer.Option(help="Frames per second.")] = 25.0,
    size: Annotated[str, typer.Option(metavar="WxH", help="Width and height, pixels.")] = "1280x720",
    begin: Annotated[float | None, typer.Option("--from", help="First simulated time, s.")] = None,
    end: Annotated[float | None, typer.Option("--to", help="Last simulated time, s.")] = None,
    dark: Annotated[bool, typer.Option("--dark", help="Light letters on dark.")] = False,
) -> None:
    """Film a recorded flight for slides: the swarm, its tracking errors, faults and link events."""
    from ftcc.groundside.movie import write_movie
    from ftcc.groundside.results import Run

    found = re.fullmatch(r"(\d+)x(\d+)", size)
    if found is None:
        fail(f"--size {size}: must be a width and a height in pixels, like 1280x720")
    pixels = int(found[1]), int(found[2])
    file = write_movie(Run(run), out, seconds=seconds, fps=fps, size=pixels, begin=begin, end=end, dark=dark)
    terminal(stderr=True).print(f"wrote {file}", markup=False, highlight=False, soft_wrap=True)
