"""Describe the swarm that a dashboard shows: all that does not change in flight."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from ftcc.airside.references.position import Fire
from ftcc.airside.scheme import Quantity
from ftcc.link.actuators import SLOT
from ftcc.link.graph import Graph
from ftcc.sim.obstacles import Obstacle
from ftcc.sim.plants import find

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission

__all__ = ["Family", "Subject"]

Family = Literal["containment", "formation", "attitude", "fire"]
"""Kind of flight, which selects the blueprint."""


@dataclass(frozen=True)
class Subject:
    """A swarm to show."""

    title: str
    """Name of the recording."""
    family: Family
    graph: Graph
    """Communication graph."""
    signals: tuple[Quantity, ...]
    """The scheme's ``SIGNALS``."""
    limits: Mapping[str, tuple[float, float]]
    """Limits of the actuators that the scheme commands, by name, in their units."""
    disturbances: tuple[tuple[str, str], ...] = ()
    """Names and units of the plant's disturbances."""
    obstacles: tuple[Obstacle, ...] = ()
    fire: Fire | None = None
    """Fire that the swarm flies around; the scheme's signals give its centre."""
    diagnosed: tuple[str, ...] = ()
    """Actuators that followers diagnose; empty without diagnosis."""
    stale_after: float = 0.5
    """Age of the newest record from which a link counts as stale, s."""

    @classmethod
    def of(cls, mission: Mission) -> Subject:
        """Return the subject of a mission."""
        plant = find(mission.plant)
        follower = next(spec for spec in mission.vehicles if spec.kind != "reference_point")
        return cls(
            title=mission.title,
            family=_family(mission),
            graph=mission.graph,
            signals=mission.signals,
            limits={name: follower.limits[SLOT[name]] for name in mission.scheme.commands},
            disturbances=plant.DISTURBANCES,
            obstacles=mission.obstacles,
            fire=mission.fire,
            diagnosed=next((spec.diagnosis.actuators for spec in mission.autopilots if spec.diagnosis.on), ()),
        )

    @property
    def followers(self) -> tuple[int, ...]:
        """Return their ids, ascending."""
        return tuple(sorted(self.graph.followers))

    @property
    def leaders(self) -> tuple[int, ...]:
        """Return their ids, ascending."""
        return tuple(sorted(self.graph.leaders))


def _family(mission: Mission) -> Family:
    if mission.scheme.plant == "attitude":
        return "attitude"
    if mission.fire is not None:
        return "fire"
    return "containment" if len(mission.graph.leaders) > 1 else "formation"
