"""What ``ftcc fly`` prints of a flight: JSON lines for programs, plain lines into a pipe."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from ftcc.groundside import load, resolve
from ftcc.groundside.cli import flight_output
from ftcc.groundside.cli.flight_output import JsonOutput, TerminalOutput
from ftcc.groundside.dashboard import Event, Pace
from ftcc.groundside.scenario import Mission
from ftcc.groundside.swarm import FlightOptions, Outcome


class Clock:
    """The monotonic clock, which the test sets."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(flight_output, "time", made)
    return made


@pytest.fixture(scope="module")
def mission() -> Mission:
    return resolve(load("demo"))


def lines(capsys: pytest.CaptureFixture[str]) -> list[dict[str, Any]]:
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


def test_json_has_an_object_per_line_and_at_most_one_of_progress_a_second(
    mission: Mission, clock: Clock, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = FlightOptions(tmp_path, held=True)
    with JsonOutput(mission, options) as output:
        clock.now = 103.0
        output.started("http://127.0.0.1:9090")
        for tenth in range(21):
            clock.now = 103.0 + tenth / 10.0
            output.progress(tenth / 2.0, Pace(math.nan if tenth == 0 else 5.0, None), tenth)
        output.event(Event(-1.0, "warning", "too slow"))
        output.event(Event(4.0, "info", "elevator off", uav=3, who="255/190", outcome="acts"))
    output.end(Outcome(died=["uav3-autopilot"], late=2, ticks=800, flown=100), 2.5, 1)
    start, ready, *progress, event, commanded, end = lines(capsys)
    assert start == {
        "type": "start",
        "scenario": "demo",
        "case": "flight",
        "duration": 120.0,
        "uavs": [1, 2, 3, 4, 5, 6, 7, 8],
        "run": str(tmp_path),
    }
    assert ready == {"type": "ready", "dashboard": "http://127.0.0.1:9090", "held": True}
    assert progress == [
        {"type": "progress", "t": 0.0, "wall": 0.0, "late": 0, "factor": None},
        {"type": "progress", "t": 5.0, "wall": pytest.approx(1.0), "late": 10, "factor": 5.0},
        {"type": "progress", "t": 10.0, "wall": pytest.approx(2.0), "late": 20, "factor": 5.0},
    ]
    assert event == {"type": "event", "t": 0.0, "severity": "warning", "uav": None, "text": "too slow"}
    assert (commanded["who"], commanded["outcome"]) == ("255/190", "acts")
    # Nothing was recorded: no verdict, no claims.
    assert end == {
        "type": "end",
        "verdict": None,
        "failures": [],
        "remarks": [],
        "claims": [],
        "t": 1.0,
        "wall": 2.5,
        "late": 2,
        "ticks": 800,
        "died": ["uav3-autopilot"],
        "run": str(tmp_path),
        "exit_code": 1,
    }


def test_a_swarm_that_does_not_get_ready_ends_with_the_reason(
    mission: Mission, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with JsonOutput(mission, FlightOptions(tmp_path)) as output:
        output.not_ready("not ready after 300 s: uav1")
    assert lines(capsys)[1:] == [
        {"type": "end", "verdict": None, "error": "not ready after 300 s: uav1", "exit_code": 1}
    ]


def test_a_pipe_gets_plain_lines_and_progress_every_ten_seconds(
    mission: Mission, clock: Clock, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with TerminalOutput(mission, FlightOptions(tmp_path)) as output:
        output.started("http://127.0.0.1:9090")
        for second in range(1, 22):
            clock.now = 100.0 + second
            output.progress(2.0 * second, Pace(2.04, 2.0), 0)
        output.event(Event(42.0, "warning", "elevator off", uav=3))
    title, *rest = capsys.readouterr().out.splitlines()
    assert title.endswith(f"8 UAVs, run {tmp_path}")
    assert rest == [
        "dashboard: http://127.0.0.1:9090",
        "t = 20 s of 120 s, 2 x real time, 0 ticks late",
        "t = 40 s of 120 s, 2 x real time, 0 ticks late",
        "   42.00 s  UAV 3: elevator off",
    ]
