"""Intervals cover what they say, and agree with published examples."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom, norm

from ftcc.groundside.errors import UserError
from ftcc.groundside.statistics import (
    DESIGNS,
    Design,
    distribution_of,
    lower_bound,
    paired,
    paired_values,
    quantile,
    share,
    upper_bound,
)

pytestmark = pytest.mark.filterwarnings("error")

FLIGHTS, STUDIES = 100, 1000


def exact_coverage(p: float) -> float:
    """Probability with which the interval of 100 flights covers a share."""
    covers = [(found := share(k, FLIGHTS)).low <= p <= found.high for k in range(FLIGHTS + 1)]
    return float(binom.pmf(np.arange(FLIGHTS + 1), FLIGHTS, p)[covers].sum())


def test_the_exact_interval_never_covers_less_than_it_says() -> None:
    coverage = [exact_coverage(p) for p in np.linspace(0.003, 0.997, 150)]
    assert min(coverage) >= 0.95
    assert np.mean(coverage) == pytest.approx(0.965, abs=0.01)


P = 0.35
"""100 flights have 101 intervals, so that their coverage depends on the true share: it is 95.4 % here, 95.6 % at 0.1,
96.5 % at 0.5, 98.3 % at 0.05. A share is taken at which the interval is nearly as narrow as an exact one may be."""


def covered(kind: str, p: float = P) -> float:
    """Share of studies of 100 flights, each with a seed, whose interval covers p: by design, distribution and count."""
    quantity = distribution_of("normal(loc=10, scale=2)", "test")
    bound = 30.0 + 2.0 * math.sqrt(3.0) * float(norm.ppf(p))  # three quantities in sum are normal(30, 2 sqrt 3)
    covers = 0
    for seed in range(STUDIES):
        points = Design(kind, 3, seed, FLIGHTS).points(0, FLIGHTS)
        sums = np.reshape(quantity.values(points), points.shape).sum(axis=1)
        found = share(int((sums < bound).sum()), FLIGHTS)
        covers += found.low <= p <= found.high
    return covers / STUDIES


def test_a_thousand_studies_cover_a_known_probability() -> None:
    assert exact_coverage(P) == pytest.approx(0.9543, abs=1e-4)
    coverage = {kind: covered(kind) for kind in DESIGNS}
    assert coverage["random"] == pytest.approx(0.95, abs=0.015), coverage
    assert coverage["sobol"] >= coverage["random"], coverage
    assert coverage["lhs"] >= coverage["random"], coverage


def test_where_the_exact_interval_is_wider_it_covers_more() -> None:
    exact = exact_coverage(0.05)
    assert exact == pytest.approx(0.9826, abs=1e-4)
    assert covered("random", 0.05) == pytest.approx(exact, abs=4.0 * math.sqrt(exact * (1.0 - exact) / STUDIES))


@pytest.mark.parametrize(
    ("count", "of", "low", "high"),
    [(0, 10, 0.0, 0.3085), (10, 10, 0.6915, 1.0), (1, 20, 0.00127, 0.2487), (81, 263, 0.2527, 0.3676)],
)
def test_a_share_has_the_interval_of_the_tables(count: int, of: int, low: float, high: float) -> None:
    """Newcombe 1998, Statistics in Medicine 17, 857-872, table I, method 5; 0 of 10 has 1 - 0.025^(1/10)."""
    found = share(count, of)
    assert (found.value, found.low, found.high) == pytest.approx((count / of, low, high), abs=5e-5)


def test_bounds_are_the_ends_of_one_sided_intervals() -> None:
    assert upper_bound(0, 2994, 0.95) == pytest.approx(1.0 - 0.05 ** (1 / 2994), rel=1e-9)
    assert lower_bound(7, 50, 0.975) == share(7, 50).low
    assert upper_bound(7, 50, 0.975) == share(7, 50).high
    assert (upper_bound(5, 5), lower_bound(0, 5)) == (1.0, 0.0)


def test_no_flights_say_nothing() -> None:
    found = share(0, 0)
    assert math.isnan(found.value)
    assert (found.low, found.high) == (0.0, 1.0)


def table(both: int, only_first: int, only_second: int, neither: int) -> tuple[list[bool], list[bool]]:
    first = [True] * (both + only_first) + [False] * (only_second + neither)
    second = [True] * both + [False] * only_first + [True] * only_second + [False] * neither
    return first, second


@pytest.mark.parametrize(
    ("counts", "low", "high"),
    [
        ((14, 5, 0, 22), 0.011, 0.226),  # Altman et al., Statistics with confidence (2000), p. 52
        (
            (59, 6, 16, 80),
            -0.1186,
            -0.0046,
        ),  # Fagerland et al., Statistical analysis of contingency tables (2017), ch. 8
        ((36, 12, 2, 0), 0.0569, 0.3404),  # Newcombe 1998, table II
    ],
)
def test_a_difference_of_shares_has_the_published_interval(counts: Sequence[int], low: float, high: float) -> None:
    found = paired(*table(*counts))
    assert (found.both, found.only_first, found.only_second, found.neither) == counts
    assert found.difference == pytest.approx((counts[1] - counts[2]) / sum(counts))
    assert (found.low, found.high) == pytest.approx((low, high), abs=6e-4 if low == 0.011 else 6e-5)


def test_swapped_variants_have_the_opposite_difference() -> None:
    first, second = table(59, 6, 16, 80)
    there, back = paired(first, second), paired(second, first)
    assert (back.difference, back.p) == (-there.difference, there.p)
    assert (back.low, back.high) == pytest.approx((-there.high, -there.low))


def test_the_paired_test_counts_discordant_draws() -> None:
    """Exact McNemar: 5 to 0 has 2 / 2^5; the same draws twice differ in nothing."""
    assert paired(*table(14, 5, 0, 22)).p == pytest.approx(2.0 / 2**5)
    same = paired(*table(3, 0, 0, 4))
    assert (same.difference, same.p) == (0.0, 1.0)
    assert same.low < 0.0 < same.high


def test_the_paired_interval_covers() -> None:
    cells, studies = [0.70, 0.15, 0.05, 0.10], 1000
    tables = np.random.default_rng(15).multinomial(100, cells, size=studies)
    covers = sum((found := paired(*table(*counts))).low <= 0.10 <= found.high for counts in tables.tolist())
    assert covers / studies == pytest.approx(0.95, abs=4.0 * math.sqrt(0.95 * 0.05 / studies))


def test_no_pairs_say_nothing() -> None:
    found = paired([], [])
    assert math.isnan(found.difference)
    assert (found.low, found.high, found.p) == (-1.0, 1.0, 1.0)


@pytest.mark.parametrize(("q", "flights"), [(0.5, 50), (0.9, 100)])
def test_order_statistics_cover_a_quantile(q: float, flights: int) -> None:
    random, studies, true = np.random.default_rng(4), 1000, -math.log(1.0 - q)
    covers = sum(
        (found := quantile(random.exponential(size=flights), q)).low <= true <= found.high for _ in range(studies)
    )
    ranks = quantile(np.arange(1.0, flights + 1.0), q)
    exact = float(binom.cdf(ranks.high - 1, flights, q) - binom.cdf(ranks.low - 1, flights, q))
    assert 0.95 <= exact < 0.97
    assert covers / studies == pytest.approx(exact, abs=4.0 * math.sqrt(0.05 * 0.95 / studies))


def test_the_interval_of_the_median_has_the_ranks_of_the_tables() -> None:
    """Ranks 2 and 9 of 10, 9 and 20 of 28 (Altman et al. 2000, table 18.4)."""
    assert quantile(range(1, 11), 0.5).__dict__ == {"value": 5.5, "low": 2.0, "high": 9.0}
    ranks = quantile(range(1, 29), 0.5)
    assert (ranks.low, ranks.high) == (9.0, 20.0)


def test_a_small_sample_has_open_ends() -> None:
    assert quantile(range(5), 0.5).low == -math.inf
    assert quantile(range(6), 0.5).__dict__ == {"value": 2.5, "low": 0.0, "high": 5.0}
    assert quantile(range(367), 0.99).high == math.inf
    assert quantile(range(368), 0.99).high == 367.0
    assert math.isnan(quantile([], 0.5).value)


def test_values_that_never_come_are_infinite() -> None:
    found = quantile([1.0, 2.0, 3.0, math.inf, math.inf, math.inf, math.inf, math.inf], 0.5)
    assert (found.value, found.low, found.high) == (math.inf, 1.0, math.inf)


def test_differences_of_paired_values() -> None:
    first, second = np.arange(10.0) + 1.0, np.zeros(10)
    found = paired_values([*first, math.nan, math.inf], [*second, 1.0, math.inf])
    assert (found.median, found.low, found.high, found.pairs, found.dropped) == (5.5, 2.0, 9.0, 10, 2)
    assert found.p == pytest.approx(2.0 / 2**10)  # all ranks have one sign
    same = paired_values(first, first)
    assert (same.median, same.p) == (0.0, 1.0)
    assert paired_values([math.nan], [1.0]).pairs == 0


def ones(n: int) -> NDArray[np.float64]:
    return np.ones(n)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: share(3, 2), "3 of 2"),
        (lambda: share(-1, 2), "-1 of 2"),
        (lambda: share(1, 2, 95), "confidence 95: must be between 0 and 1"),
        (lambda: upper_bound(1, 2, math.nan), "confidence nan"),
        (lambda: quantile([1.0], 1.0), "quantile 1.0"),
        (lambda: quantile([1.0, math.nan], 0.5), "nan: drop them"),
        (lambda: paired(ones(3), ones(4)), "3 and 4 flights"),
        (lambda: paired([0.5], [1]), "true or false"),
        (lambda: paired_values(ones(3), ones(4)), "3 and 4 flights"),
        (lambda: paired_values(ones(3), ones(3), 0.0), "confidence 0.0"),
    ],
)
def test_what_cannot_be_is_refused(call, says: str) -> None:
    with pytest.raises(UserError, match=says):
        call()
