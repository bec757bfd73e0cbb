"""Flight modes of an autopilot: as numbers for compiled functions, and as PX4-type ground stations name them."""

from __future__ import annotations

__all__ = ["HOLD", "MISSION", "NAMES", "OFFBOARD", "code_of", "custom_mode", "mode_called", "mode_of"]

MISSION = 0
"""The scheme flies."""
HOLD = 1
"""The UAV's own reference stands still, and it ignores its in-neighbours; its out-neighbours still hear it."""
OFFBOARD = 2
"""The scheme flies; the UAV's own reference comes from the ground."""

NAMES = {MISSION: "mission", HOLD: "hold", OFFBOARD: "offboard"}

_PX4 = {MISSION: (4, 4), HOLD: (4, 3), OFFBOARD: (6, 0)}
"""PX4's main and sub mode: AUTO MISSION, AUTO LOITER, OFFBOARD."""


def custom_mode(mode: int) -> int:
    """The custom mode of HEARTBEAT."""
    main, sub = _PX4[mode]
    return main << 16 | sub << 24


def mode_of(main: float, sub: float) -> int | None:
    """Our flight mode for PX4's main and sub mode; None where there is none."""
    for mode, (its_main, its_sub) in _PX4.items():
        if main == its_main and (sub == its_sub or its_main == 6):
            return mode
    return None


def code_of(name: str) -> int | None:
    """The custom mode of the flight mode with this name; None if there is none."""
    return next((custom_mode(mode) for mode, its_name in NAMES.items() if its_name == name), None)


def mode_called(custom: int) -> str:
    """The name of the flight mode in a HEARTBEAT's custom mode."""
    mode = mode_of(custom >> 16 & 0xFF, custom >> 24)
    return "unknown" if mode is None else NAMES[mode]
