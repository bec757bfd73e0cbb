"""Show the swarm as text: a table of all UAVs and the log of events."""

from __future__ import annotations

from collections.abc import Iterable

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import TimelineColumn

from ftcc.groundside.dashboard.detail import Detail
from ftcc.groundside.dashboard.labels import (
    describe_beliefs,
    describe_distrust,
    describe_faults,
    describe_silence,
    faulty_actuators,
    in_trouble,
    is_silent,
    name,
)
from ftcc.groundside.dashboard.pace import describe_pace
from ftcc.groundside.dashboard.snapshot import Event, Snapshot, UavState
from ftcc.groundside.dashboard.subject import Subject
from ftcc.groundside.dashboard.viewer import Entry

__all__ = ["Table", "event_entries", "log_view"]

_PERIOD = 10
"""Number of snapshots from one table to the next."""
_MAX_ROWS = 24
"""Largest number of rows for UAVs in trouble, in a big swarm."""
_LEVELS = {"info": "INFO", "warning": "WARN", "error": "ERROR"}


class Table:
    """Writes the table at intervals, because text costs more than a curve."""

    def __init__(self, subject: Subject, detail: Detail) -> None:
        self._subject = subject
        self._detail = detail
        self._countdown = 0

    def view(self) -> rrb.TextDocumentView:
        """Return the view of the table."""
        return rrb.TextDocumentView(origin="/swarm", name="Swarm", titlebar=False)

    def draw(self, snapshot: Snapshot) -> list[Entry]:
        """Return the table if it is due."""
        due = self._countdown == 0
        self._countdown = (self._countdown + 1) % _PERIOD
        if not due:
            return []
        return [Entry("/swarm", snapshot.t, rr.TextDocument(self._text(snapshot), media_type="text/markdown"))]

    def _text(self, snapshot: Snapshot) -> str:
        believes = ["believes"] if self._subject.diagnosed else []
        heads = ("UAV", "altitude, m", "speed, m/s", "actuators", *believes, "links up", "late ticks", "mode")
        rows = [heads, ("---",) * len(heads), *(self._row(uav, snapshot) for uav in self._uavs_in_rows(snapshot))]
        # A recording has no modes.
        shown = len(heads) if any(state.mode for state in snapshot.uavs.values()) else -1
        above = [describe_pace(snapshot.pace)] if snapshot.pace is not None else []
        above += [self._summary(snapshot)] if self._detail.crowded else []
        return "\n".join([*(f"{line}\n" for line in above), *(f"| {' | '.join(row[:shown])} |" for row in rows)])

    def _uavs_in_rows(self, snapshot: Snapshot) -> list[int]:
        """Return the UAVs in the table: all; of a big swarm those in trouble, then the others drawn in full."""
        uavs = sorted(self._subject.graph.uavs)
        if not self._detail.crowded:
            return uavs
        states = snapshot.uavs
        worst = [uav for uav in uavs if uav not in states or in_trouble(states[uav], snapshot)][:_MAX_ROWS]
        return worst + [uav for uav in sorted(self._detail.shown) if uav not in worst]

    def _summary(self, snapshot: Snapshot) -> str:
        """Summarize a big swarm in one line."""
        uavs, states = self._subject.graph.uavs, snapshot.uavs.values()
        silent = sum(is_silent(state, snapshot) for state in states)
        counts = {
            "without telemetry": len(uavs) - len(states),
            "silent": silent,
            "with faults": sum(bool(faulty_actuators(state)) for state in states),
            "late ticks": sum(state.late for state in states),
        }
        problems = "".join(f", {count} {what}" for what, count in counts.items() if count)
        altitudes = [state.truth["z"] for state in states]
        reach = f", {min(altitudes):.0f} to {max(altitudes):.0f} m" if altitudes else ""
        return f"{len(uavs)} UAVs{problems or ', all healthy'}{reach}"

    def _row(self, uav: int, snapshot: Snapshot) -> tuple[str, ...]:
        leads = uav in self._subject.leaders
        label = f"{uav} leader" if leads else f"{uav}"
        state = snapshot.uavs.get(uav)
        if state is None:
            return (label, "", "", "no telemetry", *[""] * bool(self._subject.diagnosed), "", "", "")
        silent = describe_silence(state, snapshot)
        health = silent or describe_faults(state) or ("" if leads else "healthy")
        z, speed = state.truth["z"], state.truth["V"]
        believes = [describe_beliefs(state, self._subject.diagnosed)] if self._subject.diagnosed else []
        links = _describe_links(state)
        return (label, f"{z:.1f}", f"{speed:.2f}", health, *believes, links, str(state.late), state.mode)


def _describe_links(state: UavState) -> str:
    links = state.links.values()
    if not links:
        return ""
    received, lost = sum(link.received for link in links), sum(link.lost for link in links)
    share = f", {100.0 * lost / (received + lost):.0f} % lost" if lost else ""
    doubted = describe_distrust(state)
    return f"{sum(not link.cut for link in links)} of {len(links)}{share}{f', {doubted}' if doubted else ''}"


def log_view() -> rrb.TextLogView:
    """Return the view of the event log."""
    # The text includes the time, because Rerun's column for it is too narrow to read.
    clock = TimelineColumn("t", visible=False)
    columns = rrb.TextLogColumns(timeline_columns=[clock], text_log_columns=["loglevel", "body"])
    return rrb.TextLogView(origin="/events", name="Events", columns=columns)


def event_entries(new: Iterable[Event]) -> list[Entry]:
    """Return events as entries of the event log."""
    entries = []
    for event in new:
        whose = f"{name(event.uav)}: " if event.uav is not None and not event.text.startswith("UAV ") else ""
        asked = f" (from {event.who})" if event.who else ""
        outcome = f": {event.outcome}" if event.outcome else ""
        text = f"{event.t:.1f} s  {whose}{event.text}{outcome}{asked}"
        level = _LEVELS.get(event.severity, event.severity.upper())
        entries.append(Entry("/events", event.t, rr.TextLog(text, level=level)))
    return entries
