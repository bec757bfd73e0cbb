"""The command ``ftcc fly``."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ftcc.groundside.cli.common import (
    STRICTLY_FAILED,
    Duration,
    Form,
    Out,
    Seed,
    Settings,
    Strict,
    Variants,
    fail,
    load_mission,
    scenario_names,
)
from ftcc.groundside.cli.flight_output import FlightOutput, JsonOutput, TerminalOutput, print_line
from ftcc.groundside.cli.node import Insecure, Tls, check_secrecy, refused_keys
from ftcc.groundside.cli.vehicle import check_door_options, fly_by_px4

if TYPE_CHECKING:
    from ftcc.groundside.nodes import Nodes, NodesPlan
    from ftcc.groundside.scenario import Mission
    from ftcc.groundside.swarm import FlightOptions, Outcome
    from ftcc.link.ports import PortBlock

__all__ = ["fly"]

_FLIGHT_FAILED = 1
_MISTAKE = 2
"""As of other bad input."""
_LOOK = 0.2
"""Longest wait for a node before Ctrl-C is looked at, wall s."""


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
    json: Annotated[
        bool, typer.Option("--json", help="Print progress, events and outcome as JSON, an object per line.")
    ] = False,
    strict: Strict = False,
    nodes: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Fly on several computers, as this file says; see `ftcc node`."),
    ] = None,
    ssh: Annotated[bool, typer.Option("--ssh", help="With --nodes: start `ftcc node` there by ssh.")] = False,
    tls: Tls = None,
    insecure: Insecure = False,
    px4: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH", help="Fly the followers by this PX4, the folder of a build or its px4, and not by our law."
        ),
    ] = None,
    px4_model: Annotated[
        str | None, typer.Option(help="Airframe of PX4; default: ftcc_plane, jsbsim_malolo or plane.")
    ] = None,
) -> None:
    """Fly a swarm: a vehicle process and an autopilot process per UAV, with MAVLink, mesh and dashboard."""
    from ftcc.groundside.swarm import check_choices, prepare_flight, speed_factor

    factor = speed_factor(speed, "--speed")
    check_choices(clock, factor, viewer)
    if px4_model is not None and px4 is None:
        fail("--px4-model: belongs to --px4")
    if px4 is not None:
        from ftcc.groundside.doors import find_px4

        check_door_options(
            clock=clock != "lockstep",
            hold=hold,
            pack=pack != "1",
            port=port is not None,
            mavlink=mavlink is not None,
            key=key is not None,
            id_offset=id_offset != 0,
            json=json,
            strict=strict,
            nodes=nodes is not None,
            tls=tls is not None,
        )
        build = find_px4(px4, px4_model)
        fly_by_px4(load_mission(scenario, form, variant, settings, seed, duration), build, out, factor)
        return
    plan = _plan_of(nodes, ssh, tls, insecure)
    if tls is not None:
        # Who has no certificate of a UAV cannot speak in its name.
        settings = [*(settings or []), "network.authenticated=true"]
    mission = load_mission(scenario, form, variant, settings, seed, duration)
    if plan is not None:
        plan.require_in(spec.uav for spec in mission.vehicles)
    if tls is not None:
        _check_keys(tls, plan, mission, pack)
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
        tls=tls,
    )
    output: FlightOutput = (JsonOutput if json else TerminalOutput)(mission, options)
    outcome = _fly(output, ports, None if plan is None else _gathered(plan, ssh, mission, options, ports, json))
    code = _exit_code(outcome, strict)
    output.end(outcome, time.monotonic() - output.begun, code)
    if code:
        raise typer.Exit(code)


def _plan_of(nodes: Path | None, ssh: bool, tls: Path | None, insecure: bool) -> NodesPlan | None:
    """Return which computers take part, or None if none does beside this one."""
    if nodes is None:
        if ssh or insecure:
            fail(f"{'--ssh' if ssh else '--insecure'}: belongs to --nodes")
        return None
    from ftcc.groundside.nodes import read_plan

    check_secrecy(tls, insecure)
    return read_plan(nodes)


def _check_keys(tls: Path, plan: NodesPlan | None, mission: Mission, pack: str) -> None:
    """Refuse keys with which the processes here cannot fly."""
    from ftcc.groundside.swarm import grouped, pack_of
    from ftcc.link.mesh_keys import LEAD, uav_name
    from ftcc.link.mesh_security import Credentials

    uavs = [spec.uav for spec in mission.autopilots]
    groups = grouped(uavs, pack_of(pack, len(uavs)), plan.place if plan else lambda _: ("", ""))
    first = [group[0] for group in groups if plan is None or not plan.autopilot_at(group[0])]
    with refused_keys():
        for name in ([LEAD] if plan else []) + [uav_name(uav) for uav in first]:
            Credentials(tls, name)


def _gathered(
    plan: NodesPlan, ssh: bool, mission: Mission, options: FlightOptions, ports: PortBlock, json: bool
) -> Nodes:
    """Wait until all other computers are there."""
    from ftcc.groundside.nodes import Nodes

    gathered = Nodes(
        plan,
        mission,
        options.folder,
        ports,
        lockstep=options.lockstep,
        signed=options.key is not None,
        tls=options.tls,
    )

    def say(text: str) -> None:
        if json:
            print_line("node", text=text)
        else:
            print(text, flush=True)

    try:
        if ssh:
            gathered.start_by_ssh()
        gathered.gather(say, _LOOK)
    except BaseException:
        gathered.close()
        ports.release()
        raise
    return gathered


def _fly(output: FlightOutput, ports: PortBlock, elsewhere: Nodes | None) -> Outcome:
    """Fly, with events and progress on standard output."""
    from ftcc.groundside.swarm import fly_swarm

    with output:
        try:
            return fly_swarm(
                output.mission, output.options, ports, output.event, output.progress, output.started, elsewhere
            )
        except TimeoutError as error:
            output.not_ready(str(error))
            raise typer.Exit(_FLIGHT_FAILED) from error


def _exit_code(outcome: Outcome, strict: bool) -> int:
    """Return 2 for a mistake in the law, 1 for a loss or a dead process, 3 if ``strict`` and the verdict is failed."""
    from ftcc.groundside.verdict import FAILED

    if outcome.law_error:
        return _MISTAKE
    if strict and outcome.verdict is not None and outcome.verdict.word == FAILED:
        return STRICTLY_FAILED
    return 0 if outcome.ok else _FLIGHT_FAILED
