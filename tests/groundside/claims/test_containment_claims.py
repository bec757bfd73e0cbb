"""Chapter 5 flies as the monograph and the reference simulation say: every row of their tables, in every form."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from ftcc.groundside.claims.claims import Result
from ftcc.groundside.scenario.loading import load
from ftcc.groundside.simulation import fly_in_memory
from tests.groundside.conftest import failing, mission_of

pytestmark = pytest.mark.slow

PRINTED = ("monograph", "monograph+off")
SAMPLED = ("flight+P", "flight+P+off", "flight", "flight+off")
LOSSY = ("flight+P+loss30", "flight+loss30")

TABLE_7_1 = {
    1: ("z at 125 s, each UAV, vs z_d", PRINTED),
    2: ("rounded z at 125 s", PRINTED),
    3: ("max abs(zhat - z_d), 0-400 s", PRINTED),
    4: ("distance outside the hull, 25-400 s", PRINTED),
    5: ("max abs(S1) 0-2 s", PRINTED),
    6: ("max abs(S1) 15-49.9 s", PRINTED),
    7: ("max abs(S1) 50-52 s", PRINTED),
    8: ("max abs(S1) 80-82 s (UAV 1)", PRINTED),
    9: ("max abs(S1) 80-82 s, the other five", PRINTED),
    10: ("max abs(S1) 230-232 s (UAV 3)", PRINTED),
    11: ("integral of S1^2, UAV 1, 80-90 s", PRINTED),
    12: ("integral of S1^2, UAV 3, 230-240 s", PRINTED),
    13: ("max abs(S5) 50-52 s", PRINTED),
    14: ("abs(S5) at 79 s", PRINTED),
    15: ("d1_hat at 79 s; 95 % reached at", PRINTED[:1]),
    16: ("d2_hat at 45 s / 79 s", PRINTED[:1]),
    17: ("lumped estimate at 149 s, UAV 1 / others", PRINTED[:1]),
    18: ("lumped estimate at 395 s, UAV 3", PRINTED[:1]),
    19: ("elevator command at 149 s, UAV 1 / others", PRINTED[:1]),
    20: ("unsaturated command, min 80-82 s", PRINTED),
    21: ("time at the elevator limit after 80 s", PRINTED),
}
TWO_NUMBERS_7_1 = (15, 16, 17, 19)
"""Rows that give two numbers, hence two claims."""

TABLE_7_2 = {
    1: ("max abs(z - z_d) at 125 s", SAMPLED),
    2: ("max abs(z - z_d) 25-400 s", SAMPLED),
    3: ("outside the hull 25-400 s", SAMPLED),
    4: ("max abs(S1) 50-52 s", SAMPLED),
    5: ("max abs(S1) 80-82 s, UAV 1", SAMPLED),
    6: ("max abs(S1) 230-232 s, UAV 3", SAMPLED),
    7: ("max abs(S1) 85-149 s", SAMPLED),
    8: ("max abs(S5) 2-400 s", SAMPLED),
    9: ("seconds after the fault until abs(S1) stays small: UAV 1; UAV 3", SAMPLED),
    10: ("with 30 % message loss: all of the above within 1 %", LOSSY),
}

CUTS = ("1s", "5s", "20s", "20s_at_75")
"""Columns of table 8.8; the first gives no time of return."""
ISOLATED = (1, 3, 4, 5)
"""Rows of table 8.8."""

NOISE = {"1": "noise", "0.2": "noise_02", "0.04": "noise_004"}
"""Rows of table 8.9: factor, variant."""
NOISE_COLUMNS = ("flight+P", "flight+P+slow_hgo", "flight")

FURTHER = {
    "reference section 4": 4,
    "reference section 8.3": 2,
    "reference table 8.4": 4,
    "reference table 8.5": 2,
    "reference table 8.5 and section 8.2": 1,
    "reference table 8.6": 1,
    "reference table 8.7": 1,
}
"""Claims of what changes with rates, links, faults and starts, by source. `ftcc verify containment` flies them all."""
FLOWN_FURTHER = ("flight+engaged", "flight+P+low_10")
"""The cases of these that are flown here."""

CLAIMS = load("containment").plan.claims
CASES = sorted(
    {case for claim in CLAIMS if claim.source not in FURTHER for case in claim.expected} | set(FLOWN_FURTHER),
    key=lambda case: (case.count("+"), case),
)


@pytest.mark.parametrize("case", CASES)
def test_every_claim_of_the_case_holds(case: str, results_of: Callable[[str], dict[str, Result]]) -> None:
    assert failing(results_of(case)) == {}


def claimed(source: str) -> list[tuple[str, ...]]:
    """The cases of each claim with that source; another aircraft is in no table."""
    cases = [claim.expected for claim in CLAIMS if claim.source == source]
    return [tuple(case for case in row if "sixdof" not in case) for row in cases]


@pytest.mark.parametrize("row", TABLE_7_1)
def test_table_7_1_is_claimed_row_by_row(row: int) -> None:
    _, cases = TABLE_7_1[row]
    assert claimed(f"reference table 7.1, row {row}") == [cases] * (2 if row in TWO_NUMBERS_7_1 else 1)


@pytest.mark.parametrize("row", TABLE_7_2)
def test_table_7_2_is_claimed_row_by_row(row: int) -> None:
    _, cases = TABLE_7_2[row]
    if row < 10:
        assert claimed(f"reference table 7.2, row {row}") == [cases] * (2 if row == 9 else 1)
    else:
        for above in range(1, 10):
            assert claimed(f"reference table 7.2, row 10 ({above})") == [cases] * (2 if above == 9 else 1)


@pytest.mark.parametrize("uav", ISOLATED)
@pytest.mark.parametrize("cut", CUTS)
def test_table_8_8_is_claimed_cell_by_cell(uav: int, cut: str) -> None:
    column = CUTS.index(cut) + 1
    cells = claimed(f"reference table 8.8, UAV {uav}, column {column}")
    assert cells == [(f"flight+P+cut_uav{uav}_{cut}",)] * (1 if column == 1 else 2)


@pytest.mark.parametrize("factor", NOISE)
def test_table_8_9_is_claimed_row_by_row(factor: str) -> None:
    cases = tuple(f"{column}+{NOISE[factor]}" for column in NOISE_COLUMNS)
    assert claimed(f"reference table 8.9, factor {factor}") == [cases] * 2


def test_no_claim_stands_beside_these_tables() -> None:
    tables = len(TABLE_7_1) + len(TWO_NUMBERS_7_1) + 2 * 10 + len(ISOLATED) * (2 * len(CUTS) - 1) + 2 * len(NOISE)
    text_of_8_8 = 4
    assert len(CLAIMS) == tables + text_of_8_8 + sum(FURTHER.values())
    assert sum(claim.source == "reference section 8.8, text" for claim in CLAIMS) == text_of_8_8
    for source, number in FURTHER.items():
        assert sum(claim.source == source for claim in CLAIMS) == number, source


@pytest.mark.parametrize(("lossy", "lossless"), [("flight+loss30", "flight"), ("flight+P+loss30", "flight+P")])
def test_thirty_percent_loss_changes_nothing_by_more_than_one_percent(
    lossy: str, lossless: str, results_of: Callable[[str], dict[str, Result]]
) -> None:
    whole = results_of(lossless)
    for name, result in results_of(lossy).items():
        assert result.value == pytest.approx(whole[name.removesuffix(", 30 % of the records lost")].value, rel=0.01)


def test_the_seed_alone_decides_which_records_are_lost() -> None:
    first, again, other = (
        fly_in_memory(mission_of("flight+loss30", duration=30.0, seed=seed)).column("z", 3) for seed in (1, 1, 2)
    )
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
