"""Choose the level of detail: a small swarm is drawn in full, of a big one only a few aircraft.

- **Up to `FULL` UAVs**, every aircraft is drawn in full: its body in its attitude, trail, reference, label, edges, and
  a curve in every plot.
- **Above**, at most `FULL` aircraft are drawn in full: a few followers and leaders from the start, and up to `TROUBLED`
  more when they have an actuator fault or fall silent. Such an aircraft stays, repaired or not, so that its curves
  continue. One call draws all others, as sticks in their positions and attitudes. Plots show the lowest and the highest
  value of all UAVs. Edges between the others are drawn only while they are stale or cut. The table has a summary and
  a row for each UAV in trouble.

So the number of calls per snapshot does not grow with the swarm; only the arrays do.
"""

from __future__ import annotations

from ftcc.groundside.dashboard.labels import in_trouble
from ftcc.groundside.dashboard.snapshot import Snapshot
from ftcc.groundside.dashboard.subject import Subject

__all__ = ["FULL", "Detail"]

FULL = 16
"""Largest number of aircraft drawn in full."""
TROUBLED = 8
"""Part of these that a big swarm keeps for aircraft that get into trouble."""
_LEADERS = 4
"""Largest number of leaders that a big swarm draws in full from the start."""


class Detail:
    """The UAVs of a swarm that are drawn in full."""

    def __init__(self, subject: Subject) -> None:
        uavs = sorted(subject.graph.uavs)
        self.crowded = len(uavs) > FULL
        """Whether the swarm is big, so that some UAVs are not drawn in full."""
        self.shown: list[int] = uavs
        """UAVs drawn in full, in the order in which they were added."""
        self.capacity = FULL if self.crowded else len(uavs)
        """Largest length of ``shown``."""
        if self.crowded:
            leaders = subject.leaders[:_LEADERS]
            count, followers = FULL - TROUBLED - len(leaders), subject.followers
            spread = {len(followers) * i // count for i in range(count)}
            self.shown = sorted([*(uav for i, uav in enumerate(followers) if i in spread), *leaders])
        self._others = set(uavs) - set(self.shown)

    def update(self, snapshot: Snapshot) -> list[int]:
        """Add UAVs that have got into trouble while there is room, and return the added ones."""
        new: list[int] = []
        if not self.crowded or len(self.shown) >= self.capacity:
            return new
        for uav, state in snapshot.uavs.items():
            if uav in self._others and in_trouble(state, snapshot):
                new.append(uav)
                self._others.remove(uav)
                self.shown.append(uav)
                if len(self.shown) >= self.capacity:
                    break
        return new
