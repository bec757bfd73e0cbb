"""The command ``ftcc failures``."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, Annotated

import typer

from ftcc.groundside.cli.common import Form, Settings, Variants, fail, load_mission, scenario_names, terminal

if TYPE_CHECKING:
    from rich.table import Table

    from ftcc.link.failures import Unit

__all__ = ["failures"]


def failures(
    scenario: Annotated[
        str | None,
        typer.Argument(
            metavar="[SCENARIO]",
            help="Show only what the aircraft of this scenario have; default: all aircraft.",
            autocompletion=scenario_names,
        ),
    ] = None,
    form: Form = None,
    variant: Variants = "",
    settings: Settings = None,
) -> None:
    """List everything that can fail, and what MAV_CMD_INJECT_FAILURE means here."""
    from ftcc.link.failures import FAILURES, KINDS, SIZES, UNITS, parts_of

    if scenario is None and (form is not None or variant or settings):
        fail("--form, --variant and --set: need a scenario")
    there = None if scenario is None else _actuators(scenario, form, variant, settings)
    out = terminal()
    used = set()
    for unit in UNITS.values():
        if there is not None and unit.parts and not parts_of(unit, there):
            continue
        out.print(f"[bold]{unit.code} {unit.name}[/]: {_instances(unit, there)}", highlight=False)
        table = _table("type", "means", "size from")
        for one in FAILURES:
            if one.unit == unit:
                table.add_row(f"{KINDS[one.kind]} {one.kind.upper()}", one.text, ", ".join(one.sizes))
                used |= set(one.sizes)
        out.print(table)
        out.print()
    sizes = _table("parameter", "default", "range", "unit", "means")
    for size in SIZES:
        if size.name in used:
            sizes.add_row(size.name, f"{size.default:g}", f"{size.low:g} .. {size.high:g}", size.unit, size.meaning)
    out.print(sizes)
    if there is None:
        out.print()
        out.print("[bold]Actuators of each kind of aircraft[/]", highlight=False)
        out.print(_plants())
    out.print(
        "\nFailures take effect at the parameter FTCC_AT (simulated ms, 0 = at once), if SYS_FAILURE_EN is 1.",
        highlight=False,
    )
    out.print("Leaders are reference points: only their radio can fail.", highlight=False)


def _table(*headings: str) -> Table:
    from rich.table import Table

    table = Table(header_style="bold", box=None, pad_edge=False)
    for heading in headings:
        # What is short stays whole where the terminal is narrow.
        table.add_column(heading, no_wrap=heading in ("type", "parameter", "default"), overflow="fold")
    return table


def _actuators(name: str, form: str | None, variant: str, settings: list[str] | None) -> list[str]:
    """What the aircraft of a scenario are steered by, as far as it has any travel."""
    from ftcc.link.actuators import SLOT
    from ftcc.sim.plants import find

    mission = load_mission(name, form, variant, settings, None, None)
    followers = [vehicle for vehicle in mission.vehicles if vehicle.uav in mission.graph.followers]
    actuators = find(mission.plant).ACTUATORS
    return [one for one in actuators if any(vehicle.travel[SLOT[one]] > 0.0 for vehicle in followers)]


def _instances(unit: Unit, there: Collection[str] | None) -> str:
    """Which instances of a unit there are, for people."""
    from ftcc.link.failures import parts_of

    if there is None or not unit.parts:
        return unit.instances
    parts = [f"{n} {name.replace('_', ' ')}" for n, name in parts_of(unit, there).items()]
    return ", ".join(parts) + ("; 0 all" if unit.highest > 1 else "")


def _plants() -> Table:
    """A row per plant: its parts by unit and instance, and the shipped scenarios whose aircraft it is."""
    from ftcc.link.failures import UNITS, parts_of
    from ftcc.sim import plants

    units = [unit for unit in UNITS.values() if unit.parts]
    heads = [f"{unit.name.removeprefix('SYSTEM_')} {n}" for unit in units for n in range(1, unit.highest + 1)]
    flown = _flown_by()
    table = _table("plant", *heads, "in")
    for name in plants.names():
        actuators = plants.find(name).ACTUATORS
        cells = [
            parts_of(unit, actuators).get(n, "-").replace("_", " ")
            for unit in units
            for n in range(1, unit.highest + 1)
        ]
        table.add_row(name, *cells, ", ".join(flown.get(name, ())))
    return table


def _flown_by() -> dict[str, list[str]]:
    """The shipped scenarios, and those variants that change the aircraft, by plant."""
    from ftcc.airside import schemes
    from ftcc.groundside.scenario import forms_and_variants, read, shipped

    flown: dict[str, list[str]] = {}
    for name, path in shipped().items():
        document = read(path)
        own = document.get("plant", {}).get("model") or schemes.find(document["scheme"]).plant
        flown.setdefault(own, []).append(name)
        for variant, changes in forms_and_variants(document)[1].items():
            if model := changes.get("plant", {}).get("model"):
                flown.setdefault(model, []).append(f"{name}+{variant}")
    return flown
