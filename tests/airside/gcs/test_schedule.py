"""When telemetry is due, by both clocks."""

from __future__ import annotations

import itertools

import pytest

from ftcc.airside.gcs import schedule as schedules
from ftcc.airside.gcs.schedule import Schedule

TICK_US = 10_000


def sent(schedule: Schedule, speed: float, seconds: float, monkeypatch: pytest.MonkeyPatch) -> list[list[float]]:
    """Simulated times at which each stream is sent where ticks come ``speed`` times as fast as real time.

    The schedule is asked where both of its times have come, and each second, as an autopilot asks.
    """
    times: list[list[float]] = [[] for _ in schedule._rates]
    wall = 1000.0
    monkeypatch.setattr(schedules.time, "monotonic", lambda: wall)
    for tick in range(round(seconds * 1e6 / TICK_US)):
        wall += TICK_US / 1e6 / speed
        if tick % 100 == 0 or (tick * TICK_US >= schedule.next_us and wall >= schedule.next_wall):
            for n in schedule.due(tick * TICK_US):
                times[n].append(tick * TICK_US / 1e6)
    return times


def gaps(times: list[float]) -> list[float]:
    return [b - a for a, b in itertools.pairwise(times)]


@pytest.mark.parametrize("speed", [1.0, 0.5])
def test_no_faster_than_the_clock_every_rate_is_kept(speed: float, monkeypatch: pytest.MonkeyPatch) -> None:
    ten, five, none = sent(Schedule([10.0, 5.0, 0.0], [0.0, 1.0, 1.0]), speed, 20.0, monkeypatch)
    assert len(ten) == pytest.approx(200, abs=2)
    assert len(five) == pytest.approx(100, abs=2)
    assert none == []


@pytest.mark.parametrize("speed", [7.0, 13.0, 30.0, 400.0])
def test_faster_than_the_clock_a_least_rate_is_kept_in_simulated_time(
    speed: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    rates = [10.0, 5.0]
    ten, five = sent(Schedule(rates, [0.0, 1.0]), speed, 100.0, monkeypatch)
    assert max(gaps(five)) < 1.9
    assert len(five) >= 99
    # The others are sent as without.
    alone, _ = sent(Schedule(rates), speed, 100.0, monkeypatch)
    assert ten == alone


def test_without_a_least_rate_only_the_clock_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    (five,) = sent(Schedule([5.0]), 30.0, 90.0, monkeypatch)
    assert len(five) == pytest.approx(15, abs=2)
