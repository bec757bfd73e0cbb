"""Vector algebra against numpy."""

from __future__ import annotations

import numpy as np
import pytest

from ftcc.airside.elements.vectors import (
    added,
    applied,
    applied_transposed,
    dot,
    limited_to,
    over,
    scaled,
    subtracted,
    times,
)

A, B = (1.5, -2.0, 0.25), (-0.5, 4.0, 3.0)
M = ((1.0, 2.0, -3.0), (0.5, -1.0, 4.0), (2.0, 0.0, 1.5))


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (added(A, B), np.add(A, B)),
        (subtracted(A, B), np.subtract(A, B)),
        (scaled(2.0, A), np.multiply(2.0, A)),
        (times(A, B), np.multiply(A, B)),
        (over(A, B), np.divide(A, B)),
        (dot(A, B), np.dot(A, B)),
        (applied(M, A), np.array(M) @ A),
        (applied_transposed(M, A), np.array(M).T @ A),
        (limited_to(A, (-1.0, -1.0, -1.0), (1.0, 3.0, 1.0)), np.clip(A, -1.0, [1.0, 3.0, 1.0])),
    ],
)
def test_each_function_is_what_numpy_makes_of_it(found, expected):
    assert found == pytest.approx(expected, rel=1e-15)
