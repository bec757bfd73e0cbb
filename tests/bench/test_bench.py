"""What the benchmarks measure with is sound itself."""

from __future__ import annotations

import tomllib

import pytest

from ftcc.groundside.scenario.loading import load
from ftcc.groundside.scenario.mission import resolve
from ftcc.groundside.simulation import fly_in_memory
from tests.bench.flight_shares import stage_seconds
from tests.bench.stubs import KINDS, fly_stub
from tests.bench.swarms import swarm_file


@pytest.mark.parametrize("uavs", [2, 3, 8, 16, 60, 200])
def test_swarms_of_all_sizes_can_fly(uavs, tmp_path):
    mission = resolve(load(str(swarm_file(tmp_path, uavs))))
    assert len(mission.vehicles) == uavs
    assert not mission.warnings


@pytest.mark.parametrize("uavs", [2, 8, 60])
def test_swarms_fly_soundly(uavs, tmp_path):
    mission = resolve(load(str(swarm_file(tmp_path, uavs))))
    flight = fly_in_memory(mission)
    assert not flight.lost
    for spec in mission.autopilots:
        if spec.role == "follower":
            assert abs(flight.column("z", spec.uav) - flight.column("z_r", spec.uav))[500:].max() < 3.0


def test_between_two_leaders_there_are_few_followers(tmp_path):
    scenario = tomllib.loads(swarm_file(tmp_path, 200).read_text())
    leaders = {edge["from"] for edge in scenario["graph"]["edges"] if "from" in edge}
    heard_directly = [edge["to"] for edge in scenario["graph"]["edges"] if "from" in edge]
    assert leaders == set(scenario["uavs"]["leaders"])
    assert len(set(heard_directly)) == 2 * len(leaders)


@pytest.mark.parametrize("kind", KINDS)
def test_a_stub_understands_every_datagram(kind):
    result = fly_stub(kind, pairs=2, seconds=0.2)
    assert result.factor > 0.1
    assert result.pair_us > 0.0


def test_a_flight_stage_by_stage_is_the_flight():
    mission = resolve(load("containment", variants=["loss30"], duration=5.0))
    _, world = stage_seconds(mission)
    flight = fly_in_memory(mission)
    for part in ("truth", "command", "acting", "conditions", "signals", "links"):
        assert getattr(world.recording, part).tobytes() == getattr(flight, part).tobytes()
