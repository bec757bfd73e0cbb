"""What limits the pace of a swarm, judged from made-up loads; and a meter on real processes."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping

import pytest

from ftcc.groundside.dashboard.snapshot import Pace
from ftcc.groundside.swarm.pace import Kind, Member, PaceMeter, Sample, Setup, judge, usable_cores

STATION = Member("ground station", "ground station")
VIEWER = Member("viewer 1", "viewer")


def setup(asked: float | None = None, pack: int = 1, cores: int = 2, uavs: int = 8) -> Setup:
    return Setup(asked, uavs, pack, automatic=-(-uavs // max(1, cores // 2)), cores=cores)


def pace(flown: float, of: Mapping[Member, float], how: Setup, others: float = 0.0) -> Pace:
    """The pace of a swarm that flies ``flown`` s in 5 s while its processes and ``others`` load so many cores."""
    before = Sample(100.0, 40.0, dict.fromkeys(of, 7.0), 5000.0)
    after = Sample(
        105.0,
        40.0 + flown,
        {member: 7.0 + 5.0 * load for member, load in of.items()},
        5000.0 + 5.0 * (sum(of.values()) + others),
    )
    return judge(before, after, how)


def swarm(uavs: int, vehicle: float, autopilot: float, pack: int = 1) -> dict[Member, float]:
    """Loads of the processes of a swarm."""
    loads: dict[Member, float] = {}
    for first in range(1, uavs + 1, pack):
        name = f"uav{first}" if pack == 1 else f"uav{first}-{first + pack - 1}"
        loads[Member(f"{name}-vehicle", "vehicle")] = vehicle
        loads[Member(f"{name}-autopilot", "autopilot")] = autopilot
    return loads


def test_a_factor_that_is_held_has_no_limit():
    held = pace(4.9, swarm(8, 0.05, 0.15), setup(asked=1.0))
    assert held == Pace(pytest.approx(0.98), 1.0)


def test_news_that_come_late_do_not_look_like_a_speed_that_is_not_held():
    before = Sample(0.0, 10.0, {STATION: 0.0}, 0.0)
    assert judge(before, Sample(1.0, 10.9, {STATION: 0.1}, 0.2), setup(asked=1.0)).limit == ""
    assert judge(before, Sample(5.0, 14.5, {STATION: 0.1}, 0.2), setup(asked=1.0)).limit != ""


def test_a_full_machine_names_who_uses_most():
    full = pace(40.0, swarm(8, 0.07, 0.15) | {STATION: 0.14}, setup())
    assert full.factor == pytest.approx(8.0)
    assert full.limit == "all 2 cores are busy, most with autopilots: 1.2; vehicles 0.6, ground station 0.1"
    assert full.advice == "--pack auto"


def test_a_viewer_that_costs_much_may_be_left_out():
    shown = pace(40.0, swarm(8, 0.2, 0.6, pack=8) | {STATION: 0.3, VIEWER: 0.8}, setup(pack=8))
    assert "most with the viewer: 0.8" in shown.limit
    assert shown.advice == "--viewer none"


def test_where_nothing_is_left_to_change_the_machine_is_too_small():
    full = pace(40.0, swarm(8, 0.9, 1.0, pack=8), setup(pack=8))
    assert full.advice == "fewer UAVs, or more cores"


def test_other_programs_are_distinguished_from_the_swarm():
    crowded = pace(3.0, swarm(8, 0.02, 0.08, pack=8), setup(asked=1.0, pack=8), others=1.9)
    assert crowded.limit == "all 2 cores are busy, other programs take 1.9"
    assert "fewer other programs" in crowded.advice
    assert "--speed 0.54" in crowded.advice


def test_a_process_that_fills_a_core_alone_is_named():
    one = pace(20.0, swarm(100, 0.3, 0.98, pack=50), setup(pack=50, cores=8, uavs=100))
    assert one.limit == "uav1-50-autopilot alone fills a core (98%) while 5.4 of 8 cores idle"
    assert "--pack 25" in one.advice


def test_a_vehicle_and_an_autopilot_process_that_take_turns_are_one_core():
    turns = pace(20.0, swarm(100, 0.4, 0.57, pack=100), setup(pack=100, uavs=100))
    assert turns.limit.startswith("vehicles and autopilots of uav1-100 take turns on one core (97%)")
    assert "--pack 50" in turns.advice


def test_no_more_processes_are_advised_for_two_busy_ones_on_two_cores():
    pair = pace(500.0, swarm(8, 0.7, 0.71, pack=8), setup(pack=8))
    assert pair.limit == "processes wait for each other's messages: the swarm uses 1.4 of 2 cores"
    assert pair.advice == ""


def test_where_nobody_is_busy_messages_are_waited_for():
    waiting = pace(40.0, swarm(8, 0.02, 0.08), setup())
    assert waiting.limit == "processes wait for each other's messages: the swarm uses 0.8 of 2 cores"
    assert "--pack auto" in waiting.advice


def test_a_speed_that_is_not_held_is_answered_with_one_that_would_be():
    slow = pace(16.5, swarm(8, 0.07, 0.17), setup(asked=5.0, pack=8))
    assert slow.factor == pytest.approx(3.3)
    assert slow.advice.endswith("--speed 2.9")


def test_who_came_or_went_between_two_samples_does_not_count():
    before = Sample(0.0, 0.0, {Member("uav1-vehicle", "vehicle"): 3.0}, 10.0)
    after = Sample(1.0, 2.0, {Member("uav1-autopilot", "autopilot"): 90.0}, 10.5)
    assert judge(before, after, setup()).limit.endswith("the swarm uses 0.0 of 2 cores")


@pytest.fixture
def spinning() -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    yield process
    process.kill()
    process.wait()


def test_the_meter_sees_what_processes_use(spinning):
    meter = PaceMeter(setup(cores=1000))
    processes: list[tuple[str, int, Kind]] = [("uav1-2-vehicle", spinning.pid, "vehicle")]
    assert math.isnan(meter.measure(time.monotonic(), 0.0, processes, [], os.getpid()).factor)
    begun = time.monotonic()
    before = meter.sample(begun, 0.0, processes, [], os.getpid())
    time.sleep(1.0)
    now = time.monotonic()
    after = meter.sample(now, 3.0, processes, [], os.getpid())
    used = after.used[Member("uav1-2-vehicle", "vehicle")] - before.used[Member("uav1-2-vehicle", "vehicle")]
    assert 0.0 < used < 1.1 * (now - begun)
    assert after.busy - before.busy > 0.5 * used
    shown = meter.measure(now, 3.0, processes, [], os.getpid())
    assert 0.5 < shown.factor < 3.1


def test_a_process_that_is_gone_is_left_out(spinning):
    meter = PaceMeter(setup())
    processes: list[tuple[str, int, Kind]] = [("uav1-vehicle", spinning.pid, "vehicle")]
    assert len(meter.sample(0.0, 0.0, processes, [], os.getpid()).used) == 2
    spinning.kill()
    spinning.wait()
    assert len(meter.sample(1.0, 0.0, processes, [], os.getpid()).used) == 1


def test_after_a_restart_the_factor_is_unknown_again():
    meter = PaceMeter(setup())
    for wall in (0.0, 1.0):
        meter.measure(wall, wall, [], [], os.getpid())
    meter.restart()
    assert math.isnan(meter.measure(2.0, 2.0, [], [], os.getpid()).factor)


def test_the_factor_is_that_of_the_last_five_seconds():
    meter = PaceMeter(setup())
    for wall in range(20):
        shown = meter.measure(float(wall), wall * 1.0 if wall < 10 else 10.0 + 4.0 * (wall - 10), [], [], os.getpid())
    assert shown.factor == pytest.approx(4.0)


def test_there_is_a_core_to_fly_on():
    assert 1 <= usable_cores() <= (os.cpu_count() or 1)
