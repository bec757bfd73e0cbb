"""A flight that keeps some columns only: the same flight, the same claims, the same verdict."""

from __future__ import annotations

import pytest

from ftcc.groundside import load
from ftcc.groundside.claims import evaluate
from ftcc.groundside.errors import UserError
from ftcc.groundside.scenario import resolve
from ftcc.groundside.simulation import NotRecordedError, columns_needed, fly_in_memory
from ftcc.groundside.simulation.space import recording_size


@pytest.mark.parametrize(
    ("scenario", "settings"),
    [("containment", []), ("containment", ["faults.0.at=5", "faults.0.effectiveness=0.05"])],
    ids=["sound", "saturated"],
)
def test_claims_and_verdict_need_no_other_columns(scenario, settings):
    mission = resolve(load(scenario, duration=30.0, variants=["loss30"], settings=settings))
    needed = columns_needed(mission)
    whole, part = fly_in_memory(mission), fly_in_memory(mission, columns=needed)
    assert part.verdict == whole.verdict
    assert evaluate(part, mission.claims, mission.case, mission.graph) == evaluate(
        whole, mission.claims, mission.case, mission.graph
    )
    for name in needed:
        for uav in mission.uavs:
            assert part.column(name, uav).tobytes() == whole.column(name, uav).tobytes()
    assert recording_size(mission, needed)[1] < 0.6 * recording_size(mission)[1]


def test_a_column_that_was_not_recorded_says_so():
    mission = resolve(load("containment", duration=1.0))
    flight = fly_in_memory(mission, columns=["z"])
    assert len(flight.column("t", 1)) == len(flight.column("z", 1)) == 101
    assert set(flight.table()) == {"t", "uav", "x", "z"}
    with pytest.raises(NotRecordedError, match="column theta was not recorded; this flight has x, z"):
        flight.column("theta", 1)
    with pytest.raises(UserError, match="there is no column nonsense; there are x, y, z"):
        fly_in_memory(mission, columns=["nonsense"])
