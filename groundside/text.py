"""Format text that several pages and tables use."""

from __future__ import annotations

from collections.abc import Iterable

__all__ = ["ids"]


def ids(uavs: Iterable[int]) -> str:
    """Return ids in short form, such as 1-6, 8."""
    runs: list[list[int]] = []
    for uav in sorted(uavs):
        if runs and uav == runs[-1][-1] + 1:
            runs[-1].append(uav)
        else:
            runs.append([uav])
    return ", ".join(str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs)
