"""The commands that show a swarm: watch one that flies, replay one that has flown."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Annotated, Literal, cast

import typer

from ftcc.groundside.cli_common import fail, terminal, warn

__all__ = ["register"]

Kind = Literal["web", "native"]

_Viewer = Annotated[str, typer.Option("--viewer", help="web or native.")]
_Browser = Annotated[bool, typer.Option(help="Open the dashboard in a browser (web viewer).")]


def register(app: typer.Typer) -> None:
    """Add the commands to ``app``."""
    for command in (watch, replay):
        app.command()(command)


def _kind(viewer: str) -> Kind:
    if viewer not in ("web", "native"):
        fail(f"--viewer {viewer}: must be web or native")
    return cast(Kind, viewer)


def watch(
    name: Annotated[str | None, typer.Argument(help="Name as `ftcc ps` shows it; needed if several fly.")] = None,
    viewer: _Viewer = "web",
    browser: _Browser = True,
) -> None:
    """Show a running swarm from now on; Ctrl-C detaches, and the swarm flies on."""
    from ftcc.groundside.dashboard import Dashboard, Subject
    from ftcc.groundside.feed import watched
    from ftcc.groundside.registry import find
    from ftcc.groundside.run import Run
    from ftcc.groundside.snapshot import Event

    kind = _kind(viewer)
    try:
        entry = find(name)
    except LookupError as error:
        fail(str(error))
    run = Run(entry.folder)
    dashboard = Dashboard(Subject.of(run.mission), recording=None, viewer=kind, open_browser=browser)
    out = terminal()
    try:
        if dashboard.address:
            out.print(f"dashboard: {dashboard.address}", soft_wrap=True, highlight=False)
        out.print(f"watching {entry.name}; Ctrl-C detaches", soft_wrap=True, highlight=False)
        before = tuple(Event(float(e["t"]), str(e["severity"]), str(e["text"]), e.get("uav")) for e in run.events)
        with contextlib.suppress(KeyboardInterrupt):
            for snapshot in watched(entry.name):
                earlier = tuple(event for event in before if event not in snapshot.events)
                dashboard.log(snapshot if not earlier else snapshot.after(earlier))
                before = ()
                for problem in dashboard.take_problems():
                    warn(problem.text)
            out.print(f"{entry.name} has landed; Ctrl-C closes the dashboard", soft_wrap=True, highlight=False)
            dashboard.wait()
    except OSError as error:
        fail(f"{entry.name} cannot be watched: {error.strerror or error}")
    finally:
        dashboard.close()


def replay(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A run's folder.")],
    viewer: _Viewer = "web",
    browser: _Browser = True,
    draw: Annotated[bool, typer.Option("--draw", help="Draw the dashboard's recording anew from the signals.")] = False,
) -> None:
    """Show a recorded run in the dashboard; Ctrl-C ends it."""
    from ftcc.groundside.dashboard.viewer import Viewer
    from ftcc.groundside.replay import draw as draw_recording
    from ftcc.groundside.run import Run

    kind = _kind(viewer)
    recorded = Run(run)
    out = terminal()
    file = recorded.path / "swarm.rrd"
    if draw or not file.is_file():
        out.print("drawing what was recorded ...", highlight=False)
        draw_recording(recorded, file)
    shown = Viewer(kind, None, browser, None, file.resolve())
    try:
        if shown.address:
            out.print(f"dashboard: {shown.address}", soft_wrap=True, highlight=False)
        with contextlib.suppress(KeyboardInterrupt):
            shown.wait()
        if problem := shown.take_problem():
            warn(problem)
    finally:
        shown.close()
