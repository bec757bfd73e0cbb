"""The tick that a message with a stamp in whole ms belongs to."""

from __future__ import annotations

import pytest

from ftcc.link.timing import tick_of


@pytest.mark.parametrize("period_us", [1000, 1001, 2500, 4999, 10_000, 12_500, 33_333])
def test_the_tick_of_a_stamp_in_whole_ms_is_certain(period_us: int) -> None:
    """Also after a day; of a period of 1 ms at least no other tick has the stamp."""
    for first in (0, 86_400_000_000 // period_us, 2**32 // period_us):
        for tick in range(first, first + 1001):
            stamp = tick * period_us // 1000 * 1000
            assert tick_of(stamp, period_us) == tick
            assert tick_of(tick * period_us, period_us) == tick, "a stamp that is exact"


@pytest.mark.parametrize(("stamp", "period_us"), [(-1, 10_000), (-1000, 12_500), (11_000, 10_000), (13_000, 12_500)])
def test_a_stamp_of_no_tick_is_none(stamp: int, period_us: int) -> None:
    assert tick_of(stamp, period_us) == -1
