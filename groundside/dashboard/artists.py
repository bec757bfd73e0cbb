"""Everything that a dashboard draws, in one place: the swarm in space, its curves, its table, its events."""

from __future__ import annotations

from ftcc.groundside.dashboard.attitudes import Attitudes
from ftcc.groundside.dashboard.blueprints import blueprint
from ftcc.groundside.dashboard.plots import Plots
from ftcc.groundside.dashboard.scene import Scene
from ftcc.groundside.dashboard.subject import Subject
from ftcc.groundside.dashboard.table import Table, events
from ftcc.groundside.dashboard.viewer import BLUEPRINT, Entry
from ftcc.groundside.snapshot import Snapshot

__all__ = ["Artists"]


class Artists:
    """Turns snapshots into what is logged. The first one tells how large the swarm is."""

    def __init__(self, subject: Subject, first: Snapshot) -> None:
        self._scene = Scene(subject, first)
        self._attitudes = Attitudes(subject) if subject.family == "attitude" else None
        self._plots = Plots(subject)
        self._table = Table(subject)

    def static(self) -> list[Entry]:
        """What is logged once, the blueprint first."""
        layout = Entry(BLUEPRINT, None, blueprint(self._scene, self._attitudes, self._plots, self._table))
        attitudes = self._attitudes.static() if self._attitudes is not None else []
        return [layout, *self._scene.static(), *attitudes, *self._plots.static()]

    def draw(self, snapshot: Snapshot) -> list[Entry]:
        """One instant, and what happened before it."""
        entries = [*self._scene.draw(snapshot), *self._plots.draw(snapshot), *self._table.draw(snapshot)]
        if self._attitudes is not None:
            entries += self._attitudes.draw(snapshot)
        return entries + events(snapshot.events)
