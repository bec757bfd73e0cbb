"""Compensation of the actuators' lag against the lag itself."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from ftcc.airside.elements.actuators import lead_filter, leading_command, modelled_position, modelled_stroke
from tests.airside.elements.motion import integrated

T = np.linspace(0.0, 0.5, 26)


def test_modelled_position_is_the_exact_lag_whatever_the_steps():
    one = modelled_position(-0.2, 0.5, 20.0, 0.1)
    many = -0.2
    for _ in range(10):
        many = modelled_position(many, 0.5, 20.0, 0.01)
    assert one == pytest.approx(0.5 - 0.7 * np.exp(-2.0)) == pytest.approx(many)


def test_modelled_stroke_is_the_mean_of_the_exact_lag():
    t = np.linspace(0.0, 0.1, 1001)
    position = 0.5 - 0.7 * np.exp(-t / 0.05)
    mean, after = modelled_stroke(-0.2, 0.5, 0.05, 0.1)
    assert mean == pytest.approx(np.trapezoid(position, t) / 0.1, abs=1e-6)
    assert after == pytest.approx(position[-1])
    assert modelled_stroke(-0.2, 0.5, 0.0, 0.1) == (0.5, 0.5)


def test_a_lagging_actuator_under_the_leading_command_is_a_fast_one():
    """20/(s + 20) behaves as 100/(s + 100)."""
    (position,) = integrated(lambda t, y: [20.0 * (leading_command(y[0], 0.3, 20.0, 100.0) - y[0])], [-0.2], T)
    assert position == pytest.approx(0.3 - 0.5 * np.exp(-100.0 * T), abs=1e-7)


def test_lead_filter_is_its_transfer_function():
    """(0.03 s + 1)/(0.015 s + 1) on a step from rest."""
    (value,) = integrated(lambda t, y: [lead_filter(y[0], 1.0, 0.03, 0.015)[1]], [0.0], T)
    output = [lead_filter(v, 1.0, 0.03, 0.015)[0] for v in value]
    _, expected = signal.step(([0.03, 1.0], [0.015, 1.0]), T=T)
    assert output == pytest.approx(expected, abs=1e-7)


def test_lead_cancels_the_lag_of_the_servo_to_its_own():
    """A first-order lag of 0.03 s behind the lead is one of 0.015 s."""

    def rates(t: float, y: np.ndarray) -> list[float]:
        led, rate = lead_filter(y[0], 1.0, 0.03, 0.015)
        return [rate, (led - y[1]) / 0.03]

    _, behind = integrated(rates, [0.0, 0.0], T)
    assert behind == pytest.approx(1.0 - np.exp(-T / 0.015), abs=1e-7)
