"""Commands of the ground to a leader in flight: rows of its profile's commands that overrule all others."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.references.profiles.arrays import FROM_GROUND
from ftcc.airside.references.profiles.motion import command_in_force

__all__ = ["command_from_ground", "release_from_ground"]


def command_from_ground(
    commands: NDArray[np.float64],
    triggers: NDArray[np.float64],
    state: NDArray[np.float64],
    now: float,
    at: float,
    altitude: float | None,
    speed: float | None,
) -> bool:
    """From ``at`` on (s, not before ``now``) go to this altitude (m) and speed (m/s); None: that in force by then.

    Overrules the profile's own commands for good. Returns False where too many are waiting.
    """
    rows = commands[-FROM_GROUND:]
    own = [row.copy() for row in rows if row[0] < math.inf]
    in_force = [row for row in own if row[0] <= now][-1:]
    waiting = [row for row in own if now < row[0] < at]
    before = (in_force + waiting)[-1][1:] if in_force + waiting else command_in_force(commands, triggers, state, at)
    new = np.array([at, before[0] if altitude is None else altitude, before[1] if speed is None else speed])
    kept = [*in_force, *waiting, new, *(row for row in own if row[0] > max(now, at))]
    if len(kept) > FROM_GROUND:
        return False
    rows[:] = math.inf
    rows[: len(kept)] = kept
    return True


def release_from_ground(commands: NDArray[np.float64]) -> None:
    """The profile's own commands are in force again."""
    commands[-FROM_GROUND:] = math.inf
