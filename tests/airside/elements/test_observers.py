"""Observers against their error dynamics."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from ftcc.airside.elements.observers import (
    discrete_disturbance_observer_step,
    disturbance_observer_rate,
    finite_time_observer,
    reference_system_step,
    sliding_mode_observer,
    unexplained_acceleration,
)
from tests.airside.elements.motion import integrated

T = np.linspace(0.0, 1.0, 21)


@pytest.mark.parametrize("gain", [5.0, 46.6])
def test_disturbance_estimate_converges_with_its_gain(gain):
    """(4.18), (5.20): d_hat' = gain (d - d_hat), whatever is known and whatever is tracked."""

    def rates(t: float, y: np.ndarray) -> list[float]:
        error, xi = y
        known, reference_rate = math.sin(3.0 * t) - error, 0.4 * math.cos(t)
        return [known + 0.7 - reference_rate, disturbance_observer_rate(gain, error, xi, known, reference_rate)]

    error, xi = integrated(rates, [0.3, -gain * 0.3], T)
    assert xi + gain * error == pytest.approx(0.7 * (1.0 - np.exp(-gain * T)), abs=1e-7)


def test_unexplained_acceleration_converges_with_its_gain():
    def rates(t: float, y: np.ndarray) -> list[float]:
        rate, state = y
        explained = math.cos(5.0 * t)
        _, state_rate = unexplained_acceleration(20.0, rate, state, explained)
        return [explained - 2.0, state_rate]

    rate, state = integrated(rates, [0.1, 0.1], T)
    found = [unexplained_acceleration(20.0, q, s, 0.0)[0] for q, s in zip(rate, state, strict=True)]
    assert found == pytest.approx(-2.0 * (1.0 - np.exp(-20.0 * T)), abs=1e-7)


def test_switched_off_the_unexplained_acceleration_is_zero():
    assert unexplained_acceleration(0.0, 1.0, 0.0, 3.0) == (0.0, 3.0)


@pytest.mark.parametrize("h", [0.001, 0.02])
def test_reference_system_finds_the_disturbance_exactly_after_a_finite_time(h):
    """A jump and a ramp of a disturbance beside a known acceleration; abs(gap'') < 50 m/s^3, but at the jump."""
    rate, states = 3.0, (3.0, 0.0, 0.0, 0.0)
    late = []
    for k in range(round(3.0 / h)):
        t = (k + 0.5) * h
        known, disturbance = math.cos(5.0 * t), (-2.0 if t > 1.0 else 0.0) + 0.5 * t
        rate += h * (known + disturbance)
        estimate, *states = reference_system_step(*states, rate, known, 5.0, 50.0, h)
        if t < 1.0 or t > 1.5:
            late.append(abs(estimate - disturbance))
    assert max(late[round(0.2 / h) :]) < 5.0 * h


def test_observer_of_a_climbing_leader_lags_by_the_root_of_its_law():
    """Reference check of chapter 3: r = 1.576 m/s, s = -0.0339, errors -0.145, -0.239, -0.225 m."""
    a = np.array([[0.0, 0.3, 0.5], [0.3, 0.0, 0.4], [0.5, 0.4, 0.0]])
    b = np.array([0.7, 0.0, 0.0])
    p = np.diag(a.sum(1) + b) - a
    assert np.linalg.eigvalsh(p) == pytest.approx([0.1597, 1.1526, 1.7878], abs=1e-4)
    climb = 1.576
    z = np.zeros(3)
    h = 1e-3
    for k in range(40000):
        s = p @ z - b * (climb * k * h)
        z += h * np.array([sliding_mode_observer(x, 8.0, 4.0, 0.1)[0] for x in s])
    error = z - climb * 40.0
    root = brentq(lambda s: 8.0 * s + 4.0 * math.tanh(s / 0.1) + climb, -1.0, 0.0)
    assert root == pytest.approx(-0.0339, abs=1e-4)
    assert error == pytest.approx(root * np.linalg.solve(p, np.ones(3)), abs=1e-3)
    assert error == pytest.approx([-0.145, -0.239, -0.225], abs=2e-3)


def test_slope_is_the_derivative_of_the_rate():
    for s in (-0.3, -0.02, 0.0, 0.05):
        above, below = (sliding_mode_observer(s + d, 8.0, 3.0, 0.1)[0] for d in (1e-6, -1e-6))
        assert sliding_mode_observer(s, 8.0, 3.0, 0.1)[1] == pytest.approx((above - below) / 2e-6, rel=1e-6)


def test_fractional_term_alone_extinguishes_an_error_in_finite_time():
    """e' = -b |e|^a sign(e): |e|^(1-a) falls linearly to 0 at |e0|^(1-a) / ((1-a) b)."""
    a, b, e0 = 0.4, 0.5, 2.0
    extinct = e0 ** (1.0 - a) / ((1.0 - a) * b)
    t = np.linspace(0.0, 0.95 * extinct, 20)
    expected = (e0 ** (1.0 - a) - (1.0 - a) * b * t) ** (1.0 / (1.0 - a))
    (position,) = integrated(lambda t, y: [finite_time_observer(0.0, y[0], 0.0, b, 0.0, 1.0, 0.0, a, 0.02)[0]], [e0], t)
    assert position == pytest.approx(expected, abs=1e-7)
    (velocity,) = integrated(
        lambda t, y: [finite_time_observer(0.0, 0.0, y[0], 1.0, 0.0, b, 0.0, a, 0.02)[1]], [-e0], t
    )
    assert velocity == pytest.approx(-expected, abs=1e-7)


def test_finite_time_observer_finds_position_and_speed_of_an_accelerating_leader():
    """beta4 = 3 m/s^2 exceeds the leader's 1 m/s^2 (Lemma 6.6); what is left is the boundary layer."""

    x, v, h = 5.0, -2.0, 1e-3
    for k in range(20000):
        t = k * h
        if t > 15.0:
            assert abs(x - 0.25 * math.sin(2.0 * t)) < 2e-3
            assert abs(v - 0.5 * math.cos(2.0 * t)) < 0.01
        x_rate, v_rate = finite_time_observer(
            v, x - 0.25 * math.sin(2.0 * t), v - 0.5 * math.cos(2.0 * t), 0.5, 0.3, 0.2, 3.0, 0.4, 0.02
        )
        x, v = x + h * x_rate, v + h * v_rate


def test_discrete_observer_finds_a_constant_with_its_two_poles():
    """Error of d after each step: that of the linear recursion; its poles are close to exp(-w h)."""
    w, h = 40.0, 0.005
    pole, rate, estimate, found = math.exp(-w * h), 0.7, 0.7, 0.0
    recursion = np.array([[pole**2, h], [-((1.0 - pole) ** 2) / h, 1.0]])
    assert abs(np.linalg.eigvals(recursion)) == pytest.approx(pole, rel=0.03)
    error = np.array([0.0, 2.5])
    for _ in range(200):
        # The observer is told the rate at the tick; the next one has moved on by h (known + d).
        estimate, found = discrete_disturbance_observer_step(estimate, found, rate, 0.3, w, h)
        rate += h * (0.3 + 2.5)
        error = recursion @ error
        assert (rate - estimate, 2.5 - found) == pytest.approx(error, abs=1e-9)
    assert found == pytest.approx(2.5, abs=1e-9)
