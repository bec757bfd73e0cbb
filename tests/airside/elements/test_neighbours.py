"""What is made of the neighbours' records, against the sums written out."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ftcc.airside.elements.filters import critically_damped_step
from ftcc.airside.elements.neighbours import (
    disagreement,
    error_sums,
    extrapolated,
    filtered_error_sums,
    motion_sums,
    weighted_average,
)
from ftcc.airside.scheme import Heard

VALUES = np.array([[10.0, 1.0, 200.0, -2.0], [20.0, -0.5, 210.0, 0.0], [40.0, 2.0, 190.0, 4.0]])
AGE = np.array([0.05, 0.1, 3.0])
WEIGHT = np.array([0.4, 0.5, 0.9])


def heard(valid: tuple[float, ...] = (1.0, 1.0, 1.0)) -> Heard:
    return Heard(VALUES, AGE, np.array(valid), WEIGHT, np.ones(VALUES.shape))


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
    weights, positions, rates = motion_sums(heard(), 0, 1.0)
    for later in (0.0, 0.004):
        present = VALUES[:, 0] + VALUES[:, 1] * (AGE + later)
        assert weights * 12.0 - (positions + later * rates) == pytest.approx(float(WEIGHT @ (12.0 - present)))
    assert weights * 3.0 - rates == pytest.approx(float(WEIGHT @ (3.0 - VALUES[:, 1])))


def test_motion_sums_leave_out_who_was_never_heard():
    assert motion_sums(heard((0.0, 0.0, 0.0)), 2, 1.0) == (0.0, 0.0, 0.0)
    assert motion_sums(heard((0.0, 1.0, 0.0)), 2, 1.0) == pytest.approx((0.5, 105.0, 0.0))


def test_motion_sums_of_held_neighbours_know_no_age():
    """Reference table 8b: positions held."""
    weights, positions, rates = motion_sums(heard(), 0, 0.0)
    assert positions == pytest.approx(float(WEIGHT @ VALUES[:, 0]))
    assert (weights, rates) == (motion_sums(heard(), 0, 1.0)[0], motion_sums(heard(), 0, 1.0)[2])


ERRORS = np.array([[0.1, 0.2, 0.3, 1.0, 2.0, 3.0], [-0.1, 0.0, 0.1, 0.0, 1.0, -1.0], [0.4, 0.4, 0.4, 5.0, 5.0, 5.0]])
OWN = (0.05, -0.02, 0.01)


def told(valid: tuple[float, ...] = (1.0, 1.0, 1.0), errors: np.ndarray = ERRORS) -> Heard:
    return Heard(errors, AGE, np.array(valid), WEIGHT, np.ones(errors.shape))


@pytest.mark.parametrize(("oldest", "part"), [(0.0, [0, 1, 2]), (0.5, [0, 1]), (0.06, [0])])
def test_synchronization_error_sums_of_those_who_are_not_silent(oldest, part):
    """(7.12), (8.10)."""
    weights, total, rates = error_sums(OWN, told(), oldest)
    assert weights == pytest.approx(WEIGHT[part].sum())
    assert total == pytest.approx(WEIGHT[part] @ (np.array(OWN) - ERRORS[part, :3]))
    assert rates == pytest.approx(WEIGHT[part] @ ERRORS[part, 3:])


def test_filtered_neighbours_start_at_their_first_error_and_follow_it():
    memory = np.zeros((16, 7))
    weights, total, rates = filtered_error_sums(OWN, told((0.0, 1.0, 0.0)), memory, 10.0, 0.0, 0.005)
    assert (weights, rates) == (0.5, (0.0, 0.0, 0.0))
    assert total == pytest.approx(0.5 * (np.array(OWN) - ERRORS[1, :3]))
    moved = ERRORS + 0.2
    _, total, rates = filtered_error_sums(OWN, told((0.0, 1.0, 0.0), moved), memory, 10.0, 0.0, 0.005)
    after = [critically_damped_step(e, 0.0, e + 0.2, 10.0, 0.005) for e in ERRORS[1, :3]]
    assert total == pytest.approx([0.5 * (own - value) for own, (value, _) in zip(OWN, after, strict=True)])
    assert rates == pytest.approx([0.5 * rate for _, rate in after])


def test_the_filter_of_a_dropped_neighbour_stands_still():
    memory = np.zeros((16, 7))
    filtered_error_sums(OWN, told(), memory, 10.0, 0.0, 0.005)
    before = memory.copy()
    weights, _, _ = filtered_error_sums(OWN, told(errors=ERRORS + 1.0), memory, 10.0, 0.5, 0.005)
    assert weights == pytest.approx(0.9)
    assert (memory[2] == before[2]).all()
    assert (memory[:2] != before[:2]).any()


def test_errors_on_both_sides_of_half_a_turn_are_near_each_other():
    """Own bank error 3.1 rad, the neighbour's -3.1: 0.083 rad apart, also where the neighbour's crosses while heard."""
    own, there = (3.1, 0.0, 0.0), np.zeros((3, 6))
    there[0, 0] = -3.1
    only = (1.0, 0.0, 0.0)
    _, total, _ = error_sums(own, told(only, there), 0.0)
    assert total[0] == pytest.approx(WEIGHT[0] * (6.2 - 2.0 * math.pi))
    memory = np.zeros((3, 7))
    here = there.copy()
    here[0, 0] = 3.14
    filtered_error_sums(own, told(only, here), memory, 10.0, 0.0, 0.005)
    _, total, rates = filtered_error_sums(own, told(only, there), memory, 10.0, 0.0, 0.005)
    assert abs(total[0]) < 0.1 * WEIGHT[0]
    assert abs(rates[0]) < 0.1 * 10.0 * WEIGHT[0]
