"""The launcher's gate: ready, go, pace, hold, stop, release, and what happens when the launcher is gone."""

from __future__ import annotations

import time
from collections.abc import Iterator
from multiprocessing import Pipe
from multiprocessing.connection import Connection

import pytest

from ftcc.link.gate import (
    Ended,
    EventReport,
    Gate,
    Go,
    Gone,
    LauncherGoneError,
    Limit,
    Lost,
    Pace,
    Ready,
    Release,
    Stop,
)


@pytest.fixture
def ends() -> Iterator[tuple[Connection, Gate]]:
    launcher, process = Pipe()
    yield launcher, Gate(process)
    launcher.close()
    process.close()


@pytest.mark.parametrize(
    "message",
    [
        Ready(),
        Ended(400, 1, 400),
        Lost(3, 32_000_000, "airspeed outside the model's valid range"),
        EventReport("warning", "waits", 2),
    ],
)
def test_what_a_process_says_arrives_at_the_launcher(ends, message):
    launcher, gate = ends
    gate.report(message)
    assert launcher.recv() == message


def test_nobody_flies_before_go(ends):
    launcher, gate = ends
    gate.read()
    assert gate.pace is None
    assert not gate.open(1)
    launcher.send(Go(Pace(100.0, 0, 1.0), Limit(None)))
    gate.wait_until_go()
    assert gate.open(10**9)


def test_a_hold_is_a_limit_that_steps_move_on(ends):
    """`ftcc fly --hold`, step, resume."""
    launcher, gate = ends
    launcher.send(Go(Pace(100.0, 0, 1.0), Limit(0)))
    gate.wait_until_go()
    assert [gate.open(tick) for tick in (0, 1)] == [True, False]
    launcher.send(Limit(5))
    gate.read()
    assert [gate.open(tick) for tick in (5, 6)] == [True, False]
    launcher.send(Limit(None))
    gate.read()
    assert gate.open(6)


def test_a_new_pace_is_taken_once(ends):
    launcher, gate = ends
    launcher.send(Go(Pace(100.0, 0, 1.0), Limit(None)))
    gate.wait_until_go()
    assert gate.take_pace() == Pace(100.0, 0, 1.0)
    assert gate.take_pace() is None
    launcher.send(Pace(103.0, 300, 4.0))
    launcher.send(Pace(104.0, None, 2.0))
    gate.read()
    assert gate.take_pace() == gate.pace == Pace(104.0, None, 2.0)
    assert gate.take_pace() is None


def test_the_newest_word_counts_and_nothing_is_left_over(ends):
    launcher, gate = ends
    for message in (Go(Pace(1.0, 0, 1.0), Limit(3)), Limit(4), Limit(9), Gone(5), Gone(2), Pace(2.0, 1, 2.0)):
        launcher.send(message)
    gate.read()
    assert (gate.limit, gate.gone, gate.pace) == (9, {2, 5}, Pace(2.0, 1, 2.0))
    assert not gate.stopping
    assert not gate.released


def test_a_flight_called_off_before_go_does_not_wait_for_it(ends):
    launcher, gate = ends
    launcher.send(Stop())
    gate.wait_until_go()
    assert gate.stopping


def test_release_ends_the_wait_at_the_end(ends):
    launcher, gate = ends
    launcher.send(Release())
    gate.wait_until_released(30.0)
    assert gate.released


def test_a_release_that_never_comes_is_not_waited_for_for_ever(ends):
    _, gate = ends
    began = time.monotonic()
    gate.wait_until_released(0.1)
    assert not gate.released
    assert 0.05 < time.monotonic() - began < 5.0


def test_a_launcher_that_is_gone_ends_its_processes_wherever_they_wait(ends):
    launcher, gate = ends
    launcher.close()
    with pytest.raises(LauncherGoneError):
        gate.read()
    with pytest.raises(LauncherGoneError):
        gate.wait_until_go()
    with pytest.raises(LauncherGoneError):
        gate.wait_until_released(30.0)
    with pytest.raises(LauncherGoneError):
        gate.report(Ready())


def test_last_words_of_a_launcher_are_heard(ends):
    launcher, gate = ends
    launcher.send(Stop())
    launcher.close()
    with pytest.raises(LauncherGoneError):
        gate.read()
    assert gate.stopping
