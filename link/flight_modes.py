"""Modes of an autopilot: as numbers that compiled functions understand, and as a PX4-type ground station names them."""

from __future__ import annotations

__all__ = ["HOLD", "MISSION", "NAMES", "OFFBOARD", "code_of", "custom_mode", "mode_called", "mode_of"]

MISSION = 0
"""The scheme flies."""
HOLD = 1
"""What the UAV refers to stands still, neighbours are ignored; they are still told."""
OFFBOARD = 2
"""The scheme flies; what the UAV refers to by itself comes from the ground."""

NAMES = {MISSION: "mission", HOLD: "hold", OFFBOARD: "offboard"}

_PX4 = {MISSION: (4, 4), HOLD: (4, 3), OFFBOARD: (6, 0)}
"""PX4's main and sub mode: AUTO MISSION, AUTO LOITER, OFFBOARD."""


def custom_mode(mode: int) -> int:
    """The custom mode of HEARTBEAT."""
    main, sub = _PX4[mode]
    return main << 16 | sub << 24


def mode_of(main: float, sub: float) -> int | None:
    """Our mode, or None where PX4's means nothing here."""
    for mode, (its_main, its_sub) in _PX4.items():
        if main == its_main and (sub == its_sub or its_main == 6):
            return mode
    return None


def code_of(name: str) -> int | None:
    """The custom mode of a mode by its name; None if there is no such mode."""
    return next((custom_mode(mode) for mode, its_name in NAMES.items() if its_name == name), None)


def mode_called(custom: int) -> str:
    """The name of the mode that a HEARTBEAT tells."""
    mode = mode_of(custom >> 16 & 0xFF, custom >> 24)
    return "unknown" if mode is None else NAMES[mode]
