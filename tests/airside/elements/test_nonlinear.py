"""Static nonlinearities."""

from __future__ import annotations

import math
import random

import pytest

from ftcc.airside.elements.nonlinear import limited, rounded_power, sign, signed_power


def test_sign_of_zero_is_zero():
    assert [sign(-2.0), sign(0.0), sign(3.0)] == [-1.0, 0.0, 1.0]


def test_signed_power_is_odd_and_continuous():
    assert signed_power(0.0, 0.8) == 0.0
    assert signed_power(-1e-12, 0.8) == pytest.approx(-(1e-12**0.8))
    assert signed_power(4.0, 0.5) == -signed_power(-4.0, 0.5) == 2.0


def test_signed_power_has_the_same_bits_compiled_and_in_plain_python():
    draw = random.Random(1)
    for _ in range(2000):
        x, r = draw.uniform(-50.0, 50.0), draw.choice((0.4, 0.8))
        assert signed_power(x, r) == math.pow(abs(x), r) * math.copysign(1.0, x)


def test_rounded_power_is_continuous_and_has_its_slope():
    inside, slope = rounded_power(0.05, 0.6, 0.05)
    outside, _ = rounded_power(0.05 * (1.0 + 1e-12), 0.6, 0.05)
    assert inside == pytest.approx(outside) == pytest.approx(0.05**0.6)
    assert slope == pytest.approx(0.05**-0.4)
    assert rounded_power(-0.02, 0.6, 0.05)[0] == pytest.approx(-0.02 * 0.05**-0.4)
    step = 1e-6
    difference = (rounded_power(0.3 + step, 0.6, 0.05)[0] - rounded_power(0.3 - step, 0.6, 0.05)[0]) / (2.0 * step)
    assert rounded_power(0.3, 0.6, 0.05)[1] == pytest.approx(difference)


def test_a_limit_of_zero_is_none():
    assert limited(7.0, 0.0) == 7.0
    assert [limited(7.0, 2.0), limited(-7.0, 2.0), limited(1.0, 2.0)] == [2.0, -2.0, 1.0]
