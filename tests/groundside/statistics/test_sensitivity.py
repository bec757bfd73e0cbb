"""Sobol' indices of a function whose indices are known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import sobol_indices

from ftcc.groundside.errors import UserError
from ftcc.groundside.statistics import Design, distribution_of, saltelli, sobol_indices_of

pytestmark = pytest.mark.filterwarnings("error")

A, B = 7.0, 0.1
VARIANCE = A**2 / 8 + B * math.pi**4 / 5 + B**2 * math.pi**8 / 18 + 0.5
FIRST = np.array([0.5 * (1 + B * math.pi**4 / 5) ** 2, A**2 / 8, 0.0]) / VARIANCE
SHARED = B**2 * math.pi**8 * (1 / 18 - 1 / 50) / VARIANCE
TOTAL = FIRST + np.array([SHARED, 0.0, SHARED])
"""Ishigami & Homma 1990; Saltelli et al., Global sensitivity analysis (2008), section 4.5."""


def ishigami(x: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.sin(x[..., 0]) + A * np.sin(x[..., 1]) ** 2 + B * x[..., 2] ** 4 * np.sin(x[..., 0]))


def flown(rows: int, kind: str = "sobol", seed: int = 1) -> NDArray[np.float64]:
    points = saltelli(Design(kind, 6, seed, rows), 0, rows)
    angle = distribution_of({"distribution": "uniform", "low": -math.pi, "high": math.pi}, "test")
    return ishigami(np.reshape(angle.values(points), points.shape))


def test_the_indices_of_ishigami() -> None:
    indices, rows = sobol_indices_of(flown(4096))
    assert rows == 4096
    assert [index.first for index in indices] == pytest.approx(FIRST, abs=0.015)
    assert [index.total for index in indices] == pytest.approx(TOTAL, abs=0.015)
    for index, first, total in zip(indices, FIRST, TOTAL, strict=True):
        assert index.first_low < first < index.first_high < index.first_low + 0.1
        assert index.total_low < total < index.total_high < index.total_low + 0.12


def test_the_estimates_are_those_of_scipy() -> None:
    values = flown(256)
    indices, _ = sobol_indices_of(values)
    func = {"f_A": values[:, 0][None], "f_B": values[:, 1][None], "f_AB": values[:, 2:].T[:, None]}
    known = sobol_indices(func=func, n=256)
    assert [index.first for index in indices] == pytest.approx(known.first_order, rel=1e-9)
    assert [index.total for index in indices] == pytest.approx(known.total_order, rel=1e-9)


def test_the_intervals_cover_where_flights_are_independent() -> None:
    studies, covers = 200, np.zeros((2, 3))
    for seed in range(studies):
        indices, _ = sobol_indices_of(flown(128, "random", seed), seed=seed)
        covers[0] += [index.first_low <= true <= index.first_high for index, true in zip(indices, FIRST, strict=True)]
        covers[1] += [index.total_low <= true <= index.total_high for index, true in zip(indices, TOTAL, strict=True)]
    assert (covers / studies > 0.95 - 4.0 * math.sqrt(0.95 * 0.05 / studies)).all()


def test_base_rows_hold_a_and_b_and_a_with_one_of_b() -> None:
    design = Design("sobol", 4, 3, 8)
    a, b = np.split(design.points(2, 5), 2, axis=1)
    points = saltelli(design, 2, 5)
    assert points.shape == (3, 4, 2)
    assert np.array_equal(points[:, 0], a)
    assert np.array_equal(points[:, 1], b)
    assert np.array_equal(points[:, 2], np.column_stack([b[:, 0], a[:, 1]]))
    assert np.array_equal(points[:, 3], np.column_stack([a[:, 0], b[:, 1]]))
    assert np.array_equal(saltelli(design, 0, 8)[2:5], points)


def test_a_row_with_a_value_missing_is_dropped_whole() -> None:
    values = flown(100)
    holed = np.vstack([values[:50], [math.nan, 1.0, 1.0, 1.0, 1.0], [1.0, 1.0, math.inf, 1.0, 1.0], values[50:]])
    assert sobol_indices_of(holed) == (sobol_indices_of(values)[0], 100)


@pytest.mark.parametrize("constant", [0.0, 1e300, -0.1])
def test_a_constant_value_has_no_indices(constant: float) -> None:
    indices, rows = sobol_indices_of(np.full((16, 4), constant))
    assert (len(indices), rows) == (2, 16)
    assert all(math.isnan(number) for index in indices for number in vars(index).values())


def test_a_value_that_differs_in_one_row_only_has_indices() -> None:
    values = np.zeros((20, 3))
    values[7] = [1.0, 0.0, 0.0]
    (index,), _ = sobol_indices_of(values)
    assert (index.first, index.total) == pytest.approx((2 / 39, 40 / 39))  # variance 39 / 1600
    assert index.total_low == pytest.approx(index.total)
    assert index.total_low < index.total_high < 1.2


def test_a_quantity_without_influence_has_a_total_index_of_zero() -> None:
    values = flown(64)[:, [0, 1, 2, 0]]
    idle = sobol_indices_of(values)[0][1]
    assert (idle.total, idle.total_low, idle.total_high) == (0.0, 0.0, 0.0)


def test_origin_scale_and_seed() -> None:
    values = flown(64)
    assert [index.first for index in sobol_indices_of(1e200 * values)[0]] == pytest.approx(
        [index.first for index in sobol_indices_of(values + 100.0)[0]], rel=1e-9
    )
    assert sobol_indices_of(values, seed=1) == sobol_indices_of(values, seed=1)
    assert sobol_indices_of(values, seed=1) != sobol_indices_of(values, seed=2)


def test_no_quantities_and_no_rows() -> None:
    assert sobol_indices_of(np.zeros((3, 2))) == ([], 3)
    (index,), rows = sobol_indices_of(np.full((3, 3), math.nan))
    assert rows == 0
    assert math.isnan(index.first)
    assert saltelli(Design("sobol", 0, 1, 4), 0, 4).shape == (4, 2, 0)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: saltelli(Design("sobol", 3, 1, 4), 0, 4), "3 dimensions"),
        (lambda: sobol_indices_of(np.zeros(4)), r"shape \(4,\)"),
        (lambda: sobol_indices_of(np.zeros((4, 1))), r"shape \(4, 1\)"),
        (lambda: sobol_indices_of(np.zeros((4, 3)), 2.0), "confidence 2.0"),
    ],
)
def test_what_cannot_be_is_refused(call, says: str) -> None:
    with pytest.raises(UserError, match=says):
        call()
