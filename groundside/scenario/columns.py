"""The first columns of a recording."""

from __future__ import annotations

from collections.abc import Collection

from ftcc.sim.plant import TRUTH

__all__ = ["LEADING", "leading_columns"]

_SHOWN = ("thrust", "elevator", "aileron", "rudder", "load_factor", "bank")

LEADING = ("t", "uav", *TRUTH, *(f"{name}_command" for name in _SHOWN), *_SHOWN)
"""The first columns of ``signals.parquet``, over all plants; the scheme's SIGNALS follow."""


def leading_columns(actuators: Collection[str]) -> list[str]:
    """Return those first columns that an aircraft with these actuators has."""
    lacking = {name for name in _SHOWN if name not in actuators}
    return [name for name in LEADING if name.removesuffix("_command") not in lacking]
