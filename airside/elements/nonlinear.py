"""Static nonlinearities."""

from __future__ import annotations

import math

from ftcc.link.compiled import compiled

__all__ = ["clip", "limited", "rounded_power", "sign", "signed_power", "smooth_power", "smooth_powers", "smooth_signs"]


@compiled
def sign(value: float) -> float:
    """-1, 0 or 1."""
    if value > 0.0:
        return 1.0
    return -1.0 if value < 0.0 else 0.0


@compiled
def signed_power(value: float, exponent: float) -> float:
    """abs(value)^exponent sign(value), eqs. (6.22), (6.32); for 0 < exponent < 1 continuous, steep at 0."""
    return math.pow(abs(value), exponent) * sign(value)


@compiled
def rounded_power(value: float, exponent: float, width: float) -> tuple[float, float]:
    """`signed_power`, made linear where abs(value) <= width, and its slope: chapter 9 [R]."""
    if abs(value) <= width:
        slope = math.pow(width, exponent - 1.0)
        return slope * value, slope
    return signed_power(value, exponent), exponent * math.pow(abs(value), exponent - 1.0)


@compiled
def smooth_power(value: float, exponent: float, phi: float) -> float:
    """`signed_power` with the sign smoothed to tanh(./phi), eqs. (7.23), (7.37)."""
    return math.pow(abs(value), exponent) * math.tanh(value / phi)


@compiled
def smooth_powers(a, exponent, phi):
    """`smooth_power` of three axes."""
    return smooth_power(a[0], exponent, phi), smooth_power(a[1], exponent, phi), smooth_power(a[2], exponent, phi)


@compiled
def smooth_signs(a, phi):
    """The sign of three axes, smoothed to tanh(./phi)."""
    return math.tanh(a[0] / phi), math.tanh(a[1] / phi), math.tanh(a[2] / phi)


@compiled
def clip(value: float, low: float, high: float) -> float:
    """``value`` limited to [low, high]."""
    return min(max(value, low), high)


@compiled
def limited(value: float, limit: float) -> float:
    """``value`` limited to abs(value) <= limit; a limit of 0 is none."""
    if limit <= 0.0:
        return value
    return min(max(value, -limit), limit)
