"""What the commands have in common: options, messages, and the way from options to a mission and a folder."""

from __future__ import annotations

import contextlib
import gc
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from ftcc.groundside.claims import Result
    from ftcc.groundside.scenario import Mission, Scenario
    from ftcc.groundside.verdict import Verdict

__all__ = [
    "STRICTLY_FAILED",
    "Duration",
    "Form",
    "Out",
    "ScenarioName",
    "Seed",
    "Settings",
    "Strict",
    "Variants",
    "end_by",
    "fail",
    "judged",
    "load_mission",
    "load_scenario",
    "new_run_folder",
    "scenario_names",
    "show_claims",
    "show_summary",
    "terminal",
    "warn",
]


def scenario_names(incomplete: str) -> list[str]:
    """The shipped scenarios that begin so, for the shell's completion."""
    from ftcc.groundside.scenario import shipped

    return [name for name in shipped() if name.startswith(incomplete)]


ScenarioName = Annotated[
    str,
    typer.Argument(
        metavar="SCENARIO",
        help="Name of a bundled scenario, a TOML file, or a run to fly again.",
        autocompletion=scenario_names,
    ),
]
Form = Annotated[str | None, typer.Option(help="Form of the control law; default: the first one of the scenario.")]
Variants = Annotated[str, typer.Option("--variant", metavar="A,B", help="Variants of the scenario.")]
Duration = Annotated[float | None, typer.Option(help="Simulated time to fly, s.")]
Seed = Annotated[int | None, typer.Option(help="Seed of packet losses, jitter, noise and turbulence.")]
Out = Annotated[
    Path | None, typer.Option(help="Folder for the results; default: runs/SCENARIO-TIME, or studies/SCENARIO-TIME.")
]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY.PATH=VALUE", help="Change a field of the scenario; can be repeated."),
]

Strict = Annotated[bool, typer.Option("--strict", help="Exit with code 3 if the verdict is 'failed'.")]

STRICTLY_FAILED = 3
"""Exit code of ``--strict``."""
_PIPE_WIDTH = 200
"""Columns where the output is no terminal: tables must not be folded into a file."""


def terminal(stderr: bool = False) -> Console:
    """Standard output, or standard error."""
    from ftcc.groundside.cli.narrow import Terminal

    stream = sys.stderr if stderr else sys.stdout
    # Text such as a:b:3 is no emoji.
    return Terminal(stderr=stderr, width=None if stream.isatty() else _PIPE_WIDTH, emoji=False)


def _say(text: str, style: str) -> None:
    out = terminal(stderr=True)
    # On a terminal between words; whole where it goes into a file.
    out.print(text, style=style, markup=False, highlight=False, soft_wrap=not out.is_terminal)


def warn(text: str) -> None:
    """A warning to the user."""
    _say(f"warning: {text}", "yellow")


def fail(text: str) -> NoReturn:
    """Bad input: one message, exit code 2."""
    _say(f"ftcc: {text}", "bold red")
    sys.exit(2)


@contextlib.contextmanager
def _loading() -> Iterator[None]:
    """While libraries are loaded, which stay: the garbage collector looks for nothing among them, now or later.

    It would take a sixth of the time of a whole ``ftcc simulate``.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


def load_scenario(
    name: str,
    form: str | None,
    variant: str,
    settings: list[str] | None,
    seed: int | None = None,
    duration: float | None = None,
) -> Scenario:
    """The scenario that the options ask for."""
    with _loading():
        from ftcc.groundside.scenario import load

        return load(name, form=form, variants=variant, settings=settings or [], seed=seed, duration=duration)


def load_mission(
    name: str,
    form: str | None,
    variant: str,
    settings: list[str] | None,
    seed: int | None,
    duration: float | None,
) -> Mission:
    """The mission that the options ask for; its warnings go to the user."""
    scenario = load_scenario(name, form, variant, settings, seed, duration)
    with _loading():
        from ftcc.groundside.scenario import resolve

        mission = resolve(scenario)
    for text in mission.warnings:
        warn(f"{mission.name}: {text}")
    return mission


def new_run_folder(mission: Mission, out: Path | None) -> Path:
    """The folder of a new run, created."""
    from ftcc.groundside.results import new_folder

    return new_folder(mission.name, out)


def show_claims(folder: Path) -> None:
    """Merge the recording of a run if need be and print how its claims stand."""
    from ftcc.groundside import report
    from ftcc.groundside.results import Run, RunError

    try:
        results = Run(folder).claims()
    except RunError as error:
        # A flight that ended before anything was recorded has said why already.
        warn(str(error))
        return
    if results:
        report.show_claims(terminal(), results)


def judged(verdict: Verdict, strict: bool) -> None:
    """Show how a flight went; if ``strict``, end by it."""
    from ftcc.groundside import report

    report.show_verdict(terminal(), verdict)
    if strict:
        end_by(verdict)


def end_by(verdict: Verdict) -> None:
    """End with an exit code of its own if the flight failed."""
    from ftcc.groundside.verdict import FAILED

    if verdict.word == FAILED:
        raise typer.Exit(STRICTLY_FAILED)


def show_summary(folder: Path, results: list[Result]) -> None:
    """How many claims of a run hold, and where the run is."""
    from ftcc.groundside import report

    out = terminal()
    if results:
        out.print(f"{report.summary(results)}: ftcc report {folder}", markup=False, highlight=False, soft_wrap=True)
    out.print(f"recorded in {folder}", markup=False, highlight=False, soft_wrap=True)
