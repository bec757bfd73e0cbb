"""Watching a swarm: snapshots arrive complete, and no watcher delays the station."""

from __future__ import annotations

import dataclasses
import math
import socket
import statistics
import threading
import time
from collections.abc import Iterator

import pytest

from ftcc.groundside.dashboard import feed as feed_module
from ftcc.groundside.dashboard.feed import Feed, decode, encode, feed_path, watch_swarm
from ftcc.groundside.dashboard.snapshot import Event, LinkState, Pace, Snapshot
from tests.groundside.dashboard.synthetic_swarm import EVENTS, flight, snapshot


@pytest.fixture
def feed(request: pytest.FixtureRequest) -> Iterator[tuple[Feed, str]]:
    name = f"test-{request.node.name[:20]}-{time.monotonic_ns()}"
    made = Feed(name)
    yield made, name
    made.close()


def stuck(name: str) -> socket.socket:
    """A watcher that never reads."""
    link = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    link.connect(str(feed_path(name)))
    return link


def test_a_snapshot_arrives_as_it_was_sent() -> None:
    sent = snapshot(21.0, EVENTS)
    assert decode(encode(sent)) == sent


def test_the_pace_arrives_as_it_was_sent() -> None:
    pace = Pace(5.2, None, "both cores busy", "try --pack auto")
    sent = dataclasses.replace(snapshot(1.0), pace=pace)
    assert decode(encode(sent)) == sent


def test_what_is_not_known_arrives_as_not_known() -> None:
    plain = snapshot(1.0)
    state = dataclasses.replace(plain.uavs[1], truth={"z": math.nan}, links={2: LinkState(math.inf, 0, 0, False)})
    arrived = decode(encode(Snapshot(1.0, {1: state}))).uavs[1]
    assert math.isnan(arrived.truth["z"])
    assert arrived.links[2].age == math.inf


@pytest.mark.parametrize("line", [b"", b"{}\n", b"[1]\n", b'{"t": 1, "uavs": {"x": 1}, "events": []}\n'])
def test_what_is_no_snapshot_is_refused(line: bytes) -> None:
    with pytest.raises(ValueError, match=r"no snapshot|Expecting|invalid literal"):
        decode(line)


def test_nothing_is_encoded_while_nobody_watches(feed: tuple[Feed, str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(feed_module, "encode", lambda _: pytest.fail("encoded for nobody"))
    feed[0].offer(snapshot(1.0))


def test_a_watcher_that_reads_gets_everything_from_then_on(feed: tuple[Feed, str]) -> None:
    station, name = feed
    got: list[Snapshot] = []
    reader = threading.Thread(target=lambda: got.extend(watch_swarm(name)))
    link = stuck(name)  # so that the first snapshots are sent at all
    reader.start()
    sent = list(flight(5.0))
    for snap in sent:
        station.offer(snap)
        time.sleep(0.002)
    station.close()
    reader.join(5.0)
    link.close()
    assert got
    assert got == sent[-len(got) :]


def test_a_watcher_that_does_not_read_costs_nothing_and_misses_no_event(feed: tuple[Feed, str]) -> None:
    station, name = feed
    link = stuck(name)
    sent = [Event(t / 10.0, "info", f"event {t}") for t in range(2000)]
    took = []
    for event in sent:
        begun = time.perf_counter()
        station.offer(snapshot(event.t, (event,)))
        took.append(time.perf_counter() - begun)
    # A millisecond, most of it the encoding; a machine that is busy may hold up single ones.
    assert statistics.median(took) < 0.05
    arrived: list[Event] = []
    link.settimeout(0.5)
    lines = link.makefile("rb")
    while len(arrived) < len(sent):
        station.offer(snapshot(300.0))
        arrived += decode(lines.readline()).events
    assert arrived == sent
    link.close()


def test_nothing_is_encoded_for_a_watcher_that_does_not_read(
    feed: tuple[Feed, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    station, name = feed
    link = stuck(name)
    lines: list[bytes] = []

    def counted(snap: Snapshot) -> bytes:
        lines.append(encode(snap))
        return lines[-1]

    monkeypatch.setattr(feed_module, "encode", counted)
    for t in range(500):
        station.offer(snapshot(float(t)))
    room = len(lines)
    for t in range(500):
        station.offer(snapshot(float(t)))
    assert len(lines) == room < 500
    link.close()


def test_a_watcher_that_dies_is_forgotten(feed: tuple[Feed, str]) -> None:
    station, name = feed
    stuck(name).close()
    for t in range(3):
        station.offer(snapshot(float(t)))
    assert station._watchers == []


def test_a_swarm_that_is_gone_cannot_be_watched() -> None:
    with pytest.raises(OSError, match="No such file"):
        next(watch_swarm("nobody"))
