"""The space that a recording takes, compared with what is free."""

from __future__ import annotations

from collections.abc import Collection

from ftcc.groundside.errors import UserError
from ftcc.groundside.scenario import Mission
from ftcc.groundside.simulation.columns import places_kept

__all__ = ["TooLargeError", "recording_size", "require_space"]


class TooLargeError(UserError):
    """The recording of a flight does not fit into memory or on the disk."""


def recording_size(mission: Mission, columns: Collection[str] | None = None) -> tuple[int, float]:
    """Return the rows of each UAV, and the size of a recording of these columns in memory, by default of all, GB."""
    timing, uavs = mission.timing, len(mission.uavs)
    rows = timing.ticks // timing.record_every + 1
    width = 2 + sum(map(len, places_kept(mission, columns).values()))
    return rows, 8 * rows * uavs * width / 1e9


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
