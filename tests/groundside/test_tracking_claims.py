"""Chapters 3 and 4 fly as the reference simulation says: the tables' columns and the settings that decide.

`ftcc verify SCENARIO` flies the other cases.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest

from ftcc.groundside.claims import Result
from tests.groundside.conftest import failing

PRESCRIBED = (
    "monograph",
    "flight",
    "flight+off",
    "flight+fault_after_servo",
    "flight+exchange_10",
    "flight+loss_30",
    "flight+cut_uav1_20s",
    "flight+noise_z_2cm",
)


@pytest.mark.parametrize("case", PRESCRIBED)
def test_prescribed_performance_shows_what_it_claims(case: str, results_of: Callable[..., dict[str, Result]]) -> None:
    assert failing(results_of(case, "prescribed_performance")) == {}


def test_without_fault_tolerance_one_fault_costs_the_aircraft_and_with_it_half_a_metre(
    results_of: Callable[..., dict[str, Result]],
) -> None:
    name = "benefit of the fault tolerance: UAV 1 near the leader's altitude"
    off, on = (results_of(case, "prescribed_performance")[name].value for case in ("flight+off", "flight"))
    assert off > 1000.0 * on
