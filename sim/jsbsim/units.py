"""JSBSim's units in ours, exactly."""

from __future__ import annotations

__all__ = ["FOOT", "POUND", "SLUG"]

FOOT = 0.3048
"""m."""
POUND = 0.45359237 * 9.80665
"""N."""
SLUG = POUND / FOOT
"""kg."""
