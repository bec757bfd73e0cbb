"""Edges over which leaders hear of their followers' health: beside the graph, and only where the swarm cooperates."""

from __future__ import annotations

import dataclasses

from ftcc.groundside.scenario.loading import load
from ftcc.groundside.scenario.mission import Mission, resolve
from ftcc.groundside.simulation import fly_in_memory

COOPERATES = ("diagnosis.on=true", "diagnosis.cooperate=true")


def mission(*settings: str, name: str = "containment", duration: float = 1.0) -> Mission:
    return resolve(load(name, settings=list(settings), duration=duration))


def test_followers_report_to_all_leaders_over_edges_without_weight():
    alone, together = mission(COOPERATES[0]), mission(*COOPERATES)
    assert together.graph == alone.graph
    for before, after in zip(alone.autopilots, together.autopilots, strict=True):
        more = after.neighbours[len(before.neighbours) :]
        assert after.neighbours[: len(before.neighbours)] == before.neighbours
        if after.role == "leader":
            assert [(one.uav, one.weight) for one in more] == [(uav, 0.0) for uav in alone.graph.followers]
            assert after.receivers == before.receivers
        else:
            assert not more
            assert set(after.receivers) == {*before.receivers, 7, 8}


def test_leaders_that_hear_each_other_still_do():
    made = {spec.uav: spec for spec in mission(*COOPERATES, name="finite_time_containment").autopilots}
    assert [(one.uav, one.weight) for one in made[5].neighbours] == [(6, 1.0), (1, 0.0), (2, 0.0), (3, 0.0), (4, 0.0)]


def test_link_events_act_on_these_edges_too():
    degraded = mission(*COOPERATES, "link_events=[{kind='degrade',uav=1,at=0.5,loss=0.5}]")
    changes = {spec.uav: spec.link_events for spec in degraded.autopilots}
    assert [change.sender for change in changes[8]] == [1]
    cut = mission(*COOPERATES, "link_events=[{kind='cut',edge=[1,7],at=0.5}]")
    assert [[change.sender for change in spec.link_events] for spec in cut.autopilots if spec.uav in (1, 7)] == [
        [7],
        [1],
    ]


def test_what_a_healthy_swarm_hears_beside_the_graph_changes_no_bit():
    settings = ("faults=[]", "disturbances=[]")
    plain, together = (fly_in_memory(mission(*settings, *more, duration=20.0)) for more in ((), COOPERATES))
    for name in plain.names:
        for uav in plain.mission.uavs:
            if name in together.names and plain.column(name, uav).size:
                assert plain.column(name, uav).tobytes() == together.column(name, uav).tobytes(), (name, uav)


def test_a_specification_says_who_cooperates():
    specs = mission(*COOPERATES).autopilots
    assert all(spec.diagnosis.cooperates for spec in specs)
    assert dataclasses.replace(specs[0].diagnosis, cooperates=False) == mission(COOPERATES[0]).autopilots[0].diagnosis
