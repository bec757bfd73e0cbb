"""Auxiliary systems that carry what saturation took from a command."""

from __future__ import annotations

from ftcc.link.compiled import compiled

__all__ = ["linear_auxiliary_rate"]


@compiled
def linear_auxiliary_rate(state, gain, effectiveness, saturated, wanted):  # type: ignore[no-untyped-def]
    """Rate of a linear auxiliary system, eqs. (4.19), (5.33), (5.39): -gain state + g (sat(u) - u)."""
    return -gain * state + effectiveness * (saturated - wanted)
