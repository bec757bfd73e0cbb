"""How much is drawn of a swarm: all of a small one in full, of a big one a few aircraft in full and the others as one.

The levels of detail, in one place:

- **Up to `FULL` UAVs** every aircraft is drawn in full: its body in its attitude, trail, reference, label, edges, and a
  curve in every plot.
- **Beyond**, at most `FULL` are: a few followers and leaders from the beginning on, and `TROUBLED` more as they get
  into trouble, which is a fault of an actuator or silence. Who has come into view stays there, repaired or not, so that
  a curve goes on. The others are drawn together, as sticks in their places and attitudes, by one call for all of them;
  plots show how far they reach, from the lowest to the highest; edges among them are drawn while they bring no news;
  the table sums them up and tells of those in trouble.

So the calls that make a picture do not grow with the swarm, only the arrays in them.
"""

from __future__ import annotations

from ftcc.groundside.dashboard.labels import in_trouble
from ftcc.groundside.dashboard.snapshot import Snapshot
from ftcc.groundside.dashboard.subject import Subject

__all__ = ["FULL", "Detail"]

FULL = 16
"""Aircraft that are drawn in full, at most."""
TROUBLED = 8
"""Room among these, in a big swarm, for aircraft that get into trouble."""
_LEADERS = 4
"""Leaders among the others, at most."""


class Detail:
    """Who of a swarm is drawn in full."""

    def __init__(self, subject: Subject) -> None:
        uavs = sorted(subject.graph.uavs)
        self.crowded = len(uavs) > FULL
        """Whether there are others, who are drawn together."""
        self.shown: list[int] = uavs
        """Who is drawn in full, in the order in which they came into view."""
        self.capacity = FULL if self.crowded else len(uavs)
        """How many there may be."""
        if self.crowded:
            leaders = subject.leaders[:_LEADERS]
            room, followers = FULL - TROUBLED - len(leaders), subject.followers
            spread = {len(followers) * i // room for i in range(room)}
            self.shown = sorted([*(uav for i, uav in enumerate(followers) if i in spread), *leaders])
        self._others = set(uavs) - set(self.shown)

    def update(self, snapshot: Snapshot) -> list[int]:
        """Take UAVs into view that have got into trouble, as long as there is room; those that are new."""
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
