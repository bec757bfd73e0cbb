"""The mesh: real Zenoh peers in processes of their own."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from ftcc.link.ports import PortBlock, reserve

UAVS = (1, 2, 3)


class Process:
    """A peer's process; every call waits for its answer."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name("mesh_peer.py"))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def __call__(self, name: str, **arguments: Any) -> Any:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps([name, arguments]) + "\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        assert answer, f"the peer died of {name}; its last words are in the captured output"
        return json.loads(answer)

    def kill(self) -> None:
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            pipe.close()


@pytest.fixture
def start() -> Iterator[Callable[[], Process]]:
    processes: list[Process] = []

    def one() -> Process:
        processes.append(Process())
        return processes[-1]

    yield one
    for process in processes:
        process.kill()


@pytest.fixture
def ports(tmp_path, monkeypatch) -> Iterator[PortBlock]:
    monkeypatch.setenv("FTCC_RUNTIME_DIR", str(tmp_path))
    block = reserve(UAVS)
    yield block
    block.release()


def open_peer(peer: Process, ports: PortBlock, uav: int, **changes: Any) -> list[str]:
    """UAV 1 is heard by 2 and 3; lower ids listen, higher ones connect."""
    arguments: dict[str, Any] = {
        "swarm": "test",
        "own": uav,
        "hears": [] if uav == 1 else [1],
        "heard_by": [2, 3] if uav == 1 else [],
        "listen": ports.of(1).mesh if uav == 1 else None,
        "connect": [] if uav == 1 else [ports.of(1).mesh],
        "ordered": True,
    }
    return peer("open", **arguments | changes)


def test_ready_only_when_every_named_hearer_has_subscribed(start, ports):
    first, second, third = start(), start(), start()
    assert open_peer(first, ports, 1) == ["ftcc/test/2/hears/1", "ftcc/test/3/hears/1"]
    assert open_peer(second, ports, 2) == []
    assert not first("wait_until_ready", seconds=0.6), "UAV 3 does not listen yet"
    assert first("awaited") == ["ftcc/test/3/hears/1"]
    open_peer(third, ports, 3)
    assert first("wait_until_ready", seconds=10.0)
    first("publish", own=1, first=0, last=1)
    assert second("receive", count=1, seconds=5.0) == [[1, 0]]
    assert third("receive", count=1, seconds=5.0) == [[1, 0]]


def test_peers_may_start_in_any_order(start, ports):
    hearer, speaker = start(), start()
    open_peer(hearer, ports, 2)
    open_peer(speaker, ports, 1, heard_by=[2])
    assert speaker("wait_until_ready", seconds=10.0)
    speaker("publish", own=1, first=0, last=1)
    assert hearer("receive", count=1, seconds=5.0) == [[1, 0]]


def test_in_lockstep_every_transmission_arrives_and_in_order(start, ports):
    """Two thousand each way at once, neither peer more than four ahead of what it has heard."""
    one, two = start(), start()
    open_peer(one, ports, 1, hears=[2], heard_by=[2])
    open_peer(two, ports, 2, hears=[1], heard_by=[1])
    assert one("wait_until_ready", seconds=10.0)
    assert two("wait_until_ready", seconds=10.0)
    with ThreadPoolExecutor(2) as both:
        first = both.submit(one, "exchange", own=1, count=2000, ahead=4, seconds=60.0)
        second = both.submit(two, "exchange", own=2, count=2000, ahead=4, seconds=60.0)
        assert first.result() == [[2, n] for n in range(2000)]
        assert second.result() == [[1, n] for n in range(2000)]


def test_in_lockstep_records_wait_for_a_reader_that_is_late(start, ports):
    one, two = start(), start()
    open_peer(one, ports, 1, heard_by=[2])
    open_peer(two, ports, 2)
    assert one("wait_until_ready", seconds=10.0)
    one("publish", own=1, first=0, last=1000)
    assert two("receive", count=1000, seconds=20.0) == [[1, n] for n in range(1000)]


def test_in_real_time_the_newest_records_are_kept(start, ports):
    """A reader that was held up finds what is new, not what is old."""
    one, two = start(), start()
    open_peer(one, ports, 1, heard_by=[2], ordered=False)
    open_peer(two, ports, 2, ordered=False)
    assert one("wait_until_ready", seconds=10.0)
    one("publish", own=1, first=0, last=500)
    held = two("poll", seconds=0.3)
    assert held == [[1, n] for n in range(500 - len(held), 500)]
    assert 1 <= len(held) <= 16
    assert two("poll", seconds=0.0) == []


def test_two_swarms_never_mix(start, ports):
    """Even where a peer of one is linked to a peer of the other."""
    one, two = start(), start()
    open_peer(one, ports, 1, heard_by=[2])
    open_peer(two, ports, 2, swarm="other")
    assert not one("wait_until_ready", seconds=0.5)
    one("publish", own=1, first=0, last=3)
    assert two("receive", count=1, seconds=0.3) == []


def test_a_process_does_not_hear_whom_it_did_not_name(start, ports):
    one, two, three = start(), start(), start()
    open_peer(one, ports, 1, heard_by=[2])
    open_peer(two, ports, 2)
    open_peer(three, ports, 3, hears=[], connect=[ports.of(1).mesh], heard_by=[])
    assert one("wait_until_ready", seconds=10.0)
    three("publish", own=3, first=0, last=3)
    one("publish", own=1, first=7, last=8)
    assert two("receive", count=1, seconds=5.0) == [[1, 7]]


def test_who_waits_sleeps_until_something_arrives(start, ports):
    one, two = start(), start()
    open_peer(one, ports, 1, heard_by=[2])
    open_peer(two, ports, 2)
    assert one("wait_until_ready", seconds=10.0)
    assert two("sleep", seconds=0.05) == []
    for n in range(20):
        one("publish", own=1, first=n, last=n + 1)
        assert two("sleep", seconds=30.0) == [[1, n]]
    assert two("sleep", seconds=0.0) == [], "it is not woken up by what it has read"


def test_the_mesh_opens_no_multicast_and_nothing_beyond_loopback(start, ports):
    listening, connecting = start(), start()
    open_peer(listening, ports, 1, heard_by=[2])
    open_peer(connecting, ports, 2)
    assert listening("wait_until_ready", seconds=10.0)
    for peer in (listening, connecting):
        sockets = peer("sockets")
        assert sockets
        assert {(kind, address) for kind, address, _ in sockets} == {("TCP", "127.0.0.1")}
    assert [status for _, _, status in connecting("sockets")] == ["ESTABLISHED"], "nobody connects to it"


def test_closing_is_quick_even_with_records_unread(start, ports):
    one, two = start(), start()
    open_peer(one, ports, 1, heard_by=[2])
    open_peer(two, ports, 2)
    assert one("wait_until_ready", seconds=10.0)
    one("publish", own=1, first=0, last=400)
    assert two("close") < 2.5
    assert one("close") < 2.5
