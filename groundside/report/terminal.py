"""What a run showed, on the terminal: its claims and events; and its claims as JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ftcc.groundside.claims import Result, evaluate
from ftcc.groundside.run import Run

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

__all__ = ["as_json", "claims_of", "claims_table", "ids", "number", "show", "show_claims", "summary"]

_MARKS = {True: "[green]holds[/]", False: "[bold red]FAILS[/]", None: "[dim]not flown[/]"}


def claims_of(run: Run) -> list[Result]:
    """The claims of a run's scenario, held against what it recorded."""
    mission = run.mission
    return evaluate(run, mission.claims, mission.case, mission.graph, mission.timing.duration)


def as_json(run: Run, results: list[Result]) -> str:
    """The claims for programs: ``value`` and ``ok`` are null where the flight did not cover the window."""
    mission = run.mission
    document = {
        "scenario": mission.name,
        "form": mission.form,
        "variant": ",".join(mission.variants),
        "claims": [result.as_json() for result in results],
    }
    return json.dumps(document, indent=2, allow_nan=False)


def number(value: Any) -> str:
    """A measured or expected value, or several."""
    if value is None:
        return "-"
    if isinstance(value, list):
        return " ".join(f"{one:.5g}" for one in value)
    return f"{value:.4g}"


def summary(results: Sequence[Result]) -> str:
    """How many claims hold."""
    held = sum(result.ok is True for result in results)
    not_flown = sum(result.ok is None for result in results)
    return f"{held} of {len(results)} claims hold" + (f", {not_flown} not flown" if not_flown else "")


def show_claims(console: Console, results: list[Result]) -> None:
    """Print a table of claims, and how many hold."""
    console.print(claims_table(results))
    console.print(summary(results), highlight=False)


def claims_table(results: list[Result]) -> Table:
    """A table of claims: what was expected, what was measured."""
    from rich.markup import escape
    from rich.table import Table

    table = Table(header_style="bold", pad_edge=False)
    for heading, justify in (
        ("claim", "left"),
        ("UAV", "left"),
        ("window, s", "left"),
        ("measured", "right"),
        ("expected", "right"),
        ("tolerance", "left"),
        ("", "left"),
        ("source", "left"),
    ):
        table.add_column(heading, justify=justify, overflow="fold")  # type: ignore[arg-type]
    for result in results:
        claim = result.claim
        start, end = claim.window
        unit = f" {claim.unit}" if claim.unit else ""
        table.add_row(
            escape(claim.name),
            ids(result.uavs),
            f"{start:g}" if start == end else f"{start:g} - {end:g}",
            f"{number(result.value)}{unit if result.value is not None else ''}",
            number(result.expected),
            escape(result.tolerance),
            _MARKS[result.ok] + (f" [dim]({escape(result.remark)})[/]" if result.remark and result.ok is False else ""),
            escape(claim.source),
        )
    return table


def ids(uavs: tuple[int, ...]) -> str:
    """Ids in short: 1-6, 8."""
    runs: list[list[int]] = []
    for uav in sorted(uavs):
        if runs and uav == runs[-1][-1] + 1:
            runs[-1].append(uav)
        else:
            runs.append([uav])
    return ", ".join(str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs)


def show(console: Console, run: Run, results: list[Result]) -> None:
    """The whole report on the terminal: what was flown, what happened, which claims hold."""
    from rich.markup import escape

    mission = run.mission
    console.print(f"[bold]{escape(mission.title)}[/]")
    console.print(
        f"{mission.name}, form {mission.form}{', variant ' + ', '.join(mission.variants) if mission.variants else ''}, "
        f"seed {mission.timing.seed}, {run.end:g} of {mission.timing.duration:g} s flown, {len(run.uavs)} UAVs",
        highlight=False,
    )
    colours = {"error": "bold red", "warning": "yellow"}
    for event in run.events:
        who = f"UAV {event['uav']}: " if event.get("uav") is not None else ""
        colour = colours.get(str(event.get("severity")), "default")
        text = str(event["text"])
        who = "" if text.startswith("UAV ") else who
        console.print(f"[dim]{event['t']:9.2f} s[/]  [{colour}]{escape(who + text)}[/]", highlight=False)
    if results:
        show_claims(console, results)
    else:
        console.print(f"the scenario makes no claims for case {mission.case}")
