"""What a leader's profile is made of."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["Command", "Cosine", "Profile", "SpeedWave", "Trigger"]


@dataclass(frozen=True)
class Command:
    """From ``at`` on (s), go to this altitude (m) and speed (m/s)."""

    at: float
    altitude: float
    speed: float


@dataclass(frozen=True)
class Trigger:
    """Once leader ``uav`` has passed the forward position ``x`` (m), go to this altitude (m) and speed (m/s)."""

    uav: int
    x: float
    altitude: float
    speed: float


@dataclass(frozen=True)
class Cosine:
    """From ``at`` on (s): amplitude (cos(frequency (t - at)) - 1), m, added to the altitude."""

    at: float
    amplitude: float
    frequency: float


@dataclass(frozen=True)
class SpeedWave:
    """amplitude sin(frequency t), m/s, added to the speed from t = 0 on."""

    amplitude: float
    frequency: float


@dataclass(frozen=True)
class Profile:
    """A leader's commanded motion."""

    x: float
    """Forward position at the start, m."""
    z: float
    """Altitude at the start, m."""
    V: float
    """Speed at the start, m/s."""
    commands: tuple[Command, ...] = ()
    """In order of time."""
    altitude_filter: tuple[float, float] = (0.05, 0.9)
    """Natural frequency (rad/s) and damping of the altitude filter."""
    speed_filter: tuple[float, float] = (0.05, 0.95)
    cosine: Cosine | None = None
    triggers: tuple[Trigger, ...] = ()
    """In the order in which they fire: each is armed by the one before it."""
    forward: bool = False
    """Speeds are forward speeds x' instead of airspeeds."""
    speed_wave: SpeedWave | None = None
    climb_limit: float = math.inf
    """Largest climb rate, m/s: what the followers can fly and estimate; the altitude filter waits at it."""
    sink_limit: float = math.inf
    """Largest sink rate, m/s."""
