"""Numbers as texts for people."""

from __future__ import annotations

__all__ = ["as_seconds"]


def as_seconds(time_us: int) -> str:
    """A simulated time (us) in s, with all its digits and no more."""
    return f"{time_us / 1e6:.6f}".rstrip("0").rstrip(".")
