"""The command ``ftcc vehicle``, and how a flight behind doors is shown."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ftcc.groundside.cli.common import (
    Duration,
    Form,
    Out,
    Seed,
    Settings,
    Variants,
    fail,
    load_mission,
    new_run_folder,
    scenario_names,
    terminal,
    warn,
)

if TYPE_CHECKING:
    from ftcc.groundside.doors import DoorOutcome, Px4Build
    from ftcc.groundside.scenario import Mission

__all__ = ["check_door_options", "fly_by_px4", "vehicle"]

_LOST = 1
_LAST_PORT = 65535


def vehicle(
    scenario: Annotated[
        str,
        typer.Argument(help="Name of a bundled scenario, or a TOML file.", autocompletion=scenario_names),
    ],
    uav: Annotated[int | None, typer.Option(help="The aircraft; default: the first follower.")] = None,
    px4: Annotated[
        int | None, typer.Option(metavar="PORT", help="TCP port for PX4; instance n calls 4560 + n.")
    ] = None,
    ardupilot: Annotated[
        int | None, typer.Option(metavar="PORT", help="UDP port for ArduPilot; instance n calls 9002 + 10 n.")
    ] = None,
    form: Form = None,
    variant: Variants = "",
    duration: Duration = None,
    seed: Seed = None,
    out: Out = None,
    settings: Settings = None,
    speed: Annotated[
        str, typer.Option(help="Highest number of simulated seconds per second; 0 or 'max': as fast as it can.")
    ] = "1",
    field: Annotated[
        str | None,
        typer.Option(metavar="N,E,D", help="The earth's magnetic field, gauss; default: that of the default home."),
    ] = None,
) -> None:
    """One aircraft of a scenario as the simulator of a PX4 or ArduPilot that you start yourself."""
    from ftcc.groundside.doors import field_of, fly_behind_doors, followers_of
    from ftcc.groundside.swarm import speed_factor

    port = px4 if px4 is not None else ardupilot
    if port is None or (px4 is not None and ardupilot is not None):
        fail("--px4 PORT or --ardupilot PORT: one of them says who flies the aircraft")
    option = "--px4" if px4 is not None else "--ardupilot"
    if not 0 < port <= _LAST_PORT:
        fail(f"{option} {port}: must be a port from 1 to {_LAST_PORT}")
    factor = math.inf if speed == "0" else speed_factor(speed, "--speed")
    sizes = field_of(field)
    mission = load_mission(scenario, form, variant, settings, seed, duration)
    (flown, *_) = followers_of(mission, uav)
    _warn_of_what_is_set_aside(mission)
    folder = new_run_folder(mission, out)
    outcome = fly_behind_doors(
        mission,
        folder,
        [flown],
        "px4" if px4 is not None else "ardupilot",
        ports={flown: port},
        speed=factor,
        sizes=sizes,
        report=_say,
    )
    _end(outcome, folder)


def check_door_options(**given: bool) -> None:
    """Refuse options of ``ftcc fly`` that have no meaning with ``--px4``."""
    for name, is_given in given.items():
        if is_given:
            fail(f"--{name.replace('_', '-')}: not with --px4, whose aircraft fly in one process by its clock alone")


def fly_by_px4(mission: Mission, build: Px4Build, out: Path | None, speed: float) -> None:
    """Fly all followers of a mission by PX4, and end with the exit code."""
    from ftcc.groundside.doors import fly_behind_doors, followers_of

    uavs = followers_of(mission)
    _warn_of_what_is_set_aside(mission)
    folder = new_run_folder(mission, out)
    _say(f"PX4 {build.program}, airframe {build.model}; no dashboard, no leaders, no law of the scenario")
    _end(fly_behind_doors(mission, folder, uavs, "px4", build=build, speed=speed, report=_say), folder)


def _warn_of_what_is_set_aside(mission: Mission) -> None:
    from ftcc.groundside.doors import set_aside

    for part in set_aside(mission):
        warn(f"{mission.name}: does not act behind a door: {part}")


def _say(text: str) -> None:
    terminal().print(text, markup=False, highlight=False, soft_wrap=True)


def _end(outcome: DoorOutcome, folder: Path) -> None:
    how = "stopped" if outcome.stopped else "flown"
    lost = f"; lost: {', '.join(f'UAV {uav}' for uav in sorted(outcome.lost))}" if outcome.lost else ""
    _say(f"{how}: {outcome.flown:g} s of the scenario{lost}")
    _say(f"recorded in {folder}")
    if outcome.lost:
        raise typer.Exit(_LOST)
