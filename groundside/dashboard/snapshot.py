"""What is known of the swarm at one instant: what the station gathers and the dashboard draws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

__all__ = ["Event", "LinkState", "Pace", "Snapshot", "UavState"]


@dataclass(frozen=True)
class Event:
    """Something that happened: a fault, a link event, a text from a vehicle, a process that died."""

    t: float
    """Simulated time, s."""
    severity: str
    """"info", "warning" or "error"."""
    text: str
    uav: int | None = None
    who: str = ""
    """Who asked for it (MAVLink system/component), where somebody on the ground did."""
    outcome: str = ""
    """What became of that: accepted, denied, armed, acts, ..."""


@dataclass(frozen=True)
class LinkState:
    """One in-edge as its receiver sees it."""

    age: float
    """Age of the newest record heard, s; inf before the first."""
    received: int
    lost: int
    cut: bool
    """The channel is blocked or a radio is off."""


@dataclass(frozen=True)
class UavState:
    """One UAV."""

    t: float
    """Simulated time of these values, s."""
    truth: Mapping[str, float]
    """By the names of ``sim.plant.TRUTH``: x, y, z (up), V, gamma, chi, mu, alpha, beta, theta, p, q, r."""
    command: Mapping[str, float]
    """Command in force, by the names of ``ACTUATORS`` (rad, N)."""
    acting: Mapping[str, float]
    """What acts on the airframe."""
    effectiveness: Mapping[str, float]
    """Remaining effectiveness of each actuator; 1 = healthy."""
    bias: Mapping[str, float]
    signals: Mapping[str, float]
    """The scheme's ``SIGNALS``; empty for a leader."""
    links: Mapping[int, LinkState]
    """In-edges by sender."""
    disturbances: Mapping[str, float] = field(default_factory=dict)
    """True ones, by the names of the plant."""
    mode: str = ""
    """Of its autopilot: mission, hold, offboard; empty if it has not said so."""
    late: int = 0
    """Ticks in which the command came too late."""


@dataclass(frozen=True)
class Pace:
    """How fast the swarm flies on the wall clock, and why not faster."""

    factor: float
    """Times real time, reached over the last seconds; nan while it is not known yet."""
    asked: float | None
    """Times real time that were asked for; None = as fast as possible."""
    limit: str = ""
    """What limits it, in one short sentence; empty if nothing does."""
    advice: str = ""
    """What would help."""


@dataclass(frozen=True)
class Snapshot:
    """The swarm."""

    t: float
    """Simulated time, s."""
    uavs: Mapping[int, UavState]
    events: tuple[Event, ...] = field(default=())
    """What happened since the last snapshot."""
    pace: Pace | None = None
    """None where nobody measures it, as in a recorded run."""

    def after(self, earlier: tuple[Event, ...]) -> Snapshot:
        """The same with what happened before."""
        return replace(self, events=earlier + self.events)
