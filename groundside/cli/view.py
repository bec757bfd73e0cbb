"""The commands that show a swarm: watch one that flies, replay one that has flown."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, cast

import typer

from ftcc.groundside.cli.common import fail, terminal, warn

if TYPE_CHECKING:
    from ftcc.groundside.dashboard import Dashboard, Event
    from ftcc.groundside.results import Run

__all__ = ["replay", "show_past", "watch"]

Kind = Literal["web", "native"]

_PAST_RATE, _PAST_PICTURES = 2.0, 400
"""How finely a swarm's past is drawn: at most so many pictures a simulated second, and so many in all."""
_LAG_TIMEOUT = 20.0
"""Longest wait for a viewer that is still starting, s."""

_Viewer = Annotated[str, typer.Option("--viewer", help="Where to show it: web or native.")]
_Browser = Annotated[bool, typer.Option(help="Open the dashboard in the browser (web viewer).")]


def _kind(viewer: str) -> Kind:
    if viewer not in ("web", "native"):
        fail(f"--viewer {viewer}: must be web or native")
    return cast(Kind, viewer)


def watch(
    name: Annotated[
        str | None, typer.Argument(help="Name of the swarm, see `ftcc ps`; needed if several are running.")
    ] = None,
    viewer: _Viewer = "web",
    browser: _Browser = True,
) -> None:
    """Show a running swarm in a dashboard; Ctrl-C closes it, and the swarm flies on."""
    from ftcc.groundside.dashboard import Dashboard, Subject, events_of, watch_swarm
    from ftcc.groundside.results import Run
    from ftcc.groundside.swarm import find_swarm

    kind = _kind(viewer)
    try:
        entry = find_swarm(name)
    except LookupError as error:
        fail(str(error))
    run = Run(entry.folder)
    dashboard = Dashboard(Subject.of(run.mission), recording=None, viewer=kind, open_browser=browser)
    out = terminal()
    try:
        if dashboard.address:
            out.print(f"dashboard: {dashboard.address}", soft_wrap=True, highlight=False)
        out.print(
            f"watching {entry.name}; Ctrl-C closes the dashboard, and the swarm flies on",
            soft_wrap=True,
            highlight=False,
        )
        with contextlib.suppress(KeyboardInterrupt):
            told: list[Event] | None = show_past(run, dashboard)
            for snapshot in watch_swarm(entry.name):
                if told is not None:
                    # What was logged between the past and the first news.
                    missed = [e for e in events_of(Run(entry.folder)) if e not in told and e not in snapshot.events]
                    dashboard.log(snapshot.after(tuple(missed)))
                    told = None
                else:
                    dashboard.log(snapshot)
                for problem in dashboard.take_problems():
                    warn(problem.text)
            out.print(f"{entry.name} has ended; Ctrl-C closes the dashboard", soft_wrap=True, highlight=False)
            dashboard.wait()
    except OSError as error:
        fail(f"{entry.name} cannot be watched: {error.strerror or error}")
    finally:
        dashboard.close()


def show_past(run: Run, dashboard: Dashboard) -> list[Event]:
    """Draw what a swarm has flown so far, coarser the longer it is, and return the events that were told with it.

    A viewer that does not keep up is spared the rest.
    """
    from ftcc.groundside.dashboard import snapshots_of
    from ftcc.groundside.results import NothingRecordedError

    told: list[Event] = []
    try:
        rate = min(_PAST_RATE, _PAST_PICTURES / max(run.end, 1.0))
        for snapshot in snapshots_of(run, rate):
            dashboard.log(snapshot, timeout=_LAG_TIMEOUT)
            told += snapshot.events
            if problems := dashboard.take_problems():
                warn(problems[0].text)
                break
    except NothingRecordedError:
        pass  # It has hardly started.
    return told


def replay(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run.")],
    viewer: _Viewer = "web",
    browser: _Browser = True,
    draw: Annotated[
        bool, typer.Option("--draw", help="Draw the recording of the dashboard again, from the signals.")
    ] = False,
) -> None:
    """Show a recorded run in the dashboard; Ctrl-C closes it."""
    from ftcc.groundside.dashboard import Viewer
    from ftcc.groundside.dashboard import draw_run as draw_recording
    from ftcc.groundside.results import Run

    kind = _kind(viewer)
    recorded = Run(run)
    out = terminal()
    file = recorded.path / "swarm.rrd"
    if draw or not file.is_file():
        out.print("drawing the recorded flight ...", highlight=False)
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
