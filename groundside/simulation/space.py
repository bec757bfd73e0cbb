"""The space that a recording takes, compared with what is free."""

from __future__ import annotations

from ftcc.groundside.errors import UserError
from ftcc.groundside.scenario import Mission
from ftcc.sim.plant import TRUTH
from ftcc.sim.plants import conditions_of

__all__ = ["TooLargeError", "recording_size", "require_space"]


class TooLargeError(UserError):
    """The recording of a flight does not fit into memory or on the disk."""


def recording_size(mission: Mission) -> tuple[int, float]:
    """Return the rows of each UAV, and the size of the whole recording in memory, GB."""
    timing, uavs = mission.timing, len(mission.uavs)
    rows = timing.ticks // timing.record_every + 1
    columns = 2 + len(TRUTH) + 2 * 4 + len(conditions_of(mission.plant)) + len(mission.scheme.signals)
    return rows, 8 * rows * uavs * columns / 1e9


def require_space(mission: Mission, needed: float, free: float, of: str) -> None:
    """Refuse a flight whose recording needs more GB than are free.

    Raises
    ------
    TooLargeError
    """
    if needed > free:
        what = f"{recording_size(mission)[0]} rows of {len(mission.uavs)} UAVs"
        raise TooLargeError(
            f"duration = {mission.timing.duration:g}: {what} take {needed:.1f} GB of {of}, {free:.1f} GB are free; "
            "shorten the flight, or lower record_rate"
        )
