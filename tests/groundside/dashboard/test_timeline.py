"""The strip of the flight: lanes change when something does, and name it or count it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ftcc.groundside.dashboard.snapshot import Event, LinkState, Snapshot
from ftcc.groundside.dashboard.timeline import Timeline
from tests.groundside.dashboard.recorded import make, rows
from tests.groundside.dashboard.synthetic_swarm import CUT, FAULT_AT, SUBJECT, flight, snapshot

STATES = "StateChange:state"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("run") / "swarm.rrd"
    dashboard = make(path)
    for snap in flight(CUT[1] + 1.0):
        dashboard.log(snap)
    dashboard.close()
    return path


@pytest.mark.parametrize(
    ("lane", "times", "states"),
    [
        ("faults", [0.0, FAULT_AT], ["none", "UAV 1 elevator"]),
        ("links", [0.0, *CUT], ["all up", "4 \N{RIGHTWARDS ARROW} 3 cut", "all up"]),
    ],
)
def test_a_lane_changes_when_something_does(recorded: Path, lane: str, times: list[float], states: list[str]) -> None:
    found, said = rows(recorded, f"/timeline/{lane}", STATES)
    assert [one[0] for one in said] == states
    np.testing.assert_allclose(found, times, atol=0.11)


def states_of(*snapshots: Snapshot) -> dict[str, str]:
    """Of the lanes after some snapshots."""
    timeline = Timeline(SUBJECT)
    for snap in snapshots:
        timeline.draw(snap)
    return timeline._states


def test_a_command_stays_until_the_next_one() -> None:
    said = Event(1.0, "info", "leader commanded to 1080 m", 7)
    fault = Event(2.0, "warning", "elevator fault", 1)
    assert states_of(snapshot(1.0, (said,)), snapshot(2.0, (fault,)))["commands"] == "UAV 7: leader commanded to 1080 m"
    from_ground = Event(3.0, "info", "fault tolerance off", 3, who="255/190")
    assert states_of(snapshot(1.0, (said,)), snapshot(3.0, (from_ground,)))["commands"] == "UAV 3: fault tolerance off"


def test_many_are_counted_and_silent_aircraft_are_faults() -> None:
    snap = snapshot(5.0)
    cut = LinkState(age=9.0, received=1, lost=0, cut=True)
    uavs = {uav: replace(state, links=dict.fromkeys(state.links, cut)) for uav, state in snap.uavs.items()}
    uavs[2] = replace(uavs[2], t=1.0)
    states = states_of(replace(snap, uavs=uavs))
    assert states["links"] == f"{sum(len(state.links) for state in uavs.values())} links cut"
    assert states["faults"] == "UAV 2 silent"
