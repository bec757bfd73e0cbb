"""Handle a flight in progress: its events, snapshots, pace, commands from the command line, and verdict."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from ftcc.groundside.dashboard import Event, Feed, Pace
from ftcc.groundside.results import Run, RunError
from ftcc.groundside.swarm.launcher import SwarmProcesses
from ftcc.groundside.swarm.monitor import Monitor
from ftcc.groundside.swarm.pacing import Pacing
from ftcc.groundside.verdict import VERDICT_FILE, judge
from ftcc.link.recording import EventLog

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission

__all__ = ["FlightInProgress", "Progress"]

Progress = Callable[[float, Pace, int], None]
"""Called with the current simulated time (s) of a flight, its pace, and the ticks that were late up to now."""

_REFRESH = 0.1
"""Shortest period between updates of the dashboard and of the progress, wall s."""


@dataclass
class FlightInProgress:
    """A flight: its processes, its station, its dashboard, feed and log."""

    mission: Mission
    swarm: SwarmProcesses
    station: Monitor
    dashboard: Any
    feed: Feed | None
    log: EventLog
    report: Callable[[Event], None]
    pacing: Pacing
    next_event: int = 0
    refreshed: float = 0.0

    def log_event(self, event: Event) -> None:
        """Send an event to the log, the dashboard and the caller.

        An event without a time is stamped with the current simulated time.
        """
        stamped = event if event.t >= 0.0 else replace(event, t=self.station.t)
        extra = {"who": event.who, "outcome": event.outcome} if event.who or event.outcome else {}
        self._write(stamped, extra)
        self.station.add_event(stamped)
        self.report(stamped)

    def _write(self, event: Event, extra: dict[str, str]) -> None:
        writable = not self.log.trouble
        self.log.write(event.t, event.text, event.uav, event.severity, **extra)
        if writable and self.log.trouble:
            self.log_event(Event(event.t, "error", f"events are no longer logged: {self.log.trouble}"))

    def log_scheduled_events(self) -> None:
        """Log the scenario's events whose time has come."""
        while self.next_event < len(self.mission.events) and self.mission.events[self.next_event][0] <= self.station.t:
            t, uav, severity, text = self.mission.events[self.next_event]
            self.log_event(Event(t, severity, text, uav))
            self.next_event += 1

    def measure_pace(self) -> None:
        """Measure the pace, and log a warning if the swarm is too slow."""
        flown = round(self.station.t / self.mission.timing.period) * len(self.mission.vehicles)
        text = self.pacing.measure(
            time.monotonic(),
            self.station.t,
            (self.station.late, flown),
            [(child.name, child.process.pid or 0, child.kind) for child in self.swarm.local],
            self.dashboard.pids if self.dashboard is not None else [],
        )
        if text:
            self.log_event(Event(-1.0, "warning", text))

    def refresh(self, progress: Progress) -> None:
        """Log events, measure the pace and draw the swarm, at most ten times per second."""
        if time.monotonic() - self.refreshed < _REFRESH:
            return
        self.refreshed = time.monotonic()
        if error := self.station.take_log_error():
            self.log_event(Event(-1.0, "error", error))
        self.log_scheduled_events()
        if self.swarm.flow.state == "flying" and self.station.t > 0.0:
            self.measure_pace()
        progress(self.station.t, self.pacing.pace, self.station.late)
        # The first snapshot sets the scale: wait for all UAVs, but no longer than 1 s.
        if not (self.station.complete or self.station.t > 1.0):
            return
        snapshot = replace(self.station.snapshot(), pace=self.pacing.pace)
        if self.feed is not None:
            self.feed.offer(snapshot)
        if self.dashboard is not None:
            self.dashboard.log(snapshot)
            for problem in self.dashboard.take_problems():
                self.log_event(problem)

    def judge_flight(self) -> None:
        """Judge the flight; write the verdict to the log, the run's folder and the dashboard."""
        run = Run(self.swarm.folder)
        try:
            verdict = judge(run, self.mission, run.lost)
        except RunError:
            # The recording is empty or unreadable: the log has the reason.
            return
        except OSError as error:
            what = f"not merged into signals.parquet: {error.strerror or error}"
            text = f"recordings are {what}; `ftcc report` merges them once there is space"
            self.log_event(Event(-1.0, "error", text))
            return
        self.swarm.outcome.verdict = verdict
        try:
            (run.path / VERDICT_FILE).write_text(verdict.dumps(), encoding="utf-8")
        except OSError as error:
            self.log_event(Event(-1.0, "error", f"{VERDICT_FILE} could not be written: {error.strerror}"))
        self.log.write(run.end, verdict.text, severity=verdict.severity)
        self.station.add_event(Event(run.end, verdict.severity, verdict.text))
        if not self.station.complete:
            return
        snapshot = self.station.snapshot()
        if self.feed is not None:
            self.feed.offer(snapshot)
        if self.dashboard is not None:
            self.dashboard.log(snapshot)

    def handle_command(self, command: str, arguments: Mapping[str, Any]) -> dict[str, Any] | None:
        """Execute a command from the control socket and return its answer.

        Raises
        ------
        ValueError
            If the command is unknown or an argument is wrong.
        """
        flow, text = self.swarm.flow, ""
        match command:
            case "status":
                t = flow.tick * flow.period if flow.state == "held" else self.station.t
                pace = self.pacing.pace
                reached = None if math.isnan(pace.factor) else pace.factor
                speeds = {"speed": pace.asked, "factor": reached, "limit": pace.limit, "advice": pace.advice}
                return {"state": flow.state, "t": t, **speeds, "died": self.swarm.outcome.died}
            case "stop":
                self.swarm.stop()
            case "pause":
                flow.pause()
                text = "paused"
            case "step":
                flow.step(max(1, int(arguments["ticks"])))
            case "resume":
                flow.resume()
                self.pacing.restart()
                text = "resumed"
            case "speed":
                factor = arguments["factor"]
                flow.set_speed(math.inf if factor is None else float(factor))
                self.pacing.set_speed(flow.speed)
                text = "speed max" if factor is None else f"speed {flow.speed:g}"
            case _:
                raise ValueError(f"unknown command {command!r}")
        if text:
            self.log_event(Event(-1.0, "info", text, who="command line", outcome="accepted"))
        return None

    def log_end(self, wall_flown: float) -> None:
        """Write the last entry of the log: late ticks and pace over ``wall_flown`` seconds of wall time."""
        outcome, pace = self.swarm.outcome, self.pacing.pace
        if self.station.foreign_datagrams:
            self.log.write(
                self.station.t, f"dropped {self.station.foreign_datagrams} datagrams from other ports at the station"
            )
        self.log.write(
            self.station.t,
            f"flight over: {outcome.late} of {outcome.ticks} ticks late",
            late=outcome.late,
            ticks=outcome.ticks,
            factor=round(outcome.flown * self.mission.timing.period / wall_flown, 3) if wall_flown else None,
            asked=pace.asked,
            limit=pace.limit,
            advice=pace.advice,
            late_of={str(uav): state.late for uav, state in self.station.snapshot().uavs.items()},
        )
        self.log.close()

    def close(self) -> None:
        """Close the station, the feed and the dashboard."""
        self.station.close()
        if self.feed:
            self.feed.close()
        if self.dashboard:
            self.dashboard.close()
