"""Intervals: what a number of flights says about all flights, and about the difference of two variants.

Two-sided intervals leave out (1 - confidence) / 2 at each end. "Exact" is meant of independent flights; points of a
Sobol' or Latin hypercube design spread more evenly than independent ones, for which the same intervals are as a rule
wider than needed.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ftcc.groundside.errors import UserError

__all__ = [
    "Estimate",
    "Paired",
    "PairedValues",
    "Share",
    "check_confidence",
    "lower_bound",
    "paired",
    "paired_values",
    "quantile",
    "share",
    "upper_bound",
]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Share:
    """A share of flights with its interval."""

    count: int
    of: int
    value: float
    """nan if there were no flights."""
    low: float
    high: float


@dataclass(frozen=True)
class Estimate:
    """A number with its interval, whose ends may be infinite."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Paired:
    """Two shares of the same draws."""

    both: int
    only_first: int
    only_second: int
    neither: int
    difference: float
    """Share of the first less that of the second; nan without draws."""
    low: float
    high: float
    p: float
    """Probability of discordant draws at least as one-sided if both shares were the same."""


@dataclass(frozen=True)
class PairedValues:
    """Two values of the same draws."""

    median: float
    """Median of first less second; nan without pairs."""
    low: float
    high: float
    p: float
    pairs: int
    """Pairs that were used."""
    dropped: int
    """Pairs without a difference: one is nan, or both are the same infinity."""


def check_confidence(confidence: float) -> None:
    """Raise UserError if a confidence is not between 0 and 1."""
    if not 0.0 < confidence < 1.0:
        raise UserError(f"confidence {confidence!r}: must be between 0 and 1, such as 0.95")


def _check_counts(count: int, of: int, confidence: float) -> None:
    check_confidence(confidence)
    if not 0 <= count <= of:
        raise UserError(f"{count} of {of}: the count must be from 0 to the number of flights")


def share(count: int, of: int, confidence: float = 0.95) -> Share:
    """Return the share of flights with its exact two-sided interval (Clopper & Pearson 1934).

    It covers with at least ``confidence`` for every true share. Without flights it is [0, 1].

    Raises
    ------
    UserError
        ``count`` is not from 0 to ``of``, or ``confidence`` not between 0 and 1.
    """
    check_confidence(confidence)
    one_sided = 0.5 + 0.5 * confidence
    low, high = lower_bound(count, of, one_sided), upper_bound(count, of, one_sided)
    return Share(int(count), int(of), count / of if of else math.nan, low, high)


def upper_bound(count: int, of: int, confidence: float = 0.95) -> float:
    """Return the exact one-sided upper bound of a share (Clopper & Pearson 1934); 1 without flights.

    Raises
    ------
    UserError
        As `share`.
    """
    from scipy.special import betaincinv

    _check_counts(count, of, confidence)
    return 1.0 if count == of else float(betaincinv(count + 1, of - count, confidence))


def lower_bound(count: int, of: int, confidence: float = 0.95) -> float:
    """Return the exact one-sided lower bound of a share (Clopper & Pearson 1934); 0 without flights.

    Raises
    ------
    UserError
        As `share`.
    """
    from scipy.special import betaincinv

    _check_counts(count, of, confidence)
    return 0.0 if count == 0 else float(betaincinv(count, of - count + 1, 1.0 - confidence))


def quantile(values: ArrayLike, q: float, confidence: float = 0.95) -> Estimate:
    """Return a quantile with the interval between two order statistics (David & Nagaraja 2003, section 7.1).

    The ranks are binomial, hence no distribution is assumed, and the interval covers with at least ``confidence``. An
    end is -inf or inf where the sample is too small for it: the median needs 6 values for 95 %, the 0.99 quantile 368
    for its upper end. Values may be infinite. The value is the middle of the two neighbours if q n is whole (nan
    between -inf and inf).

    Raises
    ------
    UserError
        A value is nan, q or the confidence not between 0 and 1.
    """
    from scipy.stats import binom

    check_confidence(confidence)
    if not 0.0 < q < 1.0:
        raise UserError(f"quantile {q!r}: must be between 0 and 1")
    ordered = np.sort(np.asarray(values, dtype=np.float64).ravel())
    n = len(ordered)
    if n and np.isnan(ordered[-1]):
        raise UserError("a quantile of values with nan: drop them before, and count them")
    if n == 0:
        return Estimate(math.nan, -math.inf, math.inf)
    outside = 0.5 * (1.0 - confidence)
    # Fewer than `below` values lie below the quantile, or more than `above`, with a probability of `outside` at most.
    below, above = int(binom.ppf(outside, n, q)), int(binom.ppf(1.0 - outside, n, q))
    return Estimate(
        _middle(ordered, q),
        float(ordered[below - 1]) if below > 0 else -math.inf,
        float(ordered[above]) if above < n else math.inf,
    )


def _middle(ordered: Array, q: float) -> float:
    place = float(np.quantile(np.arange(len(ordered)), q, method="averaged_inverted_cdf"))
    left, right = float(ordered[math.floor(place)]), float(ordered[math.ceil(place)])
    return left if left == right else 0.5 * (left + right)


def paired(first: ArrayLike, second: ArrayLike, confidence: float = 0.95) -> Paired:
    """Compare two shares of the same draws.

    The interval of the difference is method 10 of Newcombe (1998, Statistics in Medicine 17, 2635-2650): squares of the
    distances to the ends of Wilson's intervals, added with the correlation phi of the pairs, which has a continuity
    correction. It is approximate: it covers with ``confidence`` on average over true shares. p is of the exact
    two-sided McNemar test (McNemar 1947): the discordant draws are binomial with 1/2 if both shares are the same.

    Parameters
    ----------
    first, second : array_like of bool, shape (n,)
        What holds, draw by draw.
    confidence : float

    Raises
    ------
    UserError
        The lengths differ, a value is neither true nor false, or the confidence is not between 0 and 1.
    """
    from scipy.stats import binomtest

    check_confidence(confidence)
    a, b = np.asarray(first).ravel(), np.asarray(second).ravel()
    if len(a) != len(b):
        raise UserError(f"{len(a)} and {len(b)} flights: paired flights are as many")
    for values in (a, b):
        if values.dtype != np.bool_ and not np.isin(values, (0, 1)).all():
            raise UserError("paired shares are of values that are true or false")
    a, b = a.astype(bool), b.astype(bool)
    both, only_first, only_second = int((a & b).sum()), int((a & ~b).sum()), int((~a & b).sum())
    n = len(a)
    counts = (both, only_first, only_second, n - both - only_first - only_second)
    if n == 0:
        return Paired(*counts, math.nan, -1.0, 1.0, 1.0)
    discordant = only_first + only_second
    p = float(binomtest(only_first, discordant, 0.5).pvalue) if discordant else 1.0
    low, high = _newcombe_10(*counts, confidence)
    return Paired(*counts, (only_first - only_second) / n, low, high, p)


def _newcombe_10(both: int, only_first: int, only_second: int, neither: int, confidence: float) -> tuple[float, float]:
    n = both + only_first + only_second + neither
    first, second = both + only_first, both + only_second
    margins = first * (n - first) * second * (n - second)
    covariance = float(both * neither - only_first * only_second)
    if covariance > 0.0:
        covariance = max(covariance - 0.5 * n, 0.0)
    phi = covariance / math.sqrt(margins) if margins else 0.0
    p1, p2 = first / n, second / n
    (low1, high1), (low2, high2) = _wilson(first, n, confidence), _wilson(second, n, confidence)

    def distance(x: float, y: float) -> float:
        return math.sqrt(max(x * x - 2.0 * phi * x * y + y * y, 0.0))

    low = p1 - p2 - distance(p1 - low1, high2 - p2)
    high = p1 - p2 + distance(high1 - p1, p2 - low2)
    return max(low, -1.0), min(high, 1.0)


def _wilson(count: int, of: int, confidence: float) -> tuple[float, float]:
    """Return Wilson's score interval (Wilson 1927)."""
    from scipy.stats import binomtest

    found = binomtest(count, of).proportion_ci(confidence, method="wilson")
    return float(found.low), float(found.high)


def paired_values(first: ArrayLike, second: ArrayLike, confidence: float = 0.95) -> PairedValues:
    """Compare two values of the same draws by the median of first less second.

    The interval is that of `quantile`. p is of the signed-rank test (Wilcoxon 1945, `scipy.stats.wilcoxon`, zeros
    dropped), which asks whether the differences are symmetric about zero. Pairs without a difference are dropped and
    counted.

    Raises
    ------
    UserError
        The lengths differ, or the confidence is not between 0 and 1.
    """
    from scipy.stats import wilcoxon

    check_confidence(confidence)
    a, b = np.asarray(first, dtype=np.float64).ravel(), np.asarray(second, dtype=np.float64).ravel()
    if len(a) != len(b):
        raise UserError(f"{len(a)} and {len(b)} flights: paired flights are as many")
    with np.errstate(invalid="ignore"):
        differences = a - b
    known = differences[~np.isnan(differences)]
    middle = quantile(known, 0.5, confidence)
    p = 1.0
    if known.any():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # older scipy warns that zeros and ties make p approximate
            p = float(wilcoxon(known).pvalue)
    return PairedValues(middle.value, middle.low, middle.high, p, len(known), len(a) - len(known))
