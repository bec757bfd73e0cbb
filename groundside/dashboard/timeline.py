"""Show the whole flight as a strip of lanes: commands, faults with aircraft that have fallen silent, links.

A lane changes when something does; so a look at the strip tells what has happened, and when.
"""

from __future__ import annotations

import rerun as rr
import rerun.blueprint as rrb

from ftcc.groundside.dashboard.labels import faulty_actuators, is_silent, name
from ftcc.groundside.dashboard.snapshot import Event, Snapshot
from ftcc.groundside.dashboard.subject import Subject
from ftcc.groundside.dashboard.viewer import Entry
from ftcc.groundside.palette import CUT, FRESH, STALE, Color

__all__ = ["Timeline"]

_FOLDER = "/timeline"
_COMMAND: Color = (72, 126, 216)
_NAMED = 2
"""Number of UAVs or links that a lane names; more of them are counted."""
_QUIET = {"commands": "as planned", "faults": "none", "links": "all up"}
"""What each lane says at first."""
_TINTS: dict[str, Color] = {"commands": _COMMAND, "faults": CUT, "links": STALE}
"""What is not quiet in each lane."""


class Timeline:
    """Sends the state of a lane when it changes."""

    def __init__(self, subject: Subject) -> None:
        self._uavs = sorted(subject.graph.uavs)
        self._known = {lane: [quiet] for lane, quiet in _QUIET.items()}
        """States of each lane so far."""
        self._states: dict[str, str] = {}

    def view(self) -> rrb.StateTimelineView:
        """Return the strip, over the whole flight up to the present."""
        start, end = rr.TimeRangeBoundary.infinite(), rr.TimeRangeBoundary.cursor_relative()
        axis = rrb.archetypes.TimeAxis(view_range=rr.TimeRange(start=start, end=end))
        return rrb.StateTimelineView(origin=_FOLDER, name="The flight so far", time_view=axis)

    def static(self) -> list[Entry]:
        """Return the colours of the states."""
        return [self._style(lane) for lane in _QUIET]

    def draw(self, snapshot: Snapshot) -> list[Entry]:
        """Return the lanes that have changed."""
        states = {
            "commands": self._command(snapshot.events),
            "faults": self._faults(snapshot),
            "links": self._links(snapshot),
        }
        entries = []
        for lane, state in states.items():
            if self._states.get(lane) == state:
                continue
            self._states[lane] = state
            if state not in self._known[lane]:
                self._known[lane].append(state)
                entries.append(self._style(lane))
            entries.append(Entry(f"{_FOLDER}/{lane}", snapshot.t, rr.StateChange(state=state)))
        return entries

    def _style(self, lane: str) -> Entry:
        known = self._known[lane]
        tints = [FRESH if state == _QUIET[lane] else _TINTS[lane] for state in known]
        return Entry(f"{_FOLDER}/{lane}", None, rr.StateConfiguration(values=known, colors=tints))

    def _faults(self, snapshot: Snapshot) -> str:
        words = []
        for uav in self._uavs:
            state = snapshot.uavs.get(uav)
            trouble = [] if state is None else faulty_actuators(state)
            trouble += ["silent"] if state is not None and is_silent(state, snapshot) else []
            words += [f"{name(uav)} {', '.join(trouble)}"] if trouble else []
        return _listed(words, f"{len(words)} UAVs", _QUIET["faults"])

    def _links(self, snapshot: Snapshot) -> str:
        words = [
            f"{sender} \N{RIGHTWARDS ARROW} {uav} cut"
            for uav in self._uavs
            if uav in snapshot.uavs
            for sender, link in snapshot.uavs[uav].links.items()
            if link.cut
        ]
        return _listed(words, f"{len(words)} links cut", _QUIET["links"])

    def _command(self, events: tuple[Event, ...]) -> str:
        """Return the latest command of a ground station, a program or a profile."""
        latest = self._states.get("commands", _QUIET["commands"])
        for event in events:
            if event.who or "command" in event.text:
                whose = "" if event.uav is None or event.text.startswith("UAV ") else f"{name(event.uav)}: "
                latest = f"{whose}{event.text}"
        return latest


def _listed(words: list[str], count: str, none: str) -> str:
    if not words:
        return none
    return ", ".join(words) if len(words) <= _NAMED else count
