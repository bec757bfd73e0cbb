"""When a flight that does not keep its pace causes a warning, and which one."""

from __future__ import annotations

import os
from dataclasses import replace

import pytest

from ftcc.groundside.swarm.pace import Setup
from ftcc.groundside.swarm.pacing import Pacing

SETUP = Setup(asked=1.0, uavs=8, pack=1, automatic=8, cores=2)
OWN = [("uav1-vehicle", os.getpid(), "vehicle")]


def warnings_of(pacing: Pacing, seconds: int, factor: float, late_share: float = 0.0) -> list[str]:
    """Looked at once a second, from the start of the flight on."""
    texts = []
    for n in range(seconds):
        t = factor * n
        ticks = round(800 * t)
        texts.append(pacing.measure(100.0 + n, t, (round(late_share * ticks), ticks), OWN, []))  # type: ignore[arg-type]
    return [text for text in texts if text]


def test_a_swarm_that_keeps_its_pace_causes_no_warning() -> None:
    pacing = Pacing(SETUP, lockstep=True)
    assert warnings_of(pacing, 20, 1.0) == []
    assert pacing.pace.factor == pytest.approx(1.0)
    assert pacing.pace.limit == ""


def test_a_swarm_in_lockstep_that_falls_short_says_so_once() -> None:
    pacing = Pacing(SETUP, lockstep=True)
    (text,) = warnings_of(pacing, 20, 0.4)
    assert text.startswith("0.4 times real time instead of 1: ")
    assert "--pack auto" in text
    assert pacing.pace.factor == pytest.approx(0.4)


def test_as_fast_as_possible_is_never_too_slow() -> None:
    pacing = Pacing(SETUP, lockstep=True)
    pacing.set_speed(float("inf"))
    assert warnings_of(pacing, 20, 0.4) == []
    assert pacing.pace.asked is None


@pytest.mark.parametrize(("share", "times"), [(0.04, 0), (0.06, 1)])
def test_the_wall_clock_says_once_that_more_than_one_tick_in_twenty_is_late(share: float, times: int) -> None:
    texts = warnings_of(Pacing(SETUP, lockstep=False), 20, 1.0, share)
    assert len(texts) == times
    assert all("6% of the ticks were late in the last 2 s" in text and "--clock lockstep" in text for text in texts)


def test_a_pause_restarts_the_measurement() -> None:
    pacing = Pacing(SETUP, lockstep=True)
    warnings_of(pacing, 4, 0.4)
    pacing.restart()
    assert pacing.pace.factor != pacing.pace.factor, "nan: not known"
    assert warnings_of(pacing, 4, 0.4) == []


def test_the_steps_of_reported_time_do_not_look_like_a_slow_computer() -> None:
    """A twentieth of real time: news of 0.1 s come every two seconds, with a delay."""
    pacing = Pacing(replace(SETUP, asked=0.05), lockstep=True)
    texts = [pacing.measure(100.0 + n, 0.1 * ((n - 1) // 2), (0, 80), OWN, []) for n in range(1, 90)]
    assert [text for text in texts if text] == []
    assert pacing.pace.factor == pytest.approx(0.05, rel=0.1)
