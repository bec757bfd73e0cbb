"""A flight that keeps some columns only: the same flight, the same claims, the same verdict."""

from __future__ import annotations

import numpy as np
import pytest

from ftcc.groundside import load
from ftcc.groundside.claims import evaluate
from ftcc.groundside.errors import UserError
from ftcc.groundside.scenario import resolve, shipped
from ftcc.groundside.simulation import Flight, NotRecordedError, columns_needed, fly_in_memory
from ftcc.groundside.simulation.columns import places_kept
from ftcc.groundside.simulation.space import recording_size


@pytest.mark.parametrize(
    "settings",
    [[], ["faults.0.at=5", "faults.0.effectiveness=0.05", "faults.0.without_trim=true"]],
    ids=["sound", "lost"],
)
def test_claims_and_verdict_need_no_other_columns(settings):
    mission = resolve(load("containment", duration=30.0, variants=["loss30"], settings=settings))
    needed = columns_needed(mission)
    whole, part = fly_in_memory(mission), fly_in_memory(mission, columns=needed)
    assert part.verdict == whole.verdict
    assert bool(whole.lost) == bool(settings)
    assert evaluate(part, mission.claims, mission.case, mission.graph) == evaluate(
        whole, mission.claims, mission.case, mission.graph
    )
    for name in needed:
        for uav in mission.uavs:
            assert part.column(name, uav).tobytes() == whole.column(name, uav).tobytes()
    assert recording_size(mission, needed)[1] < 0.6 * recording_size(mission)[1]


@pytest.mark.parametrize("scenario", shipped())
def test_no_claim_or_finding_of_any_scheme_needs_more(scenario):
    """All signals swing wildly: every finding is looked into, also whether something commands the swing."""
    mission = resolve(load(scenario))
    timing = mission.timing
    needed = columns_needed(mission)
    t = np.arange(0, timing.ticks + 1, timing.record_every) * timing.period
    swing = 30.0 * np.sin(2.0 * t)[:, None, None]
    parts = {
        part: np.broadcast_to(swing, (len(t), len(mission.uavs), len(places)))
        for part, places in places_kept(mission, needed).items()
    }
    flight = Flight(mission=mission, **parts, links=np.empty(0), t=t, lost={}, columns=needed)
    assert flight.verdict.saturated
    evaluate(flight, mission.claims, mission.case, mission.graph, timing.duration)


def test_a_column_that_was_not_recorded_says_so():
    mission = resolve(load("containment", duration=1.0))
    flight = fly_in_memory(mission, columns=["z"])
    assert len(flight.column("t", 1)) == len(flight.column("z", 1)) == 101
    assert set(flight.table()) == {"t", "uav", "x", "z"}
    with pytest.raises(NotRecordedError, match="column theta was not recorded; this flight has x, z"):
        flight.column("theta", 1)
    with pytest.raises(UserError, match="there is no column nonsense; there are x, y, z"):
        fly_in_memory(mission, columns=["nonsense"])
