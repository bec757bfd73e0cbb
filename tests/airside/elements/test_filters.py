"""Filters and shapers against transfer functions and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import signal

from ftcc.airside.elements.filters import (
    butterworth,
    complementary_rate,
    critically_damped_step,
    first_order_rate,
    high_gain_observer,
    limited_tracker,
    low_pass_step,
    reference_shaper,
    robust_exact_differentiator_step,
    second_order_reference_step,
    sliding_mode_differentiator,
    sliding_mode_differentiator_step,
)
from tests.airside.elements.motion import integrated

T = np.linspace(0.0, 2.0, 41)


def response(numerator: list[float], denominator: list[float], u: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Output of a transfer function, from rest."""
    return np.asarray(signal.lsim((numerator, denominator), u, t)[1])


def test_first_order_filter_takes_its_time_constant():
    (value,) = integrated(lambda t, y: [first_order_rate(y[0], 3.0, 0.25)], [1.0], T)
    assert value == pytest.approx(3.0 - 2.0 * np.exp(-T / 0.25), abs=1e-8)


@pytest.mark.parametrize("w", [1.0, 20.0])
def test_low_pass_is_the_second_order_butterworth(w):
    value, _ = integrated(lambda t, y: butterworth(y[0], y[1], 2.0, w), [0.0, 0.0], T)
    b, a = signal.butter(2, w, analog=True)
    assert value == pytest.approx(response(b, a, np.full(len(T), 2.0), T), abs=1e-7)


def test_high_gain_observer_is_its_transfer_function_and_gives_the_rate():
    """(5.22)-(5.24): 1/(eps^2 s^2 + l eps s + 1); after the transient rate/eps follows the derivative to O(eps)."""
    eps, damping = 0.03, 2.0
    fine = np.linspace(0.0, 2.0, 20001)
    value, rate = integrated(lambda t, y: high_gain_observer(y[0], y[1], math.sin(t), eps, damping), [0.0, 0.0], T)
    expected = response([1.0], [eps * eps, damping * eps, 1.0], np.sin(fine), fine)
    assert value == pytest.approx(np.interp(T, fine, expected), abs=1e-6)
    assert rate[T > 0.5] / eps == pytest.approx(np.cos(T[T > 0.5]), abs=2.5 * eps)


def test_differentiator_follows_a_sine_exactly_after_a_finite_time():
    """abs(x'') = 4 < mu2 = 10; in steps of h the error is of the order of h."""
    p, e, h = 0.5, 0.0, 1e-4
    worst = 0.0
    for k in range(30000):
        t = k * h
        if t > 2.0:
            worst = max(worst, abs(e - 4.0 * math.cos(2.0 * t) / 2.0))
        p_rate, e_rate = sliding_mode_differentiator(p, e, math.sin(2.0 * t), 6.0, 10.0)
        p, e = p + h * p_rate, e + h * e_rate
    assert worst < 30.0 * h


def test_differentiator_stands_still_on_a_constant():
    assert sliding_mode_differentiator(1.5, 0.0, 1.5, 6.0, 10.0) == (0.0, 0.0)


def differentiated(h: float, step: bool) -> np.ndarray:
    """Derivative of sin(2 t) by the differentiator for abs(x'') < 10, from 2 s on; implicit steps or Euler's."""
    value, derivative, found = 0.0, 0.0, []
    for k in range(1, round(4.0 / h)):
        target = math.sin(2.0 * k * h)
        if step:
            value, derivative = sliding_mode_differentiator_step(value, derivative, target, 6.0, 10.0, h)
        else:
            value_rate, derivative_rate = sliding_mode_differentiator(value, derivative, target, 6.0, 10.0)
            value, derivative = value + h * value_rate, derivative + h * derivative_rate
        found.append(derivative)
    return np.array(found)[round(2.0 / h) :]


def test_implicit_differentiator_follows_within_half_a_step_and_does_not_chatter():
    for h in (0.001, 0.01, 0.02):
        t = np.arange(round(2.0 / h) + 1, round(4.0 / h)) * h
        exact, implicit, explicit = 2.0 * np.cos(2.0 * t), differentiated(h, True), differentiated(h, False)
        # Once the value slides, the derivative is the difference quotient over the last step.
        assert np.abs(implicit - 2.0 * np.cos(2.0 * (t - 0.5 * h))).max() < h * h
        assert np.abs(np.diff(implicit)).max() < 1.01 * np.abs(np.diff(exact)).max()
        assert np.abs(np.diff(explicit)).max() > 2.0 * np.abs(np.diff(implicit)).max()


def test_implicit_differentiator_tends_to_the_continuous_one():
    value, derivative, h = 1.0, 0.0, 1e-4
    reference = integrated(
        lambda t, y: sliding_mode_differentiator(y[0], y[1], 0.0, 6.0, 10.0), [1.0, 0.0], np.linspace(0.0, 0.1, 3)
    )
    for _ in range(1000):
        value, derivative = sliding_mode_differentiator_step(value, derivative, 0.0, 6.0, 10.0, h)
    assert (value, derivative) == pytest.approx(reference[:, -1], abs=20.0 * h)


def test_low_pass_in_steps_is_the_exact_one():
    one = low_pass_step(1.0, 3.0, 0.15, 0.1)
    halves = low_pass_step(low_pass_step(1.0, 3.0, 0.15, 0.05), 3.0, 0.15, 0.05)
    assert one == pytest.approx(3.0 - 2.0 * math.exp(-0.1 / 0.15)) == pytest.approx(halves)
    assert low_pass_step(1.0, 3.0, 0.0, 0.1) == 3.0


def test_complementary_filter_follows_a_climb_at_once_and_forgets_an_offset():
    (z,) = integrated(lambda t, y: [complementary_rate(y[0], 1.5, 10.0 + 1.5 * t, 2.0)], [13.0], T)
    assert z - (10.0 + 1.5 * T) == pytest.approx(3.0 * np.exp(-2.0 * T), abs=1e-8)


def test_complementary_filter_shows_a_rate_error_divided_by_its_gain():
    t = np.linspace(0.0, 12.0, 13)
    (z,) = integrated(lambda t, y: [complementary_rate(y[0], 0.3, 0.0, 2.0)], [0.0], t)
    assert z[-1] == pytest.approx(0.15, abs=1e-8)


def test_tracker_has_a_double_pole_while_its_acceleration_is_free():
    z, _ = integrated(lambda t, y: limited_tracker(y[0], y[1], 0.1, 0.0, 2.0, 1.5), [0.0, 0.0], T)
    assert z == pytest.approx(0.1 * (1.0 - np.exp(-2.0 * T) * (1.0 + 2.0 * T)), abs=1e-8)


def test_tracker_limits_its_acceleration_and_has_no_lag_on_a_ramp():
    assert limited_tracker(0.0, 0.0, 100.0, 0.0, 2.0, 1.5) == (0.0, 1.5)
    assert limited_tracker(0.0, 3.0, -100.0, 0.0, 2.0, 1.5) == (3.0, -1.5)
    assert limited_tracker(7.0, 2.0, 7.0, 2.0, 2.0, 1.5) == (2.0, 0.0)


def test_reference_filter_converges_to_its_differential_equation():
    w, damping = 2.0, 1.5
    t = np.linspace(0.0, 4.0, 5)
    exact, _ = integrated(
        lambda t, y: [y[1], w * w * (math.sin(t) - y[0]) + 2.0 * damping * w * (math.cos(t) - y[1])], [1.0, 0.0], t
    )
    errors = []
    for h in (0.01, 0.005):
        value, rate = 1.0, 0.0
        for k in range(round(4.0 / h)):
            now = (k + 1) * h
            value, rate = second_order_reference_step(value, rate, math.sin(now), math.cos(now), w, damping, h)
        errors.append(abs(value - exact[-1]))
    assert errors[0] < 0.02
    assert errors[1] == pytest.approx(0.5 * errors[0], rel=0.1)


def test_reference_filter_has_no_lag_on_a_ramp_and_is_stable_in_any_step():
    value, rate, h = 0.3, 1.0, 0.005
    for k in range(6000):
        value, rate = second_order_reference_step(value, rate, 1.5 * k * h, 1.5, 2.0, 1.5, h)
    assert (value, rate) == pytest.approx((1.5 * 5999 * h, 1.5), rel=1e-6)
    value, rate = 5.0, 0.0
    for _ in range(400):
        value, rate = second_order_reference_step(value, rate, 0.0, 0.0, 2.0, 1.5, 10.0)
    assert abs(value) < 1e-3


def test_shaper_has_a_triple_pole_while_its_limits_are_free():
    w = 2.0
    z, _, a = integrated(lambda t, y: reference_shaper(y[0], y[1], y[2], 0.3, 0.0, w, 2.5, 1.0), [0.0] * 3, T)
    s = w * T
    assert z == pytest.approx(0.3 * (1.0 - np.exp(-s) * (1.0 + s + 0.5 * s * s)), abs=1e-8)
    assert a == pytest.approx(0.3 * w * w * s * np.exp(-s) * (1.0 - 0.5 * s), abs=1e-7)


def test_shaper_keeps_its_limits_and_arrives_from_afar():
    t = np.linspace(0.0, 60.0, 601)
    z, v, a = integrated(lambda t, y: reference_shaper(y[0], y[1], y[2], 100.0, 0.0, 2.0, 2.5, 1.0), [0.0] * 3, t)
    assert np.abs(v).max() <= 1.005 * 2.5
    assert np.abs(a).max() <= 1.0 + 1e-9
    assert z[-1] == pytest.approx(100.0, abs=1e-3)


def test_critically_damped_filter_has_a_double_pole_and_no_sampling_error():
    """1/(s/w + 1)^2 on a held input; ten steps of 5 ms are one of 50 ms."""
    value, rate = 0.0, 0.0
    values = [value]
    for _ in range(400):
        value, rate = critically_damped_step(value, rate, 2.0, 10.0, 0.005)
        values.append(value)
    t = np.arange(401) * 0.005
    assert values == pytest.approx(response([1.0], [0.01, 0.2, 1.0], np.full(401, 2.0), t), abs=1e-9)
    once = critically_damped_step(0.3, -2.0, 1.0, 10.0, 0.05)
    steps = (0.3, -2.0)
    for _ in range(10):
        steps = critically_damped_step(*steps, 1.0, 10.0, 0.005)
    assert steps == pytest.approx(once, rel=1e-12)


@pytest.mark.parametrize("start", [0.0, 5.0])
@pytest.mark.parametrize("w", [0.0, 3.0])
def test_robust_exact_differentiator_finds_the_derivative_from_near_and_far(start, w):
    """(7.24) with the published gains, in sub-steps of 0.5 ms, on a ramp and on a sine with abs(x'') <= w^2.

    The smoothed sign balances x'' at an error er of its own, and the derivative is off by the damping sqrt(er).
    """
    h, phi = 5e-4, 0.01
    value, derivative = start, 0.0
    off = []
    for n in range(1, 4001):
        t = n * h
        x, rate = (math.sin(w * t), w * math.cos(w * t)) if w > 0.0 else (2.0 * t, 2.0)
        value, derivative = robust_exact_differentiator_step(value, derivative, x, 63.25, 1.0, 2000.0, phi, h)
        off.append(derivative - rate)
    balanced = w * w / (2000.0 * (0.5 / phi + 2.0))
    late = np.array(off[1000:])
    assert abs(0.5 * (late[1:] + late[:-1])).max() < 63.25 * math.sqrt(balanced) + 1e-3
    assert abs(late).max() < 0.5 * 2000.0 * h, "what Euler's method lets it alternate"
    assert np.argmax(np.abs(off) < 0.6) * h < 0.3, "soon, even from an error of 5"
