"""What ``ftcc fly`` prints of a flight: lines and a bar for people, or JSON lines for programs."""

from __future__ import annotations

import abc
import json
import math
import time
from typing import TYPE_CHECKING, Any

from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn

from ftcc.groundside.cli.common import judged, show_claims, terminal

if TYPE_CHECKING:
    from pathlib import Path

    from ftcc.groundside.dashboard import Event, Pace
    from ftcc.groundside.scenario import Mission
    from ftcc.groundside.swarm import FlightOptions, Outcome
    from ftcc.groundside.verdict import Verdict

__all__ = ["JSON_PERIOD", "FlightOutput", "JsonOutput", "TerminalOutput", "print_end", "print_line", "print_start"]

_COLOURS = {"info": "cyan", "warning": "yellow", "error": "bold red"}
_LINE_PERIOD = 10.0
"""Wall time between lines of progress where there is no terminal, s."""
JSON_PERIOD = 1.0
"""Wall time between JSON lines of progress, s."""


class FlightOutput(abc.ABC):
    """Prints a flight from its start to its verdict."""

    period: float
    """Wall time between two lines of progress, s."""

    def __init__(self, mission: Mission, options: FlightOptions) -> None:
        self.mission, self.options = mission, options
        self.begun = time.monotonic()
        """When the flight began, on the monotonic clock, s."""
        self._last = -math.inf

    def __enter__(self) -> FlightOutput:
        return self

    @abc.abstractmethod
    def __exit__(self, *_: object) -> None:
        """End the output of progress."""

    def is_due(self) -> bool:
        """Return whether it is time for another line of progress, and count it as printed."""
        due = time.monotonic() - self._last >= self.period
        if due:
            self._last = time.monotonic()
        return due

    def started(self, address: str | None) -> None:
        """Print that all processes are ready, and where the dashboard is."""
        self.begun = time.monotonic()

    @abc.abstractmethod
    def event(self, event: Event) -> None:
        """Print an event."""

    @abc.abstractmethod
    def progress(self, t: float, pace: Pace, late: int) -> None:
        """Print how far the flight is."""

    @abc.abstractmethod
    def not_ready(self, why: str) -> None:
        """Print why the flight did not begin."""

    @abc.abstractmethod
    def end(self, outcome: Outcome, wall: float, code: int) -> None:
        """Print the outcome of a flight of ``wall`` seconds and, if it is for programs, the exit code."""


class TerminalOutput(FlightOutput):
    """Events as lines; progress as a bar on a terminal, and as a line every ten seconds elsewhere."""

    period = _LINE_PERIOD

    def __init__(self, mission: Mission, options: FlightOptions) -> None:
        super().__init__(mission, options)
        self._console = terminal()
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("t = {task.completed:.0f} s"),
            TextColumn("{task.fields[pace]}"),
        )
        self._bar = Progress(*columns, console=self._console, disable=not self._console.is_terminal)
        title = f"[bold]{escape(mission.title)}[/]: {len(mission.vehicles)} UAVs, run {options.folder}"
        self._console.print(title, soft_wrap=True)

    def __enter__(self) -> FlightOutput:
        self._bar.start()
        self._task = self._bar.add_task("starting", total=self.mission.timing.duration, pace="")
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def started(self, address: str | None) -> None:
        super().started(address)
        self._bar.update(self._task, description=f"flying {self.mission.case}")
        if address:
            self._console.print(f"dashboard: {address}", soft_wrap=True)
        if self.options.held:
            self._console.print("held at t = 0; start it with `ftcc resume`")
        self._last = time.monotonic()

    def event(self, event: Event) -> None:
        who = f"UAV {event.uav}: " if event.uav else ""
        colour = _COLOURS.get(event.severity, "white")
        self._console.print(f"[{colour}]{max(event.t, 0.0):8.2f} s[/]  {who}{escape(event.text)}", soft_wrap=True)

    def progress(self, t: float, pace: Pace, late: int) -> None:
        factor = "" if math.isnan(pace.factor) else f"{pace.factor:.2g} x real time"
        self._bar.update(self._task, completed=t, pace=factor)
        if not self._console.is_terminal and self.is_due():
            parts = [f"t = {t:.0f} s of {self.mission.timing.duration:g} s", *([factor] if factor else [])]
            self._console.print(", ".join([*parts, f"{late} ticks late"]), highlight=False, soft_wrap=True)

    def not_ready(self, why: str) -> None:
        self._console.print(f"[bold red]{escape(why)}[/]", soft_wrap=True)

    def end(self, outcome: Outcome, wall: float, code: int) -> None:
        console, logs = self._console, self.options.folder / "logs"
        if outcome.law_error:
            return  # It was shown as an event.
        if outcome.died and not outcome.ticks:
            died = ", ".join(outcome.died)
            console.print(f"[bold red]nothing flew: {died} died at the start[/]; see {logs}", soft_wrap=True)
            return
        show_claims(self.options.folder)
        share = 100.0 * outcome.late / max(outcome.ticks, 1)
        flown = outcome.flown * self.mission.timing.period
        console.print(
            f"flew {flown:.1f} s in {wall:.1f} s ({flown / max(wall, 1e-9):.1f} times real time), "
            f"{outcome.late} of {outcome.ticks} ticks late ({share:.2f} %)"
        )
        if not outcome.ok:
            for name in outcome.died:
                console.print(f"[bold red]process {name} died[/]; see {logs}", soft_wrap=True)
        if outcome.verdict is not None:
            judged(outcome.verdict, strict=False)


class JsonOutput(FlightOutput):
    """One JSON object per line, with a ``type``: "start", "ready", "progress", "event", "end"."""

    period = JSON_PERIOD

    def __init__(self, mission: Mission, options: FlightOptions) -> None:
        super().__init__(mission, options)
        print_start(mission, options.folder)

    def __exit__(self, *_: object) -> None:
        """Nothing to end: each line is complete."""

    def started(self, address: str | None) -> None:
        super().started(address)
        print_line("ready", dashboard=address, held=self.options.held)

    def event(self, event: Event) -> None:
        command = {"who": event.who, "outcome": event.outcome} if event.who or event.outcome else {}
        t = max(event.t, 0.0)
        print_line("event", t=t, severity=event.severity, uav=event.uav, text=event.text, **command)

    def progress(self, t: float, pace: Pace, late: int) -> None:
        if self.is_due():
            factor = None if math.isnan(pace.factor) else pace.factor
            print_line("progress", t=t, wall=time.monotonic() - self.begun, late=late, factor=factor)

    def not_ready(self, why: str) -> None:
        print_line("end", verdict=None, error=why, exit_code=1)

    def end(self, outcome: Outcome, wall: float, code: int) -> None:
        counts = {"late": outcome.late, "ticks": outcome.ticks, "died": outcome.died}
        flown = outcome.flown * self.mission.timing.period
        print_end(self.options.folder, outcome.verdict, flown, wall, code, **counts)


def print_line(type: str, **fields: Any) -> None:
    """Print one JSON object on a line of its own."""
    print(json.dumps({"type": type, **fields}, allow_nan=False), flush=True)


def print_start(mission: Mission, folder: Path) -> None:
    """Print what is going to fly as a JSON line."""
    uavs = [spec.uav for spec in mission.vehicles]
    flight = {"scenario": mission.name, "case": mission.case, "duration": mission.timing.duration}
    print_line("start", **flight, uavs=uavs, run=str(folder))


def print_end(folder: Path, verdict: Verdict | None, t: float, wall: float, code: int, **more: Any) -> None:
    """Print the outcome of a flight as a JSON line, with the claims as ``ftcc report --json`` has them."""
    from ftcc.groundside.results import Run, RunError

    try:
        claims = [result.as_json() for result in Run(folder).claims()]
    except RunError:
        # Nothing was recorded: an event has said why.
        claims = []
    print_line(
        "end",
        verdict=None if verdict is None else verdict.word,
        failures=[] if verdict is None else verdict.failures,
        remarks=[] if verdict is None else verdict.remarks,
        claims=claims,
        t=t,
        wall=wall,
        **more,
        run=str(folder),
        exit_code=code,
    )
