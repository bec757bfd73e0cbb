"""Chapter 6 flies as the reference simulation says: the table of its section 7 and the settings that decide.

`ftcc verify finite_time_containment` flies all cases, the printed law to its end.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest

from ftcc.groundside.claims.claims import Result
from ftcc.groundside.scenario.loading import load
from ftcc.groundside.simulation.cases import claims_in_flight, load_case
from tests.groundside.conftest import failing

pytestmark = pytest.mark.slow

SCENARIO = "finite_time_containment"
FLOWN = (
    "flight",
    "flight+wave+exchange_10+loss30",
    "flight+cut_uav1_20s_at_55",
    "flight+noise_place_05",
    "flight+rate_100+predicted",
    "flight+rate_50",
    "flight+steep",
)
CLAIMS = load(SCENARIO).plan.claims

BASELINES = ("infinite_time", "off", "frozen", "unadapted", "no_faults")
RATES = (100, 50, 10, 5)
LOSSES = (10, 30, 50, 80)
CUTS = [f"cut_uav{uav}_{seconds}s_at_{at}" for uav in (1, 2) for seconds in (1, 5, 20) for at in (55, 100)]


@pytest.mark.parametrize("case", FLOWN)
def test_every_claim_of_the_case_holds(case: str, results_of: Callable[..., dict[str, Result]]) -> None:
    assert failing(results_of(case, SCENARIO)) == {}


@pytest.mark.parametrize("case", ["monograph", "monograph+infinite_time"])
def test_the_printed_law_holds_what_it_claims_of_the_first_50_s(case: str) -> None:
    flight, results = claims_in_flight(load_case(SCENARIO, case, duration=50.0))
    assert flight.lost == {}
    decided = {result.claim.name: result for result in results if result.ok is not None}
    assert "altitude error of UAV 1 after its fault" in decided
    assert failing(decided) == {}


def test_finite_time_terms_and_adaptation_after_the_fault_are_what_holds_the_altitude() -> None:
    """Reference section 7: they shrink the error after UAV 1's fault by 4, and by 4 and 2 against none and frozen."""
    worst = {}
    for case in ("flight", *(f"flight+{variant}" for variant in BASELINES[:3])):
        _, results = claims_in_flight(load_case(SCENARIO, case, duration=50.0))
        (worst[case],) = (r.value for r in results if r.claim.name == "altitude error of UAV 1 after its fault")
    assert worst["flight+infinite_time"] > 3.5 * worst["flight"]
    assert worst["flight+off"] > 3.0 * worst["flight"]
    assert worst["flight+frozen"] > 1.9 * worst["flight"]


def cases_of(name: str) -> set[str]:
    """The cases of a claim; another aircraft is in no table."""
    (claim,) = (claim for claim in CLAIMS if claim.name == name)
    return {case for case in claim.expected if "sixdof" not in case}


@pytest.mark.parametrize("row", range(1, 23))
def test_the_table_of_section_7_is_claimed_row_by_row(row: int) -> None:
    sources = (f"reference table 7, row {row}", f"reference table 7, row {row}, and baselines")
    claims = [claim for claim in CLAIMS if claim.source in sources]
    assert claims
    assert all({"flight", "monograph"} <= set(claim.expected) for claim in claims)


def test_every_baseline_is_claimed_in_both_forms() -> None:
    both = {f"{form}+{variant}" for form in ("flight", "monograph") for variant in BASELINES}
    assert both <= cases_of("altitude error, rms")


def test_the_tables_of_section_8_are_claimed_cell_by_cell() -> None:
    assert cases_of("message rate: position error") == {
        "flight",
        "flight+wave",
        *(f"flight+{wave}exchange_{rate}" for rate in RATES for wave in ("", "wave+")),
    }
    held = {"flight+held", *(f"flight+exchange_{rate}+held" for rate in RATES)}
    assert cases_of("neighbours held: position error") == cases_of("neighbours held: altitude error") == held
    lossy = {f"flight+wave+{rate}loss{loss}" for rate in ("", "exchange_10+") for loss in LOSSES}
    assert cases_of("records lost: position error") == lossy
    assert lossy < cases_of("records lost: altitude error")
    cut = [set(claim.expected) for claim in CLAIMS if claim.source == "reference table 8d"]
    assert sorted(case for cases in cut for case in cases) == sorted(2 * [f"flight+{cut}" for cut in CUTS])
    assert len(cases_of("noise: altitude error")) == 6
