"""Filters, differentiators and shapers: states in, rates out."""

from __future__ import annotations

import math

from ftcc.airside.elements.nonlinear import clip, sign
from ftcc.airside.elements.vectors import added, scaled, subtracted
from ftcc.link.compiled import compiled

__all__ = [
    "butterworth",
    "butterworth_step",
    "complementary_rate",
    "critically_damped_step",
    "first_order_rate",
    "high_gain_observer",
    "implicit_butterworth_step",
    "limited_tracker",
    "low_pass_step",
    "reference_shaper",
    "robust_exact_differentiator_on_ramp",
    "robust_exact_differentiator_step",
    "second_order_reference_step",
    "sliding_mode_differentiator",
    "sliding_mode_differentiator_step",
]


@compiled
def first_order_rate(value, target, time_constant):
    """Rate of a first-order filter, eqs. (3.31), (4.24): time_constant value' + value = target.

    Dynamic surface control takes this rate as the derivative of the virtual control ``target``.
    """
    return (target - value) / time_constant


@compiled
def butterworth(value, rate, target, w):
    """Second-order Butterworth low-pass of bandwidth ``w`` (rad/s), eq. (6.14): y'' = w^2 (x - y) - sqrt(2) w y'.

    Returns
    -------
    (value', rate')
    """
    return rate, w * w * (target - value) - math.sqrt(2.0) * w * rate


@compiled
def butterworth_step(value, rate, target, w, h):
    """`butterworth` of three axes after a step of length ``h``, semi-implicitly: the rate first, eq. (7.35).

    Unstable from w h = sqrt(6) - sqrt(2) on.
    """
    _, first = butterworth(value[0], rate[0], target[0], w)
    _, second = butterworth(value[1], rate[1], target[1], w)
    _, third = butterworth(value[2], rate[2], target[2], w)
    rate = added(rate, scaled(h, (first, second, third)))
    return added(value, scaled(h, rate)), rate


@compiled
def implicit_butterworth_step(value, rate, target, w, h):
    """`butterworth` of three axes after a step of length ``h``, implicitly, eq. (8.7): stable for every h."""
    damping = math.sqrt(0.5)
    first, first_rate = second_order_reference_step(value[0], rate[0], target[0], 0.0, w, damping, h)
    second, second_rate = second_order_reference_step(value[1], rate[1], target[1], 0.0, w, damping, h)
    third, third_rate = second_order_reference_step(value[2], rate[2], target[2], 0.0, w, damping, h)
    return (first, second, third), (first_rate, second_rate, third_rate)


@compiled
def high_gain_observer(value, rate, target, epsilon, damping):
    """Second-order high-gain observer of ``target``, eqs. (5.22)-(5.24).

    epsilon value' = rate; epsilon rate' = -damping rate - value + target. rate / epsilon estimates target'.

    Returns
    -------
    (value', rate')
    """
    return rate / epsilon, (-damping * rate - value + target) / epsilon


@compiled
def sliding_mode_differentiator(value, derivative, target, mu1, mu2):
    """First-order sliding-mode differentiator of ``target`` (Levant), eq. (6.42) with the lost dot of its second line.

    value' = -mu1 |value - target|^0.5 sign(value - target) + derivative; derivative' = -mu2 sign(value - target). It
    follows exactly, after a finite time, where abs(target'') < mu2.

    Returns
    -------
    (value', derivative')
    """
    error = value - target
    return -mu1 * math.sqrt(abs(error)) * sign(error) + derivative, -mu2 * sign(error)


@compiled
def sliding_mode_differentiator_step(value, derivative, target, mu1, mu2, h):
    """`sliding_mode_differentiator` after an implicit step of length ``h``, in closed form; ``target`` is the new one.

    Steps itself: explicit steps chatter with an amplitude that a law would pass on to its actuators.

    Returns
    -------
    value, derivative
    """
    ahead = value + h * derivative - target
    if abs(ahead) <= h * h * mu2:
        return target, derivative - ahead / h
    root = 0.5 * (math.sqrt(h * h * mu1 * mu1 + 4.0 * (abs(ahead) - h * h * mu2)) - h * mu1)
    return target + root * root * sign(ahead), derivative - h * mu2 * sign(ahead)


@compiled
def low_pass_step(value, target, time_constant, h):
    """A first-order low-pass after ``h`` seconds of a constant ``target``, exactly; a time constant of 0 is none."""
    if time_constant <= 0.0:
        return target
    return target + (value - target) * math.exp(-h / time_constant)


@compiled
def complementary_rate(estimate, rate, measured, gain):
    """Rate of a complementary filter: follows ``rate`` at once and ``measured`` with the bandwidth ``gain`` (1/s)."""
    return rate + gain * (measured - estimate)


@compiled
def limited_tracker(value, rate, target, target_rate, w, limit):
    """Critically damped second-order tracker of a reference with limited acceleration (not in the monograph).

    No lag on a ramp.

    Returns
    -------
    (value', rate') with abs(rate') <= ``limit``
    """
    return rate, clip(w * w * (target - value) + 2.0 * w * (target_rate - rate), -limit, limit)


@compiled
def second_order_reference_step(value, rate, target, target_rate, w, damping, h):
    """One step of length ``h`` of r'' = w^2 (x - r) + 2 damping w (x' - r') (not in the monograph); no lag on a ramp.

    Steps itself, semi-implicitly: stable for every h.

    Returns
    -------
    value, rate after the step
    """
    pull = w * w * (target - value) + 2.0 * damping * w * target_rate
    rate = (rate + h * pull) / (1.0 + 2.0 * damping * w * h + w * w * h * h)
    return value + h * rate, rate


@compiled
def critically_damped_step(value, rate, target, w, h):
    """Second-order filter of a held ``target`` with a double pole at ``w`` (rad/s), ``h`` seconds later, exactly.

    Returns
    -------
    value, rate after the step; not in the monograph
    """
    offset = value - target
    mixed = rate + w * offset
    decay = math.exp(-w * h)
    return target + decay * (offset + mixed * h), decay * (rate - w * mixed * h)


@compiled
def robust_exact_differentiator_step(value, derivative, target, damping, cubic, bound, phi, h):
    """One Euler step of length ``h`` of the differentiator with fast convergence from afar, eq. (7.24).

    With er = value - target: value' = -damping (|er|^(1/2) + cubic |er|^(3/2)) sign(er) + derivative, and derivative'
    = -bound (0.5 sign(er) + 2 cubic er + 1.5 cubic^2 er^2 sign(er)). Only the signs of the second line, which jump, are
    smoothed to tanh(./phi): in the first the damping near er = 0 would vanish with them. Steps itself: the derivative
    first, then the value with the new one.

    Returns
    -------
    value, derivative after the step
    """
    error = value - target
    size = abs(error)
    smooth = math.tanh(error / phi)
    root = math.sqrt(size)
    derivative -= h * bound * ((0.5 + 1.5 * cubic * cubic * error * error) * smooth + 2.0 * cubic * error)
    return value + h * (derivative - damping * (root + cubic * size * root) * sign(error)), derivative


@compiled
def robust_exact_differentiator_on_ramp(value, derivative, before, target, damping, cubic, bound, phi, h, parts):
    """`robust_exact_differentiator_step` of three axes, ``parts`` steps over ``h`` seconds.

    Its input goes in a straight line from ``before`` to ``target``.
    """
    x, y, z = value
    x_rate, y_rate, z_rate = derivative
    part = h / parts
    for n in range(1, parts + 1):
        at = added(before, scaled(n / parts, subtracted(target, before)))
        x, x_rate = robust_exact_differentiator_step(x, x_rate, at[0], damping, cubic, bound, phi, part)
        y, y_rate = robust_exact_differentiator_step(y, y_rate, at[1], damping, cubic, bound, phi, part)
        z, z_rate = robust_exact_differentiator_step(z, z_rate, at[2], damping, cubic, bound, phi, part)
    return (x, y, z), (x_rate, y_rate, z_rate)


@compiled
def reference_shaper(z, v, a, target, target_rate, w, v_max, a_max):
    """Third-order shaper of a reference (not in the monograph): triple pole at ``w``, limited speed and acceleration.

    No lag on a ramp, a lag of 3 a / w^2 on an acceleration a.

    Returns
    -------
    (z', v', a') with abs(v) approaching at most ``v_max`` and abs(a) at most ``a_max``
    """
    wanted_v = clip(target_rate + (w / 3.0) * (target - z), -v_max, v_max)
    wanted_a = clip(w * (wanted_v - v), -a_max, a_max)
    return v, a, 3.0 * w * (wanted_a - a)
