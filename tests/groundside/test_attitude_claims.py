"""Chapters 7 and 8 fly as the reference simulation says: the tables' columns and the settings that decide.

`ftcc verify SCENARIO` flies the other cases.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest

from ftcc.groundside.cases import claims_in_flight, load_case
from ftcc.groundside.claims import Result
from tests.groundside.conftest import failing

SYNCHRONIZED = ("monograph", "flight", "flight+bare", "flight+bare+off", "flight+loss_30", "monograph+traditional")
DIRECTED = ("flight", "flight+fresh", "monograph", "flight+cut_uav1_20s", "flight+undirected+delay_20")


@pytest.mark.parametrize("case", SYNCHRONIZED)
def test_attitude_synchronization_shows_what_it_claims(case: str, results_of: Callable[..., dict[str, Result]]) -> None:
    assert failing(results_of(case, "attitude_synchronization")) == {}


@pytest.mark.parametrize("case", DIRECTED)
def test_directed_attitude_shows_what_it_claims(case: str, results_of: Callable[..., dict[str, Result]]) -> None:
    assert failing(results_of(case, "directed_attitude")) == {}


@pytest.mark.parametrize(
    ("scenario", "case"),
    [("attitude_synchronization", "monograph+no_adaptation"), ("directed_attitude", "flight+fresh+off")],
)
def test_without_fault_tolerance_control_is_lost_as_claimed(scenario: str, case: str) -> None:
    flight, results = claims_in_flight(load_case(scenario, case))
    assert flight.lost
    assert all(result.ok for result in results)


def test_the_traditional_law_loses_the_bank_that_fault_tolerance_keeps(
    results_of: Callable[..., dict[str, Result]],
) -> None:
    lost = results_of("monograph+traditional", "attitude_synchronization")["rms of BASTEM once control is lost"].value
    kept = results_of("monograph", "attitude_synchronization")["rms of BASTEM (7.69)"].value
    assert lost > 100.0 * kept
