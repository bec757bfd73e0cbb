"""The command ``ftcc fly``."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn

from ftcc.groundside.cli.common import (
    Duration,
    Form,
    Out,
    Seed,
    Settings,
    Strict,
    Variants,
    judged,
    load_mission,
    scenario_names,
    show_claims,
    terminal,
)

if TYPE_CHECKING:
    from ftcc.groundside.dashboard import Event, Pace
    from ftcc.groundside.scenario import Mission
    from ftcc.groundside.swarm import FlightOptions, Outcome
    from ftcc.link.ports import PortBlock

__all__ = ["fly"]

_FLIGHT_FAILED = 1

_COLOURS = {"info": "cyan", "warning": "yellow", "error": "bold red"}


def fly(
    scenario: Annotated[
        str,
        typer.Argument(help="Name of a bundled scenario, or a TOML file.", autocompletion=scenario_names),
    ] = "demo",
    form: Form = None,
    variant: Variants = "",
    duration: Duration = None,
    seed: Seed = None,
    out: Out = None,
    settings: Settings = None,
    speed: Annotated[str, typer.Option(help="Highest number of simulated seconds per second, or 'max'.")] = "1",
    clock: Annotated[
        str,
        typer.Option(
            help="lockstep: all processes wait for each other, so a slow computer only flies slower; "
            "wall: nobody waits, and late commands are counted."
        ),
    ] = "lockstep",
    hold: Annotated[bool, typer.Option("--hold", help="Wait at t = 0 until `ftcc resume`.")] = False,
    viewer: Annotated[str, typer.Option(help="Where to show the dashboard: web, native or none.")] = "web",
    browser: Annotated[bool, typer.Option(help="Open the dashboard in the browser (web viewer).")] = True,
    pack: Annotated[str, typer.Option(help="Vehicles per process, or 'auto'.")] = "1",
    port: Annotated[int | None, typer.Option(help="First UDP port of the swarm; default: a free one.")] = None,
    mavlink: Annotated[
        list[str] | None,
        typer.Option(
            metavar="HOST:PORT", help="Address of a ground station, or none; can be repeated; default: 14550 and 14540."
        ),
    ] = None,
    key: Annotated[
        Path | None, typer.Option(help="Sign the links to the ground with this key file, see `ftcc keys`.")
    ] = None,
    id_offset: Annotated[
        int, typer.Option(help="Added to the MAVLink system ids, so that ground stations can tell two swarms apart.")
    ] = 0,
    strict: Strict = False,
) -> None:
    """Fly a swarm: a vehicle process and an autopilot process per UAV, with MAVLink, mesh and dashboard."""
    from ftcc.groundside.swarm import check_choices, prepare_flight, speed_factor

    factor = speed_factor(speed, "--speed")
    check_choices(clock, factor, viewer)
    mission = load_mission(scenario, form, variant, settings, seed, duration)
    options, ports = prepare_flight(
        mission,
        out,
        speed=factor,
        clock=clock,
        hold=hold,
        viewer=viewer,
        open_browser=browser,
        pack=pack,
        port=port,
        mavlink=mavlink,
        key=key,
        id_offset=id_offset,
    )
    outcome, wall = _fly_on_the_terminal(mission, options, ports)
    _report(outcome, wall, mission, options.folder, strict)


def _fly_on_the_terminal(mission: Mission, options: FlightOptions, ports: PortBlock) -> tuple[Outcome, float]:
    """Fly, with events and progress on the terminal; the outcome, and the wall time of the flight, s."""
    from ftcc.groundside.swarm import fly_swarm

    console = terminal()
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("t = {task.completed:.0f} s"),
        TextColumn("{task.fields[pace]}"),
        console=console,
    )
    begun = time.monotonic()

    def print_event(event: Event) -> None:
        who = f"UAV {event.uav}: " if event.uav else ""
        colour = _COLOURS.get(event.severity, "white")
        bar.console.print(f"[{colour}]{max(event.t, 0.0):8.2f} s[/]  {who}{escape(event.text)}", soft_wrap=True)

    def show_progress(t: float, pace: Pace) -> None:
        bar.update(task, completed=t, pace="" if math.isnan(pace.factor) else f"{pace.factor:.2g} x real time")

    def started(address: str | None) -> None:
        nonlocal begun
        begun = time.monotonic()
        bar.update(task, description=f"flying {mission.case}")
        if address:
            bar.console.print(f"dashboard: {address}", soft_wrap=True)
        if options.held:
            bar.console.print("held at t = 0; start it with `ftcc resume`")

    title = f"[bold]{escape(mission.title)}[/]: {len(mission.vehicles)} UAVs, run {options.folder}"
    console.print(title, soft_wrap=True)
    with bar:
        task = bar.add_task("starting", total=mission.timing.duration, pace="")
        try:
            outcome = fly_swarm(mission, options, ports, print_event, show_progress, started)
        except TimeoutError as error:
            console.print(f"[bold red]{escape(str(error))}[/]", soft_wrap=True)
            raise typer.Exit(_FLIGHT_FAILED) from error
    return outcome, time.monotonic() - begun


def _report(outcome: Outcome, wall: float, mission: Mission, folder: Path, strict: bool) -> None:
    """Claims, pace, dead processes and the verdict; exits with code 1 where the flight failed."""
    console, logs = terminal(), folder / "logs"
    if outcome.died and not outcome.ticks:
        died = ", ".join(outcome.died)
        console.print(f"[bold red]nothing flew: {died} died at the start[/]; see {logs}", soft_wrap=True)
        raise typer.Exit(_FLIGHT_FAILED)
    show_claims(folder)
    share = 100.0 * outcome.late / max(outcome.ticks, 1)
    flown = outcome.flown * mission.timing.period
    console.print(
        f"flew {flown:.1f} s in {wall:.1f} s ({flown / max(wall, 1e-9):.1f} times real time), "
        f"{outcome.late} of {outcome.ticks} ticks late ({share:.2f} %)"
    )
    if not outcome.ok:
        for name in outcome.died:
            console.print(f"[bold red]process {name} died[/]; see {logs}", soft_wrap=True)
    if outcome.verdict is not None:
        judged(outcome.verdict, strict)
    if not outcome.ok:
        raise typer.Exit(_FLIGHT_FAILED)
