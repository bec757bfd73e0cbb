"""What matters: Sobol' indices of random quantities, by Saltelli's sampling."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ftcc.groundside.errors import UserError
from ftcc.groundside.statistics.designs import Design
from ftcc.groundside.statistics.intervals import check_confidence

__all__ = ["Index", "saltelli", "sobol_indices_of"]

Array = NDArray[np.float64]

_RESAMPLES = 999
_ROUNDING = 1e-12
"""Relative difference of values that counts as none."""


@dataclass(frozen=True)
class Index:
    """Sobol' indices of one random quantity with intervals; nan where they are not defined.

    ``first`` is the share of the value's variance that the quantity explains alone, ``total`` that in which it has any
    part. Estimates of small indices may be slightly negative.
    """

    first: float
    first_low: float
    first_high: float
    total: float
    total_low: float
    total_high: float


def saltelli(design: Design, first: int, last: int) -> Array:
    """Return the points of base rows first to last - 1 for `sobol_indices_of` (Saltelli et al. 2010, section 3).

    Parameters
    ----------
    design : Design
        Of 2 d dimensions for d quantities: the first d coordinates of row j are A_j, the others B_j.
    first, last : int

    Returns
    -------
    ndarray, shape (last - first, d + 2, d)
        For each base row A_j, B_j, and A_j with coordinate 1, ..., d from B_j.

    Raises
    ------
    UserError
        The number of dimensions is odd, or the design has no such rows.
    """
    if design.dimensions % 2:
        raise UserError(f"{design.dimensions} dimensions: Saltelli's sampling needs two for each quantity")
    d = design.dimensions // 2
    base = design.points(first, last)
    a, b = base[:, :d], base[:, d:]
    points = np.repeat(a[:, None, :], d + 2, axis=1)
    points[:, 1] = b
    each = np.arange(d)
    points[:, 2 + each, each] = b
    return points


def sobol_indices_of(values: ArrayLike, confidence: float = 0.95, seed: int = 0) -> tuple[list[Index], int]:
    """Return the Sobol' indices of a value (Sobol' 2001), and the number of base rows that were used.

    First order by table 2 (b), total by table 2 (f) of Saltelli et al. (2010, Computer Physics Communications 181,
    259-270), after subtraction of the mean, as in `scipy.stats.sobol_indices`, which needs a power of two of rows and
    draws its bootstrap without a seed. Intervals are percentiles of a bootstrap of the base rows (Archer, Saltelli &
    Sobol' 1997), which takes rows as independent. Of Ishigami's function, 95 % intervals cover with 91 to 96 % for 128
    to 1024 random rows; rows of a Sobol' design are more even, and their intervals wider than needed.

    Parameters
    ----------
    values : array_like, shape (n, d + 2)
        The value at each of the points of `saltelli`. A row with a nan or an infinity is dropped whole.
    confidence : float
    seed : int
        Of the bootstrap.

    Returns
    -------
    list of Index, length d
        nan, if the value is constant (to 1e-12 of its size) or fewer than two rows are left.
    int
        Base rows used.

    Raises
    ------
    UserError
        The shape is wrong, or the confidence not between 0 and 1.
    """
    check_confidence(confidence)
    given = np.asarray(values, dtype=np.float64)
    if given.ndim != 2 or given.shape[1] < 2:
        raise UserError(f"values of shape {given.shape}: must be (base rows, quantities + 2)")
    used = given[np.isfinite(given).all(axis=1)]
    rows, d = len(used), given.shape[1] - 2
    if rows < 2 or _constant(used[:, :2]):
        return [Index(*[math.nan] * 6)] * d, rows
    terms = _terms(used)
    indices = _ratios(terms.mean(axis=0))
    generator = np.random.default_rng(seed)
    resampled = np.array(
        [
            _ratios(np.bincount(generator.integers(rows, size=rows), minlength=rows) @ terms / rows)
            for _ in range(_RESAMPLES)
        ]
    )
    # A resample of rows with one and the same value has no indices.
    known = resampled[np.isfinite(resampled).all(axis=1)]
    outside = 0.5 * (1.0 - confidence)
    if len(known):
        low, high = np.quantile(known, [outside, 1.0 - outside], axis=0)
    else:
        low = high = np.full(2 * d, math.nan)
    table = np.array([indices, low, high]).T.tolist()
    return [Index(*one, *all_) for one, all_ in zip(table[:d], table[d:], strict=True)], rows


def _constant(values: Array) -> bool:
    """Return whether values differ by no more than rounding."""
    size = np.abs(values).max()
    return bool(size == 0.0 or np.ptp(values / size) <= _ROUNDING)


def _terms(values: Array) -> Array:
    """Return the terms, shape (n, 2 d + 2), whose means give the indices, from finite values that are not all equal.

    Indices do not depend on origin and scale of the values: the products stay in range.
    """
    scaled = values / np.abs(values).max()
    scaled = scaled - scaled[:, :2].mean()
    scaled = scaled / np.abs(scaled[:, :2]).max()
    a, b, ab = scaled[:, :1], scaled[:, 1:2], scaled[:, 2:]
    return np.hstack([b * (ab - a), 0.5 * (a - ab) ** 2, 0.5 * (a + b), 0.5 * (a * a + b * b)])


def _ratios(means: Array) -> Array:
    """Return first and total indices, shape (2 d,), from the means of the terms; nan without variance."""
    variance = means[-1] - means[-2] ** 2
    return means[:-2] / variance if variance > 1e-14 else np.full(len(means) - 2, math.nan)
