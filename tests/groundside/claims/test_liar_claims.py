"""One liar of twelve leads honest followers out of the leaders' hull; with W-MSR, on a graph that stands it, none."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from ftcc.groundside.claims.claims import Result
from ftcc.groundside.scenario import load, resolve
from ftcc.groundside.simulation import fly_in_memory
from tests.groundside.conftest import failing

HULL = "distance of honest followers outside the leaders' hull"
CASES = ("flight", "flight+defended", "flight+sparse", "flight+defended+sparse")


@pytest.mark.filterwarnings("ignore::ftcc.groundside.ScenarioWarning")
@pytest.mark.parametrize("case", CASES)
def test_the_flights_show_what_they_claim(results_of: Callable[..., dict[str, Result]], case: str) -> None:
    results = results_of(case, "liar")
    assert HULL in results
    assert failing(results) == {}


def test_only_the_defended_swarm_keeps_what_the_undefended_one_loses(
    results_of: Callable[..., dict[str, Result]],
) -> None:
    astray, kept = (results_of(case, "liar")[HULL].value for case in CASES[:2])
    assert astray > 10.0
    assert kept < 0.5


def test_the_liar_flies_what_it_does_not_tell() -> None:
    """Its law knows nothing of the lie; it is led astray by those who believe it."""
    flight = fly_in_memory(resolve(load("liar", variants=["defended"])))
    end = flight.column("zhat", 5)[-1]
    assert abs(flight.column("z", 5)[-1] - end) < 0.1
    assert np.isfinite(end)
    assert 1040.0 < end < 1060.0
