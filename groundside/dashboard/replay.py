"""Convert a recorded run to a sequence of snapshots, so that the dashboard shows it as in the live flight."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.dashboard.snapshot import Event, LinkState, Snapshot, UavState
from ftcc.groundside.results import Run
from ftcc.sim.plant import TRUTH
from ftcc.sim.plants import find

__all__ = ["RATE", "draw_run", "events_of", "snapshots_of"]

RATE = 10.0
"""Snapshots per simulated second."""
_ROUNDING = 1e-6
"""Tolerance when times are compared, s."""


class _Links:
    """Link states of a run over time."""

    def __init__(self, run: Run) -> None:
        links = run.links
        self._times = np.unique(links["t"])
        self._places = np.searchsorted(self._times, links["t"])
        self._columns = {name: links[name] for name in ("uav", "sender", "received", "lost", "oldest")}
        # Runs of earlier versions have none.
        self._columns["trust"] = links.get("trust", np.ones(len(links["t"])))

    def at(self, t: float) -> dict[int, dict[int, LinkState]]:
        """Return the last state of each link up to ``t``, by receiver and sender."""
        place = int(np.searchsorted(self._times, t + _ROUNDING)) - 1
        if place < 0:
            return {}
        states: dict[int, dict[int, LinkState]] = {}
        before = self._rows(place - 1)
        for edge, (received, lost, oldest, trust) in self._rows(place).items():
            received_before, lost_before, _, _ = before.get(edge, (0, 0, 0.0, 1.0))
            received_since, lost_since = received - received_before, lost - lost_before
            age = math.inf if math.isnan(oldest) else oldest
            states.setdefault(edge[0], {})[edge[1]] = LinkState(
                age, received, lost, received_since == 0 and lost_since > 0, trust
            )
        return states

    def _rows(self, place: int) -> dict[tuple[int, int], tuple[int, int, float, float]]:
        if place < 0:
            return {}
        rows = np.flatnonzero(self._places == place)
        c = self._columns
        return {
            (int(c["uav"][n]), int(c["sender"][n])): (
                int(c["received"][n]), int(c["lost"][n]), float(c["oldest"][n]), float(c["trust"][n])
            )
            for n in rows
        }  # fmt: skip


def events_of(run: Run) -> list[Event]:
    """Return the events of a run, in the order of the log."""
    return [
        Event(
            float(e["t"]), str(e["severity"]), str(e["text"]), e.get("uav"), e.get("who", ""), e.get("outcome", "")
        )
        for e in run.events
    ]  # fmt: skip


def snapshots_of(run: Run, rate: float = RATE) -> Iterator[Snapshot]:
    """Yield snapshots of a run at ``rate`` (Hz, simulated time), from its start to its last recorded row."""
    mission = run.mission
    plant = find(mission.plant)
    signals = [quantity.name for quantity in mission.signals]
    names = {
        "truth": {name: name for name in TRUTH},
        "command": {name: f"{name}_command" for name in plant.ACTUATORS},
        "acting": {name: name for name in plant.ACTUATORS},
        "effectiveness": {name: f"{name}_effectiveness" for name in plant.ACTUATORS},
        "bias": {name: f"{name}_bias" for name in plant.ACTUATORS},
        "disturbances": {name: name for name, _ in plant.DISTURBANCES},
        "signals": {name: name for name in signals},
    }
    columns: dict[int, dict[str, NDArray[Any]]] = {
        uav: {column: run.column(column, uav) for group in names.values() for column in group.values()}
        for uav in run.uavs
    }
    times = {uav: run.column("t", uav) for uav in run.uavs}
    links = _Links(run)
    events = events_of(run)
    next_event = 0
    last = math.floor(run.end * rate + _ROUNDING)
    for k in range(last + 1):
        t = k / rate
        states = {}
        link_states = links.at(t)
        for uav, own in times.items():
            row = int(np.searchsorted(own, t + _ROUNDING)) - 1
            if row < 0:
                continue
            values: dict[str, Any] = {
                group: {name: float(columns[uav][column][row]) for name, column in of_group.items()}
                for group, of_group in names.items()
            }
            states[uav] = UavState(t=float(own[row]), links=link_states.get(uav, {}), **values)
        new_events = []
        # The last snapshot includes all later events.
        while next_event < len(events) and (k == last or events[next_event].t <= t + _ROUNDING):
            new_events.append(events[next_event])
            next_event += 1
        yield Snapshot(t, states, tuple(new_events))


def draw_run(run: Run, recording: Path, rate: float = RATE) -> Path:
    """Draw a run's dashboard into a recording (.rrd) and return its path."""
    from ftcc.groundside.dashboard import Dashboard, Subject

    recording.touch()  # fails here, before anything is drawn, if the file cannot be written
    dashboard = Dashboard(Subject.of(run.mission), recording=recording, viewer="none")
    for snapshot in snapshots_of(run, rate):
        dashboard.log(snapshot)
    dashboard.close()
    return recording
