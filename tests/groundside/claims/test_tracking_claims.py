"""Chapters 3 and 4 fly as the reference simulation says: the tables' columns and the settings that decide.

`ftcc verify SCENARIO` flies the other cases.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest

from ftcc.groundside.claims.claims import Result
from ftcc.groundside.simulation.cases import claims_in_flight, load_case
from tests.groundside.conftest import failing

pytestmark = pytest.mark.slow

PRESCRIBED = (
    "monograph",
    "flight",
    "flight+off",
    "flight+fault_after_servo",
    "flight+exchange_10",
    "flight+loss_30",
    "flight+cut_uav1_20s",
    "flight+noise_z_2cm",
    "flight+sixdof",
)


@pytest.mark.parametrize("case", PRESCRIBED)
def test_prescribed_performance_shows_what_it_claims(case: str, results_of: Callable[..., dict[str, Result]]) -> None:
    assert failing(results_of(case, "prescribed_performance")) == {}


NEAREST = (
    "monograph",
    "monograph+d1_step",
    "monograph+off+guarded",
    "flight",
    "flight+off",
    "flight+lag",
    "flight+exchange_10",
    "flight+loss_30",
    "flight+cut_uav2_20s",
)


@pytest.mark.parametrize("case", NEAREST)
def test_nearest_neighbours_show_what_they_claim(case: str, results_of: Callable[..., dict[str, Result]]) -> None:
    assert failing(results_of(case, "nearest_neighbour")) == {}


def test_without_observers_and_guards_the_second_disturbance_costs_every_aircraft() -> None:
    flight, _ = claims_in_flight(load_case("nearest_neighbour", "monograph+off", duration=130.0))
    assert set(flight.lost) == {1, 2, 3, 4}
    assert all(115.0 < t < 130.0 for t, _ in flight.lost.values())


def test_without_fault_tolerance_one_fault_costs_the_aircraft_and_with_it_half_a_metre(
    results_of: Callable[..., dict[str, Result]],
) -> None:
    name = "benefit of the fault tolerance: UAV 1 near the leader's altitude"
    off, on = (results_of(case, "prescribed_performance")[name].value for case in ("flight+off", "flight"))
    assert off > 1000.0 * on
