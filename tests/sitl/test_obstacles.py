"""What happens between leaders, obstacles and vehicles is the same with processes and in the simulation."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ftcc.groundside.scenario.loading import load
from ftcc.groundside.scenario.mission import resolve
from ftcc.groundside.simulation import simulate
from tests.sitl.conftest import Flight, events, same_flight

NEAR = (
    "detection_range=100.0",
    "obstacles=[{x=[300.0, 340.0], top=470.0}]",
    "leaders.5.over_obstacles=[900.0]",
    "leaders.6.over_obstacles=[800.0]",
    "channel.loss=0.2",
    "noise.z=0.01",
    "claims=[]",
)
"""Everything within 12 s: detection, a climb held at its limit, three followers and a leader in the zone."""


def zone_and_leader_events(folder: Path) -> set[tuple[object, ...]]:
    words = ("entered obstacle zone", "leader commanded", "held at its limit")
    found = ((event["t"], event["uav"], event["severity"], str(event["text"])) for event in events(folder))
    return {event for event in found if any(word in event[3] for word in words)}


def test_detection_climb_limit_and_entries_equal_the_simulation(fly: Callable[..., Flight], tmp_path: Path) -> None:
    settings = [word for setting in NEAR for word in ("--set", setting)]
    flight = fly("finite_time_containment", *settings, "--speed", "max", "--duration", "12", "--pack", "3")
    assert flight.wait() == 0, flight.output
    folder = tmp_path / "simulated"
    simulate(resolve(load("finite_time_containment", settings=NEAR, duration=12.0)), folder)
    assert same_flight(flight.folder, folder)
    noted = zone_and_leader_events(folder)
    assert {(uav, text) for _, uav, severity, text in noted if severity == "warning"} == {
        *((uav, f"UAV {uav} entered obstacle zone 1") for uav in (2, 3, 4, 6)),
        *((uav, "leader's climb rate held at its limit of 4.71 m/s") for uav in (5, 6)),
    }
    assert zone_and_leader_events(flight.folder) == noted
