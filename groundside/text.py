"""Format text that several pages and tables use."""

from __future__ import annotations

from collections.abc import Iterable

__all__ = ["ids", "ids_of"]


def ids(uavs: Iterable[int]) -> str:
    """Return ids in short form, such as 1-6, 8."""
    runs: list[list[int]] = []
    for uav in sorted(uavs):
        if runs and uav == runs[-1][-1] + 1:
            runs[-1].append(uav)
        else:
            runs.append([uav])
    return ", ".join(str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs)


def ids_of(text: str) -> tuple[int, ...]:
    """Return the ids that a short form such as "1-6, 8" names, in ascending order.

    Raises
    ------
    ValueError
        If it is no such form; the text says what it must be.
    """
    found: set[int] = set()
    for part in text.split(","):
        first, dash, last = (piece.strip() for piece in part.partition("-"))
        if not first.isdecimal() or (dash and not last.isdecimal()) or (dash and int(last) < int(first)):
            raise ValueError(f"{text!r}: must be ids of UAVs such as 1-6, 8")
        found.update(range(int(first), int(last or first) + 1))
    return tuple(sorted(found))
