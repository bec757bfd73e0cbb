"""The performance tube and its transform against derivatives and inverses."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ftcc.airside.elements.performance import EDGE, bounded_transform, performance_transform, performance_tube


def test_tube_of_chapter_3():
    """epsilon = 1.55 exp(-0.3 t) + 0.45 m."""
    for t in (0.0, 1.0, 30.0):
        assert performance_tube(t, 2.0, 0.45, 0.3) == pytest.approx(
            (1.55 * math.exp(-0.3 * t) + 0.45, -0.465 * math.exp(-0.3 * t))
        )


@pytest.mark.parametrize("share", np.linspace(-0.97, 0.97, 9))
def test_symmetric_tube_is_the_inverse_hyperbolic_tangent_and_its_inverse_gives_the_error(share):
    width = 0.45
    used, transformed, slope, _ = performance_transform(share * width, 0.0, width, 0.0, 1.0, 1.0)
    assert used == pytest.approx(share)
    assert transformed == pytest.approx(math.atanh(share))
    assert math.tanh(transformed) * width == pytest.approx(share * width, rel=1e-12)
    assert slope > 0.0


@pytest.mark.parametrize(("lower", "upper"), [(1.0, 1.0), (0.6, 0.9)])
def test_slope_and_its_rate_are_derivatives(lower, upper):
    def motion(t: float) -> tuple[float, float, float, float]:
        width, width_rate = performance_tube(t, 2.0, 0.45, 0.3)
        return 0.3 * math.sin(t), 0.3 * math.cos(t), width, width_rate

    for t in (0.3, 2.0, 4.0):
        error, rate, width, width_rate = motion(t)
        _, transformed, slope, slope_rate = performance_transform(error, rate, width, width_rate, lower, upper)
        d = 1e-6
        beside = performance_transform(error + d, rate, width, width_rate, lower, upper)[1]
        assert slope == pytest.approx((beside - transformed) / d, rel=1e-5)
        later = performance_transform(*motion(t + d), lower, upper)[2]
        assert slope_rate == pytest.approx((later - slope) / d, rel=1e-4)


def test_asymmetric_tube_has_its_zero_at_zero():
    assert performance_transform(0.0, 0.0, 0.45, 0.0, 0.6, 0.9)[1] == 0.0


@pytest.mark.parametrize(("lower", "upper"), [(1.0, 1.0), (0.6, 0.9)])
def test_outside_of_the_tube_everything_stays_finite_and_pushes_back(lower, upper):
    for error in (-100.0, 100.0):
        found = performance_transform(error, 0.0, 0.45, 0.0, lower, upper)
        assert all(math.isfinite(value) for value in found)
        assert found[0] == math.copysign(EDGE * (upper if error > 0.0 else lower), error)
        assert found[1] * error > 0.0


@pytest.mark.parametrize("share", [-0.8, 0.0, 0.5])
def test_bounded_transform_is_the_other_one_within_its_guard(share):
    width = 0.3
    _, transformed, slope, _ = performance_transform(share * width, 0.0, width, 0.0, 1.1, 0.9)
    assert bounded_transform(share * width, width, 1.1, 0.9, 0.95, 1.0) == pytest.approx((transformed, slope))


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_beyond_its_guard_the_transform_goes_on_straight_or_stays(side):
    width, edge = 0.3, 0.9
    at = side * edge * 1.1 * width
    transformed, slope = bounded_transform(at, width, 1.1, 1.1, edge, 1.0)
    for beyond in (0.02, 0.5):
        straight = bounded_transform(at + side * beyond, width, 1.1, 1.1, edge, 1.0)
        assert straight == pytest.approx((transformed + side * beyond * slope, slope))
        assert bounded_transform(at + side * beyond, width, 1.1, 1.1, edge, 0.0) == pytest.approx((transformed, slope))
