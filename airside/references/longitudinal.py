"""Motion in the vertical plane: a follower's own reference is the constants of the mission, and nothing else."""

from __future__ import annotations

from typing import NamedTuple

from ftcc.link.compiled import compiled

__all__ = ["Reference", "refer", "stand"]


class Reference(NamedTuple):
    """Commanded motion in the vertical plane: a leader's profile, or the mission constants that followers know."""

    x: float
    """Forward position, m."""
    V: float
    """Airspeed, m/s."""
    V_dot: float
    """m/s^2."""
    z: float
    """Altitude, m."""
    z_dot: float
    """m/s."""
    z_ddot: float
    """m/s^2."""
    x_dot: float = 0.0
    """Forward speed, m/s."""


@compiled
def refer(parameters, commands, reference, now_us, period_us):
    """Constants stay what they are."""


@compiled
def stand(reference, period_us):
    """They do so in hold, too."""
    return True
