"""Show a run on the terminal: its verdict, claims and events; return verdict and claims as JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ftcc.groundside.claims import Result
from ftcc.groundside.results import Run
from ftcc.groundside.text import ids
from ftcc.groundside.verdict import AS_IT_SHOULD, FAILED, REMARKS, Verdict, is_diagnosed

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

__all__ = ["as_json", "claims_table", "number", "show", "show_claims", "show_verdict", "summary"]

_COLOURS = {AS_IT_SHOULD: "bold green", REMARKS: "bold yellow", FAILED: "bold red"}
_MARKS = {True: "[green]holds[/]", False: "[bold red]FAILS[/]", None: "[dim]not flown[/]"}


def show_verdict(console: Console, verdict: Verdict) -> None:
    """Print the verdict of a flight: the word, its reasons, and the largest tracking errors."""
    from rich.markup import escape

    lines = [f"[{_COLOURS[verdict.word]}]verdict: {verdict.word}[/]"]
    lines += [f"  [bold red]{escape(text)}[/]" for text in verdict.failures]
    lines += [f"  [yellow]{escape(text)}[/]" for text in verdict.remarks]
    lines += [f"  [dim]{escape(text)}[/]" for text in verdict.largest]
    for line in lines:
        # Wrap lines on a terminal only, not in a file.
        console.print(line, highlight=False, soft_wrap=not console.is_terminal)


def as_json(run: Run, results: list[Result]) -> str:
    """Return verdict, claims and diagnosis, if there is one, as JSON.

    ``value`` and ``ok`` of a claim are null if the flight did not cover its window.
    """
    mission = run.mission
    document = {
        "scenario": mission.name,
        "form": mission.form,
        "variant": ",".join(mission.variants),
        "verdict": run.verdict.as_json(),
        "claims": [result.as_json() for result in results],
    }
    if is_diagnosed(mission):
        from ftcc.groundside.report.diagnosis import diagnosis_as_json

        document["diagnosis"] = diagnosis_as_json(run)
    return json.dumps(document, indent=2, allow_nan=False)


def number(value: Any) -> str:
    """Format one or several measured or expected values."""
    if value is None:
        return "-"
    if isinstance(value, list):
        return " ".join(f"{one:.5g}" for one in value)
    return f"{value:.4g}"


def summary(results: Sequence[Result]) -> str:
    """Return how many claims hold, as text."""
    held = sum(result.ok is True for result in results)
    not_flown = sum(result.ok is None for result in results)
    return f"{held} of {len(results)} claims hold" + (f", {not_flown} not flown" if not_flown else "")


def show_claims(console: Console, results: list[Result]) -> None:
    """Print a table of claims, and how many hold."""
    console.print(claims_table(results))
    console.print(summary(results), highlight=False)


def claims_table(results: list[Result]) -> Table:
    """Return a table of claims with expected and measured values."""
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


def show(console: Console, run: Run, results: list[Result]) -> None:
    """Print the whole report: scenario, events, claims and verdict."""
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
    if is_diagnosed(mission):
        from ftcc.groundside.report.diagnosis import show_diagnosis

        show_diagnosis(console, run)
    show_verdict(console, run.verdict)
