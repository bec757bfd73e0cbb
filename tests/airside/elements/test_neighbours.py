"""What is made of the neighbours' records, against the sums written out."""

from __future__ import annotations

import numpy as np
import pytest

from ftcc.airside.elements.neighbours import disagreement, extrapolated, motion_sums, weighted_average
from ftcc.airside.scheme import Heard

VALUES = np.array([[10.0, 1.0, 200.0, -2.0], [20.0, -0.5, 210.0, 0.0], [40.0, 2.0, 190.0, 4.0]])
AGE = np.array([0.05, 0.1, 3.0])
WEIGHT = np.array([0.4, 0.5, 0.9])


def heard(valid: tuple[float, ...] = (1.0, 1.0, 1.0)) -> Heard:
    return Heard(VALUES, AGE, np.array(valid), WEIGHT)


def test_a_value_is_carried_by_its_rate_up_to_the_horizon():
    assert extrapolated(10.0, 2.0, 0.3, 5.0) == 10.6
    assert extrapolated(10.0, 2.0, 9.0, 5.0) == 20.0
    assert extrapolated(10.0, 2.0, 0.3, 0.0) == 10.0


@pytest.mark.parametrize("ahead", [0.0, 0.005])
def test_disagreement_is_the_row_of_the_laplacian_times_the_present_values(ahead):
    total, weights, rates = disagreement(15.0, heard(), ahead, 0.5, 0.0, 0.0)
    present = VALUES[:, 0] + VALUES[:, 1] * np.minimum(AGE + ahead, 0.5)
    assert total == pytest.approx(float(WEIGHT @ (15.0 - present)))
    assert (weights, rates) == pytest.approx((1.8, float(WEIGHT @ VALUES[:, 1])))


def test_a_neighbour_never_heard_counts_as_at_rest_or_not_at_all():
    silent = heard((1.0, 0.0, 0.0))
    first = 0.4 * (15.0 - 10.05)
    assert disagreement(15.0, silent, 0.0, 5.0, 14.0, 0.0) == pytest.approx((first + 1.4 * 1.0, 1.8, 0.4))
    assert disagreement(15.0, silent, 0.0, 5.0, 14.0, 1.0) == pytest.approx((first, 0.4, 0.4))


def test_nearest_neighbours_are_averaged_and_stale_ones_left_out():
    """(4.10), (4.11); the third record is 3 s old."""
    value, rate, weights = weighted_average(heard(), 2, 2.0, 2.0)
    assert weights == pytest.approx(0.9)
    assert value == pytest.approx((0.4 * (200.0 - 2.0 * 0.05) + 0.5 * 210.0) / 0.9)
    assert rate == pytest.approx(0.4 * -2.0 / 0.9)


def test_averaged_neighbours_may_be_held_instead_of_carried_on():
    value, rate, _ = weighted_average(heard(), 2, 2.0, 0.0)
    assert value == pytest.approx((0.4 * 200.0 + 0.5 * 210.0) / 0.9)
    assert rate == pytest.approx(0.4 * -2.0 / 0.9)


def test_nobody_left_is_no_average():
    assert weighted_average(heard((0.0, 0.0, 1.0)), 0, 2.0, 2.0) == (0.0, 0.0, 0.0)


def test_motion_sums_give_the_disagreement_at_any_later_time():
    """(6.22) with neighbours that move on: e = D x - (N + t N_v), ev = D v - N_v; no horizon."""
    weights, positions, rates = motion_sums(heard(), 0)
    for later in (0.0, 0.004):
        present = VALUES[:, 0] + VALUES[:, 1] * (AGE + later)
        assert weights * 12.0 - (positions + later * rates) == pytest.approx(float(WEIGHT @ (12.0 - present)))
    assert weights * 3.0 - rates == pytest.approx(float(WEIGHT @ (3.0 - VALUES[:, 1])))


def test_motion_sums_leave_out_who_was_never_heard():
    assert motion_sums(heard((0.0, 0.0, 0.0)), 2) == (0.0, 0.0, 0.0)
    assert motion_sums(heard((0.0, 1.0, 0.0)), 2) == pytest.approx((0.5, 105.0, 0.0))
