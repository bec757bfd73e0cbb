"""The commands that look after running swarms and the machine that flies them: ps, stop, doctor."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape
from rich.table import Table

from ftcc.groundside.cli.common import Variants, fail, load_mission, scenario_names, terminal

if TYPE_CHECKING:
    from ftcc.groundside.swarm import Entry

__all__ = ["doctor", "ps", "stop"]


def _how_it_flies(entry: Entry) -> str:
    """Held, or how many times real time, and what limits it."""
    from ftcc.groundside.swarm import ask_swarm

    try:
        status = ask_swarm(entry, "status") or {}
    except (OSError, RuntimeError):
        return "does not answer"
    if status.get("state") != "flying" or status.get("factor") is None:
        return str(status.get("state", ""))
    return f"{status['factor']:.2g} x real time" + (f": {status['limit']}" if status["limit"] else "")


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


_Name = Annotated[str | None, typer.Argument(help="Name of the swarm, see `ftcc ps`; needed if several are running.")]


def stop(
    name: _Name = None, every: Annotated[bool, typer.Option("--all", help="Stop all running swarms.")] = False
) -> None:
    """Stop a running swarm; its results up to now are kept."""
    from ftcc.groundside.swarm import Control, RefusedError, find_swarm, running_swarms

    names: list[str | None] = [entry.name for entry in running_swarms()] if every else [name]
    for one in names:
        try:
            Control(find_swarm(one)).stop()
        except LookupError as error:
            fail(str(error))
        except (OSError, RefusedError) as error:
            terminal().print(f"[bold red]{escape(str(error))}[/]", soft_wrap=True)
            raise typer.Exit(1) from error


def doctor(
    scenario: Annotated[
        str, typer.Argument(help="Scenario to fly for the measurement.", autocompletion=scenario_names)
    ] = "demo",
    variant: Variants = "",
    speed: Annotated[str, typer.Option(help="The speed that you want, in times real time, or 'max'.")] = "1",
) -> None:
    """Examine this computer, and fly a scenario for some seconds to measure how fast it flies here."""
    from ftcc.groundside.swarm import examine, speed_factor

    factor = speed_factor(speed, "--speed")
    mission = load_mission(scenario, None, variant, None, None, None)
    table = Table("what", "found", "verdict", box=None)
    console = terminal()
    with console.status("examining this computer") as status:
        for row in examine(mission, factor, progress=status.update):
            table.add_row(*map(escape, row))
    console.print(table)
