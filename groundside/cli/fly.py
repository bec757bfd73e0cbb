"""The commands that deal with running swarms: fly, ps, stop, doctor."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast, get_args

import typer
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn
from rich.table import Table

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
    from ftcc.groundside.dashboard import Pace
    from ftcc.groundside.swarm import Entry
    from ftcc.link.addresses import Address

__all__ = ["doctor", "fly", "ps", "stop"]

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
    from ftcc.link.ground import LISTENERS

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
            f"--key {key}: the time stamps of what is heard cannot be kept beside it: "
            "commands of this flight could be repeated in the next one"
        )


def _check_systems(greatest: int, id_offset: int) -> None:
    """Beyond them are the systems of ground stations."""
    if not 0 <= id_offset <= _LAST_SYSTEM - greatest:
        fail(f"--id-offset {id_offset}: must be from 0 to {_LAST_SYSTEM - greatest} with UAVs up to {greatest}")


def fly(
    scenario: Annotated[
        str,
        typer.Argument(help="A shipped scenario or the path of a TOML file.", autocompletion=scenario_names),
    ] = "demo",
    form: Form = None,
    variant: Variants = "",
    duration: Duration = None,
    seed: Seed = None,
    out: Out = None,
    settings: Settings = None,
    speed: Annotated[str, typer.Option(help="Simulated seconds per second, at most, or 'max'.")] = "1",
    clock: Annotated[
        str,
        typer.Option(
            help="lockstep: all wait for each other, a slow computer flies slower; wall: who is late, is late."
        ),
    ] = "lockstep",
    hold: Annotated[bool, typer.Option("--hold", help="Stay at t = 0 until `ftcc resume`.")] = False,
    viewer: Annotated[str, typer.Option(help="web, native or none.")] = "web",
    browser: Annotated[bool, typer.Option(help="Open the dashboard in a browser (web viewer).")] = True,
    pack: Annotated[str, typer.Option(help="Vehicles per process, or 'auto'.")] = "1",
    port: Annotated[int | None, typer.Option(help="First port of the swarm's block; default: a free one.")] = None,
    mavlink: Annotated[
        list[str] | None,
        typer.Option(metavar="HOST:PORT", help="Where a ground station listens, or none; default: 14550, 14540."),
    ] = None,
    key: Annotated[Path | None, typer.Option(help="Key file: sign the links to the ground, see `ftcc keys`.")] = None,
    id_offset: Annotated[
        int, typer.Option(help="Add this to the UAVs' ids in MAVLink, so that ground stations tell two swarms apart.")
    ] = 0,
    strict: Strict = False,
) -> None:
    """Fly a swarm: a vehicle and an autopilot process per UAV, MAVLink, the mesh, the dashboard."""
    from ftcc.groundside.swarm import Clock, Viewer

    factor = speed_factor(speed, "--speed")
    if clock not in get_args(Clock):
        fail(f"--clock {clock}: must be one of {', '.join(get_args(Clock))}")
    if clock == "wall" and math.isinf(factor):
        fail("--clock wall --speed max: the wall clock needs a factor; as fast as possible flies --clock lockstep")
    if viewer not in get_args(Viewer):
        fail(f"--viewer {viewer}: must be one of {', '.join(get_args(Viewer))}")
    mission = load_mission(scenario, form, variant, settings, seed, duration)
    if not mission.wire:
        fail(f"form {mission.form!r} has an ideal exchange and flies in one process only: use `ftcc simulate`")
    count = _pack(pack, len(mission.vehicles))
    listeners = _listeners(mavlink)
    uavs = [spec.uav for spec in mission.vehicles]
    _check_systems(max(uavs), id_offset)
    _check_key(key, [uav + id_offset for uav in uavs])

    from ftcc.groundside.swarm import check_name, provide_files

    provide_files(mission, count, len(listeners))
    check_name(f"{mission.name}-20000101-000000-2" if out is None else out.name)

    from ftcc.groundside.dashboard import Event
    from ftcc.groundside.swarm import FlightOptions, fly_swarm
    from ftcc.link.ports import PortError, reserve

    try:
        ports = reserve(uavs, port)
    except PortError as error:
        fail(str(error))
    folder = new_run_folder(mission, out)
    options = FlightOptions(
        folder=folder,
        lockstep=clock == "lockstep",
        speed=factor,
        pack=count,
        held=hold,
        viewer=cast(Viewer, viewer),
        open_browser=browser,
        listeners=listeners,
        key=key,
        id_offset=id_offset,
    )
    console = terminal()
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("t = {task.completed:.0f} s"),
        TextColumn("{task.fields[pace]}"),
        console=console,
    )
    begun = time.monotonic()

    def say(event: Event) -> None:
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
        if hold:
            bar.console.print("held at t = 0: `ftcc resume` lets it fly")

    console.print(f"[bold]{escape(mission.title)}[/]: {len(mission.vehicles)} UAVs, run {folder}", soft_wrap=True)
    with bar:
        task = bar.add_task("starting", total=mission.timing.duration, pace="")
        try:
            outcome = fly_swarm(mission, options, ports, say, show_progress, started)
        except TimeoutError as error:
            console.print(f"[bold red]{escape(str(error))}[/]", soft_wrap=True)
            raise typer.Exit(_FLIGHT_FAILED) from error
    if outcome.died and not outcome.ticks:
        console.print(
            f"[bold red]nothing flew: {', '.join(outcome.died)} died at the start[/]; see {folder / 'logs'}",
            soft_wrap=True,
        )
        raise typer.Exit(_FLIGHT_FAILED)
    wall = time.monotonic() - begun
    show_claims(folder)
    share = 100.0 * outcome.late / max(outcome.ticks, 1)
    flown = outcome.flown * mission.timing.period
    console.print(
        f"flew {flown:.1f} s in {wall:.1f} s ({flown / max(wall, 1e-9):.1f} times real time), "
        f"{outcome.late} of {outcome.ticks} ticks late ({share:.2f} %)"
    )
    if not outcome.ok:
        for name in outcome.died:
            console.print(f"[bold red]process {name} died[/]; see {folder / 'logs'}", soft_wrap=True)
    if outcome.verdict is not None:
        judged(outcome.verdict, strict)
    if not outcome.ok:
        raise typer.Exit(_FLIGHT_FAILED)


def _how_it_flies(entry: Entry) -> str:
    """Held, or how many times real time, and what limits it."""
    from ftcc.groundside.swarm import ask_swarm

    try:
        told = ask_swarm(entry, "status") or {}
    except (OSError, RuntimeError):
        return "does not answer"
    if told.get("state") != "flying" or told.get("factor") is None:
        return str(told.get("state", ""))
    return f"{told['factor']:.2g} x real time" + (f": {told['limit']}" if told["limit"] else "")


def ps() -> None:
    """List the running swarms."""
    from ftcc.groundside.swarm import running_swarms

    entries = running_swarms()
    if not entries:
        terminal().print("no swarm is running")
        return
    table = Table("name", "scenario", "UAVs", "pid", "ports", "since", "flies", "dashboard", box=None)
    for entry in entries:
        table.add_row(
            entry.name,
            entry.scenario,
            str(len(entry.vehicles)),
            str(entry.pid),
            f"{entry.ports[0]}-{entry.ports[1]}",
            time.strftime("%H:%M:%S", time.localtime(entry.started)),
            _how_it_flies(entry),
            entry.viewer or "",
        )
    terminal().print(table)


_Name = Annotated[str | None, typer.Argument(help="Name of the swarm as `ftcc ps` shows it; needed if several run.")]


def _tell(name: str | None, command: str) -> None:
    from ftcc.groundside.swarm import ask_swarm, find_swarm

    try:
        ask_swarm(find_swarm(name), command)
    except LookupError as error:
        fail(str(error))
    except (OSError, RuntimeError) as error:
        terminal().print(f"[bold red]{escape(str(error))}[/]", soft_wrap=True)
        raise typer.Exit(_FLIGHT_FAILED) from error


def stop(name: _Name = None, every: Annotated[bool, typer.Option("--all", help="Stop all swarms.")] = False) -> None:
    """End a running swarm in order; its run stays complete up to now."""
    from ftcc.groundside.swarm import running_swarms

    names: list[str | None] = [entry.name for entry in running_swarms()] if every else [name]
    for one in names:
        _tell(one, "stop")


def doctor(
    scenario: Annotated[
        str, typer.Argument(help="Scenario that is flown to measure.", autocompletion=scenario_names)
    ] = "demo",
    variant: Variants = "",
    speed: Annotated[str, typer.Option(help="Times real time that are wanted, or 'max'.")] = "1",
) -> None:
    """Say what this machine has, and, by flying a scenario for some seconds, how fast it flies it."""
    from ftcc.groundside.swarm import examine

    factor = speed_factor(speed, "--speed")
    mission = load_mission(scenario, None, variant, None, None, None)
    table = Table("what", "found", "verdict", box=None)
    console = terminal()
    with console.status("looking around") as status:
        for row in examine(mission, factor, progress=status.update):
            table.add_row(*map(escape, row))
    console.print(table)
