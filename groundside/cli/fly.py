"""The command ``ftcc fly``."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast, get_args

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
    fail,
    judged,
    load_mission,
    new_run_folder,
    scenario_names,
    show_claims,
    speed_factor,
    terminal,
    warn,
)

if TYPE_CHECKING:
    from ftcc.groundside.dashboard import Event, Pace
    from ftcc.groundside.scenario import Mission
    from ftcc.groundside.swarm import FlightOptions, Outcome, Viewer
    from ftcc.link.addresses import Address
    from ftcc.link.ports import PortBlock

__all__ = ["fly"]

_FLIGHT_FAILED = 1
_LAST_SYSTEM = 239
"""Greatest MAVLink system id of a UAV."""

_COLOURS = {"info": "cyan", "warning": "yellow", "error": "bold red"}


def _pack(text: str, uavs: int) -> int:
    from ftcc.groundside.swarm import automatic_pack

    if text == "auto":
        return automatic_pack(uavs)
    if not text.isdecimal() or not 1 <= int(text) <= uavs:
        fail(f"--pack {text}: must be 'auto' or a number of vehicles per process from 1 to {uavs}")
    return int(text)


def _listeners(given: list[str] | None) -> tuple[Address, ...]:
    """Addresses of ground stations."""
    from ftcc.link.gcs_sockets import LISTENERS

    if given is None:
        return LISTENERS
    from ftcc.link.addresses import AddressError, resolve

    found = []
    for text in given:
        if text == "none":
            continue
        try:
            found.append(resolve(text))
        except AddressError as error:
            fail(f"--mavlink {text}: {error}")
    return tuple(dict.fromkeys(found))


def _check_key(key: Path | None, systems: Iterable[int]) -> None:
    """That the key can be used, and what was heard with it read; a warning where nothing new can be kept."""
    from ftcc.link.mavlink import AUTOPILOT
    from ftcc.link.signing import KeyFileError, Signing, read_key, stamps_file

    if key is None:
        return
    try:
        secret = read_key(key)
        memories = [Signing(secret, stamps_file(key, system, AUTOPILOT)) for system in systems]
    except KeyFileError as error:
        fail(f"--key {error}")
    if not all(memory.can_remember() for memory in memories):
        warn(
            f"--key {key}: the time stamps of received messages cannot be saved beside it, "
            "so commands of this flight could be replayed in the next one"
        )


def _check_systems(greatest: int, id_offset: int) -> None:
    """Beyond them are the systems of ground stations."""
    if not 0 <= id_offset <= _LAST_SYSTEM - greatest:
        fail(f"--id-offset {id_offset}: must be from 0 to {_LAST_SYSTEM - greatest} with UAVs up to {greatest}")


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
    factor = speed_factor(speed, "--speed")
    _check_choices(clock, factor, viewer)
    mission = load_mission(scenario, form, variant, settings, seed, duration)
    if not mission.wire:
        fail(f"form {mission.form!r} has ideal exchange and flies in one process only; use `ftcc simulate`")
    count = _pack(pack, len(mission.vehicles))
    listeners = _listeners(mavlink)
    uavs = [spec.uav for spec in mission.vehicles]
    _check_systems(max(uavs), id_offset)
    _check_key(key, [uav + id_offset for uav in uavs])

    from ftcc.groundside.swarm import FlightOptions, check_name, provide_files

    provide_files(mission, count, len(listeners))
    check_name(f"{mission.name}-20000101-000000-2" if out is None else out.name)
    ports = _reserve(uavs, port)
    options = FlightOptions(
        folder=new_run_folder(mission, out),
        lockstep=clock == "lockstep",
        speed=factor,
        pack=count,
        held=hold,
        viewer=cast("Viewer", viewer),
        open_browser=browser,
        listeners=listeners,
        key=key,
        id_offset=id_offset,
    )
    outcome, wall = _fly_on_the_terminal(mission, options, ports)
    _report(outcome, wall, mission, options.folder, strict)


def _check_choices(clock: str, factor: float, viewer: str) -> None:
    from ftcc.groundside.swarm import Clock, Viewer

    if clock not in get_args(Clock):
        fail(f"--clock {clock}: must be one of {', '.join(get_args(Clock))}")
    if clock == "wall" and math.isinf(factor):
        fail("--clock wall --speed max: the wall clock needs a factor; use --clock lockstep to fly as fast as possible")
    if viewer not in get_args(Viewer):
        fail(f"--viewer {viewer}: must be one of {', '.join(get_args(Viewer))}")


def _reserve(uavs: list[int], port: int | None) -> PortBlock:
    from ftcc.link.ports import PortError, reserve

    try:
        return reserve(uavs, port)
    except PortError as error:
        fail(str(error))


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
