"""Designs: a row is the same in any batch, alone, and on any worker."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from ftcc.groundside.errors import UserError
from ftcc.groundside.statistics import DESIGNS, Design
from ftcc.groundside.statistics.designs import SMALLEST

pytestmark = pytest.mark.filterwarnings("error")


@pytest.mark.parametrize("kind", DESIGNS)
def test_a_row_is_the_same_in_any_batch(kind: str) -> None:
    design = Design(kind, 5, 7, 300)
    all_ = design.points(0, 300)
    assert all_.shape == (300, 5)
    again = pickle.loads(pickle.dumps(design))
    for first, last in ((0, 1), (0, 7), (100, 228), (299, 300), (60, 60)):
        assert np.array_equal(again.points(first, last), all_[first:last])


@pytest.mark.parametrize("kind", ["sobol", "random"])
def test_a_row_is_the_same_alone_and_among_a_million(kind: str) -> None:
    million = Design(kind, 2, 3, 1_000_000).points(0, 1_000_000)
    few = Design(kind, 2, 3, 10)
    assert np.array_equal(few.points(999_999, 1_000_000), million[-1:])
    assert np.array_equal(few.points(0, 10), million[:10])


def test_a_latin_hypercube_has_a_point_in_every_slice_and_another_for_another_number() -> None:
    for samples in (10, 64):
        points = Design("lhs", 3, 1, samples).points(0, samples)
        assert np.array_equal(
            np.sort(np.floor(points * samples), axis=0), np.arange(samples)[:, None].repeat(3, axis=1)
        )
    assert not np.array_equal(Design("lhs", 3, 1, 64).points(0, 10), Design("lhs", 3, 1, 10).points(0, 10))


def test_the_first_points_of_a_sobol_sequence_are_balanced() -> None:
    """Each of 2^k equal slices of each axis holds one of the first 2^k points, however they are scrambled."""
    points = Design("sobol", 8, 11, 256).points(0, 256)
    for k in (1, 4, 8):
        assert np.array_equal(np.sort(np.floor(points[: 2**k] * 2**k), axis=0)[:, 0], np.arange(2**k))


def test_random_points_are_uniform_and_independent() -> None:
    points = Design("random", 6, 1, 0).points(0, 20_000)
    assert points.mean(axis=0) == pytest.approx(0.5, abs=4.0 * np.sqrt(1 / 12 / 20_000))
    correlation = np.corrcoef(np.hstack([points[:-1], points[1:]]), rowvar=False)
    assert np.abs(correlation - np.eye(12)).max() < 4.5 / np.sqrt(20_000)


@pytest.mark.parametrize("kind", DESIGNS)
def test_seeds_differ(kind: str) -> None:
    assert not np.isin(Design(kind, 3, 1, 8).points(0, 8), Design(kind, 3, 2, 8).points(0, 8)).any()


@pytest.mark.parametrize("kind", DESIGNS)
def test_points_are_inside(kind: str) -> None:
    points = Design(kind, 3, 5, 50_000).points(0, 50_000)
    assert SMALLEST <= points.min() < 1e-3
    assert 1.0 - 1e-3 < points.max() <= 1.0 - SMALLEST


@pytest.mark.parametrize("kind", DESIGNS)
def test_no_quantities_have_points_without_coordinates(kind: str) -> None:
    assert Design(kind, 0, 1, 9).points(2, 9).shape == (7, 0)


def test_what_is_given_may_be_changed() -> None:
    design = Design("lhs", 2, 1, 4)
    design.points(0, 4)[:] = 0.5
    assert len(np.unique(design.points(0, 4))) == 8


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: Design("halton", 1, 1, 1), "'halton': must be sobol, lhs or random"),
        (lambda: Design("sobol", -1, 1, 1), "dimensions = -1"),
        (lambda: Design("sobol", 1, 0.5, 1), "seed = 0.5"),  # type: ignore[arg-type]
        (lambda: Design("lhs", 1, 1, True), "samples = True"),
        (lambda: Design("sobol", 30_000, 1, 1), "at most 21201"),
        (lambda: Design("lhs", 2, 1, 10).points(0, 11), "it has 10"),
        (lambda: Design("random", 2, 1, 10).points(3, 2), "rows 3 to 2"),
        (lambda: Design("sobol", 2, 1, 10).points(0, 2**30 + 1), "it has 1073741824"),
    ],
)
def test_what_cannot_be_is_refused(call, says: str) -> None:
    with pytest.raises(UserError, match=says):
        call()
