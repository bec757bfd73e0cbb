"""Angles within half a turn: the shorter way around, and not a bit of what is one already changed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ftcc.groundside.claims import expressions
from ftcc.link.rotation import nearest_turn, wrapped

DEGREE = math.radians(1.0)


@pytest.mark.parametrize(
    ("own", "reference", "error"),
    [
        (170.0, -170.0, -20.0),
        (-170.0, 170.0, 20.0),
        (97.0, -105.0, -158.0),
        (10.0, -170.0, 180.0),
        (0.0, 540.0, -180.0),
    ],
)
def test_a_difference_of_angles_goes_the_shorter_way_around(own, reference, error):
    assert wrapped((own - reference) * DEGREE) == pytest.approx(error * DEGREE, abs=1e-12)


@pytest.mark.parametrize("angle", [0.0, -0.0, 0.1, -3.0, math.pi, -math.pi, math.nextafter(math.pi, 0.0)])
def test_what_is_within_half_a_turn_keeps_its_bits(angle):
    assert wrapped(angle).hex() == angle.hex()
    assert nearest_turn(angle, 0.5 * angle).hex() == angle.hex()


def test_what_is_not_finite_stays_so():
    assert math.isnan(wrapped(math.nan))
    assert wrapped(math.inf) == math.inf
    assert wrapped(-math.inf) == -math.inf


def test_the_nearest_turn_lets_a_curve_go_on():
    """An aircraft that rolls on at 30 deg a step, told within half a turn: its bank goes on beyond it."""
    rolled, bank = [], 0.0
    for n in range(40):
        bank = nearest_turn(wrapped(30.0 * DEGREE * n), bank)
        rolled.append(bank)
    assert rolled == pytest.approx([30.0 * DEGREE * n for n in range(40)], abs=1e-12)


def test_recordings_are_judged_by_the_same_angles():
    angles = np.array([*np.linspace(-12.0, 12.0, 193), math.pi, -math.pi, math.nan, math.inf, -math.inf])
    assert np.array_equal(expressions.wrapped(angles), [wrapped(float(angle)) for angle in angles], equal_nan=True)


def test_a_curve_without_jumps_passes_over_what_is_not_known():
    told = np.array([3.0, 3.1, math.nan, -3.1, -3.0])
    drawn = expressions.unwrapped(told)
    assert drawn[[0, 1, 3, 4]] == pytest.approx([3.0, 3.1, 2.0 * math.pi - 3.1, 2.0 * math.pi - 3.0])
    assert math.isnan(drawn[2])
    assert expressions.unwrapped(np.array([-170.0, -175.0]), 360.0, np.array([math.nan, 180.0])) == pytest.approx(
        [190, 185]
    )
