"""Filters and shapers: states in, rates out."""

from __future__ import annotations

from ftcc.airside.model import clip
from ftcc.link.compiled import compiled

__all__ = ["high_gain_observer", "reference_shaper"]


@compiled
def high_gain_observer(value, rate, target, epsilon, damping):  # type: ignore[no-untyped-def]
    """Second-order high-gain observer of ``target``, eqs. (5.22)-(5.24).

    epsilon value' = rate; epsilon rate' = -damping rate - value + target. rate / epsilon estimates target'.

    Returns
    -------
    (value', rate')
    """
    return rate / epsilon, (-damping * rate - value + target) / epsilon


@compiled
def reference_shaper(z, v, a, target, target_rate, w, v_max, a_max):  # type: ignore[no-untyped-def]
    """Third-order shaper of a reference (not in the monograph): triple pole at ``w``, limited speed and acceleration.

    No lag on a ramp, a lag of 3 a / w^2 on an acceleration a.

    Returns
    -------
    (z', v', a') with abs(v) approaching at most ``v_max`` and abs(a) at most ``a_max``
    """
    wanted_v = clip(target_rate + (w / 3.0) * (target - z), -v_max, v_max)
    wanted_a = clip(w * (wanted_v - v), -a_max, a_max)
    return v, a, 3.0 * w * (wanted_a - a)
