"""What computers say to each other survives the way as JSON, and nothing else becomes a message."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from ftcc.groundside.nodes.clock import Offset, measure, with_monotonic, with_unix
from ftcc.groundside.nodes.messages import (
    Delivered,
    ForChild,
    FromChild,
    Join,
    Kill,
    Leaving,
    MessageError,
    Placed,
    Refused,
    Start,
    Welcome,
    decode,
    encode,
)
from ftcc.groundside.swarm import Exited, Part
from ftcc.link.gate import (
    Ended,
    EventReport,
    Go,
    Gone,
    Held,
    LawFailed,
    Limit,
    Lost,
    NetworkReport,
    Pace,
    Ready,
    Release,
    Stop,
)
from ftcc.link.process import MeshPlace

GATE = [
    Ready(),
    Ended(300, 2, 600),
    Lost(3, 4_000_000, "ground"),
    EventReport("warning", "wie gehabt: ä", 2, 10, "254/190", "accepted"),
    EventReport("info", "at no time"),
    LawFailed("law.py:3: division by zero", 5),
    Pace(12.5, None, math.inf),
    Limit(-1),
    Limit(None),
    Held(17),
    Go(Pace(1.0, 0, 2.0), Limit(None)),
    Gone(4),
    Stop(),
    Release(),
    NetworkReport(1, 2, 3, 4, 5, 0.1, 0.2, 0.3),
    Exited(-9, "the end"),
    Exited(None, why="its computer is gone"),
]
OURS = [
    Join("a", "demo", (1, 2), None, "ftcc-sitl 0.1", "10.0.0.2", True),
    Refused("no"),
    Welcome("demo", "demo-1", "title = 'x'", (1,), (1, 2), False, 30.0),
    Placed("a:/tmp/run", 20000, 1e-3, 2e-3),
    Start(
        parts=(Part("vehicle", (1, 2)),),
        swarm="x",
        lockstep=True,
        peer_of={1: 1, 2: 1},
        peers={1: MeshPlace("a", "10.0.0.2", 20004)},
        link_timeout=30.0,
        known_addresses=True,
        listeners=(("127.0.0.1", 14550),),
        id_offset=0,
        epoch_us=1,
    ),
    Kill(),
    Leaving("interrupted"),
    Delivered(7),
]


@pytest.mark.parametrize("message", [*GATE, *OURS], ids=lambda one: type(one).__name__)
def test_a_message_arrives_as_it_was_sent(message: Any) -> None:
    assert decode(encode(message)) == message


@pytest.mark.parametrize("message", GATE, ids=lambda one: type(one).__name__)
def test_with_the_process_that_it_belongs_to(message: Any) -> None:
    assert decode(encode(FromChild("uav1-vehicle", message))) == FromChild("uav1-vehicle", message)
    assert decode(encode(ForChild("uav1-vehicle", message))) == ForChild("uav1-vehicle", message)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\x80\x04\x95",
        b"[]",
        b"{}",
        b'{"type": "Popen", "fields": {"args": "ls"}}',
        b'{"type": "Ended", "fields": {"tick": "soon"}}',
        b'{"type": "Ended", "fields": {}}',
        b'{"type": "ForChild", "child": "x", "message": {"type": "ForChild"}}',
        json.dumps({"type": "Start", "fields": {"parts": [["vehicle", [1]]]}}).encode(),
    ],
)
def test_anything_else_is_refused(data: bytes) -> None:
    with pytest.raises(MessageError):
        decode(data)


def test_the_instant_of_a_pace_crosses_computers() -> None:
    """A monotonic clock begins anywhere: what travels is Unix time; a clock that is off by 5 s is allowed for."""
    pace, go = Pace(100.0, 3, 1.0), Go(Pace(100.0, 3, 1.0), Limit(None))
    back = with_monotonic(with_unix(pace), 0.0)
    assert isinstance(back, Pace)
    assert back.wall == pytest.approx(100.0, abs=1e-3)
    off = with_monotonic(with_unix(go), 5.0)
    assert isinstance(off, Go)
    assert off.pace.wall == pytest.approx(95.0, abs=1e-3)
    assert with_unix(Stop()) == Stop()


def test_the_shortest_round_trip_gives_the_offset(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 0
    trips = iter([(9_000_000, 1_000_000), (1_000_000, 1_000_000), (2_000_000, 30_000_000)])

    def ask(_seconds: float) -> int:
        """A clock that is 2 s ahead, over a way whose halves last differently, ns."""
        nonlocal now
        there, back = next(trips)
        now += there
        answer = now + 2_000_000_000
        now += back
        return answer

    monkeypatch.setattr("ftcc.groundside.nodes.clock.time.time_ns", lambda: now)
    offset = measure(ask, rounds=3)
    assert offset == Offset(2.0, 0.001)
    assert str(offset) == "+2000.000 ms, to within 1.000 ms"
    assert measure(lambda _: None, rounds=2) is None
