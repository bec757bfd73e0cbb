"""Stopping rules: what they say, when they stop, and that looking often is paid for."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from ftcc.groundside.errors import UserError
from ftcc.groundside.statistics import Until, share, until_of, upper_bound


@pytest.mark.parametrize(
    ("text", "claim", "sign", "limit", "confidence"),
    [
        ("width < 0.01", None, "width", 0.01, 0.95),
        ("  width<1e-2 at 99 %", None, "width", 0.01, 0.99),
        ('width of "steady  error" < 0.02', "steady  error", "width", 0.02, 0.95),
        ("width of lost < 0.02", "lost", "width", 0.02, 0.95),
        ("P(lost) < 1e-3 at 95 %", "lost", "<", 1e-3, 0.95),
        ("P( lost )<.001 at 99.9%", "lost", "<", 1e-3, 0.999),
        ('P("in hull < 13 s") > 0.9 at 95 %', "in hull < 13 s", ">", 0.9, 0.95),
        ('P("hull") > 0.9', "hull", ">", 0.9, 0.95),
    ],
)
def test_what_a_rule_says(text: str, claim: str | None, sign: str, limit: float, confidence: float) -> None:
    found = until_of(text)
    assert (found.claim, found.sign, found.limit) == (claim, sign, limit)
    assert found.confidence == pytest.approx(confidence)
    assert until_of(found.text) == found


def test_looks_grow_by_a_quarter() -> None:
    sizes = list(itertools.islice(until_of("width < 0.1").looks(), 30))
    assert sizes[:4] == [64, 80, 100, 125]
    assert all(1.2 < after / before < 1.3 for before, after in itertools.pairwise(sizes))


def test_a_width_is_that_of_the_interval() -> None:
    until = until_of("width < 0.1")
    size = next(n for n in itertools.count(2, 2) if share(n // 2, n).high - share(n // 2, n).low < 0.1)
    assert until.reached(size // 2, size, 1)
    assert until.reached(size // 2, size, 9)
    assert not until.reached(size // 2 - 1, size - 2, 1)
    assert not until.reached(0, 0, 1)


def test_a_bound_costs_more_at_later_looks() -> None:
    """Without a loss, n flights bound the probability by 1 - alpha^(1/n), alpha = 5 % 6 / (pi k)^2."""
    until = until_of("P(lost) < 1e-3 at 95 %")

    def needed(look: int) -> int:
        return int(np.ceil(np.log(0.05 * 6 / (np.pi * look) ** 2) / np.log1p(-1e-3)))

    assert needed(1) > 2995  # what one look without correction needs
    for look in (1, 5, 20):
        assert until.reached(0, needed(look) + 1, look)
        assert not until.reached(0, needed(look) - 1, look)
    assert not until.reached(0, 0, 1)


def test_above_and_below_are_mirrored() -> None:
    above, below = until_of('P("x") > 0.9'), until_of('P("x") < 0.1')
    for held in (88, 95, 99, 100):
        assert above.reached(held, 100, 2) == below.reached(100 - held, 100, 2)
    assert above.reached(100, 100, 2)
    assert not above.reached(88, 100, 2)


def stopped(until: Until, p: float, most: int, corrected: bool) -> float:
    """Share of 400 studies of flights with a known probability that a rule ever stops."""
    random, stops = np.random.default_rng(2), 0
    for _ in range(400):
        count = np.cumsum(random.random(most) < p)
        for look, size in enumerate(until.looks(), start=1):
            if size > most:
                break
            n = int(count[size - 1])
            if until.reached(n, size, look) if corrected else upper_bound(n, size, until.confidence) < until.limit:
                stops += 1
                break
    return stops / 400


def test_a_wrong_statement_is_as_rare_as_it_says_despite_all_looks() -> None:
    until = until_of("P(lost) < 0.05 at 90 %")
    assert stopped(until, 0.05, 2000, corrected=True) <= 0.10
    assert stopped(until, 0.05, 2000, corrected=False) > 0.13  # this is what the correction is for
    assert stopped(until, 0.02, 2000, corrected=True) > 0.95


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "must be such as: width < 0.01"),
        ("width", "must be such as"),
        ("width > 0.01", "must be such as"),
        ("width of steady < 0.01", "must be such as"),
        ('width of "" < 0.01', "must be such as"),
        ("P(steady) < 0.01", "must be such as"),
        ("P(lost) = 0.01", "must be such as"),
        ("P(lost) < 0.01 at 95", "must be such as"),
        ("P(lost) < abc", "abc is no number"),
        ("P(lost) < nan", "nan must be between 0 and 1"),
        ("P(lost) < 0", "0 must be between 0 and 1"),
        ("width < 1", "1 must be between 0 and 1"),
        ("width < -0.1", "-0.1 must be between 0 and 1"),
        ("P(lost) < 0.1 at 100 %", "at 100 % must be between 0 and 100 %"),
        ("P(lost) < 0.1 at x %", "x is no number"),
        ('P("lost") < 0.1', "lost without quotes"),
    ],
)
def test_a_wrong_rule_is_refused(text: str, says: str) -> None:
    with pytest.raises(UserError, match=says) as refused:
        until_of(text)
    assert str(refused.value).startswith(f"until {text!r}: ")


def test_counts_and_looks_are_checked() -> None:
    until = until_of("width < 0.1")
    with pytest.raises(UserError, match="3 of 2"):
        until.reached(3, 2, 1)
    with pytest.raises(UserError, match="numbered from 1"):
        until.reached(1, 2, 0)
