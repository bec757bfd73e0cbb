"""Chapters 7 and 8 fly as the reference simulation says: the tables' columns and the settings that decide.

`ftcc verify SCENARIO` flies the other cases.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from ftcc.groundside.claims.claims import Result
from ftcc.groundside.claims.expressions import unwrapped, wrapped
from ftcc.groundside.scenario.loading import load
from ftcc.groundside.scenario.mission import resolve
from ftcc.groundside.simulation import fly_in_memory
from ftcc.groundside.simulation.cases import claims_in_flight, load_case
from tests.groundside.conftest import failing

pytestmark = pytest.mark.slow

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


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("scenario", ["attitude_synchronization", "directed_attitude"])
def test_an_inverted_swarm_rolls_upright_the_shorter_way(scenario: str, side: float) -> None:
    """From -166 deg of bank to 80 deg: through half a turn, 114 deg, where level wings would be 246 deg away."""
    begin, end = -2.9 * side, 1.4 * side
    settings = [
        *(f"start.uav.{uav}.mu={begin}" for uav in range(1, 5)),
        f"attitude.commands=[{{at=0.0, bank={end}, alpha=0.04, sideslip=0.0}}]",
        "faults=[]",
        "disturbances=[]",
        "start.z=3000.0",
    ]
    flight = fly_in_memory(resolve(load(scenario, settings=settings, duration=8.0)))
    assert flight.lost == {}
    for uav in flight.mission.uavs:
        rolled = unwrapped(flight.column("mu", uav))
        assert np.abs(rolled - begin).max() < np.radians(114.0 + 75.0), "the first swing overshoots"
        assert np.degrees(wrapped(rolled[-1] - np.array(end))) == pytest.approx(0.0, abs=2.0)
