"""Modes of an autopilot, as numbers that compiled functions understand."""

from __future__ import annotations

__all__ = ["HOLD", "MISSION", "OFFBOARD"]

MISSION = 0
"""The scheme flies."""
HOLD = 1
"""What the UAV refers to stands still, neighbours are ignored; they are still told."""
OFFBOARD = 2
"""The scheme flies; what the UAV refers to by itself comes from the ground."""
