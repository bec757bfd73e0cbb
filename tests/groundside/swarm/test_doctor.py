"""What the doctor makes of a measured flight, and what a flight with processes lets it measure."""

from __future__ import annotations

import math

import pytest

from ftcc.groundside.dashboard.snapshot import Pace
from ftcc.groundside.scenario.loading import load
from ftcc.groundside.scenario.mission import resolve
from ftcc.groundside.swarm.doctor import Prediction, examine, judge_prediction, predict

LIMITED = Pace(5.0, None, "all 2 cores are busy, most with autopilots: 1.2", "--pack auto")


def flown(pace: Pace, problem: str = "") -> Prediction:
    return Prediction(pack=1, processes=16, pace=pace, memory=1.04e9, start=2.2, problem=problem)


def test_a_speed_with_room_to_spare_is_held():
    found = judge_prediction("demo", flown(LIMITED), speed=4.0)
    assert found.found == "5.0 times real time, 16 processes, 1.0 GB, ready after 2 s"
    assert found.verdict == "ok: holds --speed 4"


def test_a_speed_that_is_only_just_held_is_called_tight():
    assert judge_prediction("demo", flown(LIMITED), speed=4.8).verdict.startswith(
        "tight at --speed 4.8: all 2 cores are busy"
    )


def test_a_speed_that_is_out_of_reach_comes_with_the_limit_and_advice():
    found = judge_prediction("demo", flown(LIMITED), speed=10.0).verdict
    assert found == "too slow for --speed 10: all 2 cores are busy, most with autopilots: 1.2; --pack auto"


def test_at_unlimited_speed_the_verdict_is_the_limit():
    assert judge_prediction("demo", flown(LIMITED), speed=math.inf).verdict == f"{LIMITED.limit}; {LIMITED.advice}"


def test_a_flight_that_fails_or_is_too_short_says_so():
    assert judge_prediction("demo", flown(LIMITED, "not ready after 300 s"), 1.0).verdict == "not ready after 300 s"
    assert judge_prediction("demo", flown(Pace(math.nan, None)), 1.0).found == "too short to measure"


def test_what_has_an_ideal_exchange_is_not_flown_with_processes():
    findings = examine(resolve(load("containment", form="monograph")), 1.0)
    assert findings[-1].verdict == "flies in one process only: ftcc simulate"


def test_a_short_flight_with_processes_is_measured():
    mission = resolve(load("demo"))
    measured = predict(mission, pack=8, seconds=2.0)
    assert not measured.problem
    assert measured.processes == 2
    assert measured.pace.factor > 0.5
    assert measured.pace.limit
    assert 0.05e9 < measured.memory < 4e9


@pytest.mark.parametrize("name", ["cores", "ports", "compiled code"])
def test_the_machine_itself_is_described(name):
    findings = examine(resolve(load("containment", form="monograph")), 1.0)
    assert [finding for finding in findings if finding.what == name]
