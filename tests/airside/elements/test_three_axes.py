"""Elements of three axes: each axis is flown as by the element of one axis, bit for bit."""

from __future__ import annotations

import math

import pytest

from ftcc.airside.elements.filters import (
    butterworth,
    butterworth_step,
    implicit_butterworth_step,
    robust_exact_differentiator_on_ramp,
    robust_exact_differentiator_step,
    second_order_reference_step,
)
from ftcc.airside.elements.networks import network_inputs
from ftcc.airside.elements.nonlinear import clip, smooth_power, smooth_powers, smooth_signs
from ftcc.airside.elements.observers import discrete_disturbance_observer_step, discrete_disturbance_observer_steps

A, B, C, D = (0.3, -0.7, 1.9), (-0.2, 0.05, 0.4), (1.1, -2.0, 0.0), (0.6, 0.8, -0.1)
AXES = range(3)
H = 0.005


def test_powers_and_signs():
    assert smooth_powers(A, 0.6, 0.02) == tuple(smooth_power(a, 0.6, 0.02) for a in A)
    assert smooth_signs(A, 0.5) == tuple(math.tanh(a / 0.5) for a in A)


def test_inputs_of_a_network_are_scaled_and_limited():
    assert network_inputs((0.3, -2.0, 9.0), (0.3, 2.0, 3.0), 1.5) == (1.0, -1.0, 1.5)
    assert network_inputs(A, D, 1.0) == tuple(clip(a / d, -1.0, 1.0) for a, d in zip(A, D, strict=True))


def test_observer_of_disturbances():
    expected = [discrete_disturbance_observer_step(A[n], B[n], C[n], D[n], 40.0, H) for n in AXES]
    assert discrete_disturbance_observer_steps(A, B, C, D, 40.0, H) == tuple(zip(*expected, strict=True))


def test_low_pass_steps():
    implicit = [second_order_reference_step(A[n], B[n], C[n], 0.0, 20.0, math.sqrt(0.5), H) for n in AXES]
    assert implicit_butterworth_step(A, B, C, 20.0, H) == tuple(zip(*implicit, strict=True))
    rates = tuple(B[n] + H * butterworth(A[n], B[n], C[n], 20.0)[1] for n in AXES)
    assert butterworth_step(A, B, C, 20.0, H) == (tuple(A[n] + H * rates[n] for n in AXES), rates)


@pytest.mark.parametrize("step", [butterworth_step, implicit_butterworth_step])
def test_both_low_passes_are_the_butterworth_filter(step):
    """A thousandth of a second against the step response 1 - exp(-a t) (cos(a t) + sin(a t)), a = w / sqrt(2)."""
    value = rate = (0.0, 0.0, 0.0)
    for _ in range(200):
        value, rate = step(value, rate, (1.0, 2.0, -1.0), 20.0, 1e-3)
    angle = 20.0 * math.sqrt(0.5) * 0.2
    reached = 1.0 - math.exp(-angle) * (math.cos(angle) + math.sin(angle))
    assert value == pytest.approx((reached, 2.0 * reached, -reached), abs=0.02)


def test_differentiator_goes_along_the_ramp():
    value, derivative = robust_exact_differentiator_on_ramp(A, B, C, D, 60.0, 1.0, 2000.0, 0.01, H, 2)
    for n in AXES:
        x, rate = A[n], B[n]
        for target in (C[n] + 0.5 * (D[n] - C[n]), C[n] + 1.0 * (D[n] - C[n])):
            x, rate = robust_exact_differentiator_step(x, rate, target, 60.0, 1.0, 2000.0, 0.01, 0.5 * H)
        assert (value[n], derivative[n]) == (x, rate)
