"""State of the swarm at one instant: the station collects it and the dashboard draws it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

__all__ = ["Event", "LinkState", "Pace", "Snapshot", "UavState"]


@dataclass(frozen=True)
class Event:
    """An event: a fault, a link event, a text from a vehicle, a process that died."""

    t: float
    """Simulated time, s."""
    severity: str
    """"info", "warning" or "error"."""
    text: str
    uav: int | None = None
    who: str = ""
    """Sender of the command that caused it (MAVLink system/component), if any."""
    outcome: str = ""
    """Outcome of that command: accepted, denied, armed, acts, ..."""


@dataclass(frozen=True)
class LinkState:
    """State of a link at its receiver."""

    age: float
    """Age of the newest record received, s; inf before the first."""
    received: int
    lost: int
    cut: bool
    """Whether the link is cut or a radio is off."""
    trust: float = 1.0
    """Share of its weight that the receiver's defences leave the sender."""


@dataclass(frozen=True)
class UavState:
    """One UAV."""

    t: float
    """Simulated time of these values, s."""
    truth: Mapping[str, float]
    """True states by the names of ``sim.plant.TRUTH``: x, y, z (up), V, gamma, chi, mu, alpha, beta, theta, p, q, r."""
    command: Mapping[str, float]
    """Current commands by the names of ``ACTUATORS`` (rad, N)."""
    acting: Mapping[str, float]
    """Actual actuator positions (rad, N)."""
    effectiveness: Mapping[str, float]
    """Remaining effectiveness of each actuator; 1 = healthy."""
    bias: Mapping[str, float]
    signals: Mapping[str, float]
    """Values of the scheme's ``SIGNALS``; empty for a leader."""
    links: Mapping[int, LinkState]
    """Incoming links by sender."""
    disturbances: Mapping[str, float] = field(default_factory=dict)
    """True disturbances by the names of the plant."""
    mode: str = ""
    """Flight mode: mission, hold or offboard; empty if unknown."""
    late: int = 0
    """Ticks in which the command came too late."""


@dataclass(frozen=True)
class Pace:
    """How fast the swarm flies on the wall clock, and what limits it."""

    factor: float
    """Times real time, over the last seconds; nan if not measured yet."""
    asked: float | None
    """Requested times real time; None: as fast as possible."""
    limit: str = ""
    """Limit, in one short sentence; empty if there is none."""
    advice: str = ""
    """Advice how to fly faster."""


@dataclass(frozen=True)
class Snapshot:
    """State of the swarm at one instant."""

    t: float
    """Simulated time, s."""
    uavs: Mapping[int, UavState]
    events: tuple[Event, ...] = field(default=())
    """Events since the previous snapshot."""
    pace: Pace | None = None
    """None if it is not measured, as in a recorded run."""

    def after(self, earlier: tuple[Event, ...]) -> Snapshot:
        """Return this snapshot with ``earlier`` events put before its own."""
        return replace(self, events=earlier + self.events)
