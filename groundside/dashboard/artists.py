"""Combine everything that a dashboard draws: the swarm in space, its curves, its table, its events."""

from __future__ import annotations

from ftcc.groundside.dashboard.attitudes import Attitudes
from ftcc.groundside.dashboard.blueprints import blueprint
from ftcc.groundside.dashboard.detail import Detail
from ftcc.groundside.dashboard.diagnosis import DiagnosisPanel
from ftcc.groundside.dashboard.pace import PaceCurve
from ftcc.groundside.dashboard.plots import Plots
from ftcc.groundside.dashboard.scene import Scene
from ftcc.groundside.dashboard.snapshot import Snapshot
from ftcc.groundside.dashboard.subject import Subject
from ftcc.groundside.dashboard.table import Table, event_entries
from ftcc.groundside.dashboard.timeline import Timeline
from ftcc.groundside.dashboard.viewer import BLUEPRINT, Entry

__all__ = ["Artists"]


class Artists:
    """Turns snapshots into Rerun entries. The first snapshot sets the scale of the scene."""

    def __init__(self, subject: Subject, first: Snapshot) -> None:
        self._pace = PaceCurve() if first.pace is not None else None
        self._detail = Detail(subject)
        self._detail.update(first)
        self._scene = Scene(subject, first, self._detail)
        self._attitudes = Attitudes(subject, self._detail) if subject.family == "attitude" else None
        self._plots = Plots(subject, self._detail)
        self._diagnosis = DiagnosisPanel(subject, self._detail) if subject.diagnosed else None
        self._table = Table(subject, self._detail)
        self._timeline = Timeline(subject)

    def static(self) -> list[Entry]:
        """Return the entries that are logged once, the blueprint first."""
        attitudes = self._attitudes.static() if self._attitudes is not None else []
        pace = self._pace.static() if self._pace is not None else []
        beliefs = self._diagnosis.static() if self._diagnosis is not None else []
        curves = [*self._plots.static(), *beliefs, *pace]
        return [self._layout(), *self._scene.static(), *attitudes, *curves, *self._timeline.static()]

    def draw(self, snapshot: Snapshot) -> list[Entry]:
        """Return the entries of one snapshot and its events."""
        new = self._detail.update(snapshot)
        entries = [*self._scene.draw(snapshot, new), *self._plots.draw(snapshot, new), *self._table.draw(snapshot)]
        entries += self._timeline.draw(snapshot)
        if self._attitudes is not None:
            entries += self._attitudes.draw(snapshot, new)
        if self._diagnosis is not None:
            # A UAV that is drawn in full from now on gets a tab.
            entries += [*([self._layout()] if new else []), *self._diagnosis.draw(snapshot, new)]
        return entries + self._draw_pace(snapshot) + event_entries(snapshot.events)

    def _draw_pace(self, snapshot: Snapshot) -> list[Entry]:
        """Draw the pace; its plot joins the layout with the first measurement, which a recorded run does not have."""
        if self._pace is not None:
            return self._pace.draw(snapshot)
        if snapshot.pace is None:
            return []
        self._pace = PaceCurve()
        return [self._layout(), *self._pace.static(), *self._pace.draw(snapshot)]

    def _layout(self) -> Entry:
        layout = blueprint(
            self._scene, self._attitudes, self._plots, self._table, self._timeline, self._pace, self._diagnosis
        )
        return Entry(BLUEPRINT, None, layout)
