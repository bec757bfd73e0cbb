"""Blocks of ports: two swarms side by side, and a given port that is in use."""

from __future__ import annotations

import errno
import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from ftcc.link import ports
from ftcc.link.mavlink import LOOPBACK
from ftcc.link.ports import PortBlock, PortError, reserve, runtime_folder

UAVS = (1, 2, 3, 4, 5, 6, 7, 8)


@pytest.fixture(autouse=True)
def runtime(tmp_path, monkeypatch):
    """A runtime folder of these tests alone."""
    monkeypatch.setenv("FTCC_RUNTIME_DIR", str(tmp_path))


@pytest.fixture
def blocks() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


@pytest.fixture
def apart(monkeypatch):
    """Blocks where no other test's swarm takes any: what is released stays free."""
    monkeypatch.setattr(ports, "_FIRST", 10000)
    monkeypatch.setattr(ports, "_END", 20000)


def held(stack: ExitStack, *arguments: object) -> PortBlock:
    block = reserve(*arguments)  # type: ignore[arg-type]
    stack.callback(block.release)
    return block


def all_ports(block: PortBlock) -> list[int]:
    own = [block.station, *block.viewer]
    for uav in block.uavs:
        of = block.of(uav)
        own += [of.vehicle, of.autopilot, of.ground, of.mesh]
    return own


def test_every_use_has_a_port_of_its_own_within_the_block(blocks):
    block = held(blocks, UAVS)
    every = all_ports(block)
    assert len(set(every)) == len(every) == 3 + 4 * len(UAVS)
    assert min(every) == block.base
    assert max(every) < block.base + block.size


def test_blocks_lie_below_the_ephemeral_range(blocks):
    """Above 32768 the kernel hands out ports to everybody's outgoing connections."""
    assert min(all_ports(held(blocks, UAVS))) > 1024
    assert max(all_ports(held(blocks, tuple(range(1, 201))))) < 32768


def test_two_swarms_side_by_side_share_no_port(blocks):
    first, second = held(blocks, UAVS), held(blocks, UAVS)
    assert not set(all_ports(first)) & set(all_ports(second))


def test_a_block_is_held_before_its_first_socket_opens_and_against_other_processes(blocks):
    block = held(blocks, UAVS)
    other = "from ftcc.link.ports import reserve; print(reserve((1, 2, 3, 4, 5, 6, 7, 8)).base)"
    finished = subprocess.run([sys.executable, "-c", other], capture_output=True, check=True, env=dict(os.environ))
    assert int(finished.stdout) != block.base


def test_a_released_block_is_the_first_free_one_again(apart):
    first = reserve(UAVS)
    base = first.base
    first.release()
    again = reserve(UAVS)
    assert again.base == base
    again.release()
    again.release()  # twice does no harm


@pytest.mark.parametrize("kind", [socket.SOCK_DGRAM, socket.SOCK_STREAM], ids=["UDP", "TCP"])
def test_a_given_block_with_a_port_in_use_is_refused_and_the_port_named(apart, kind):
    block = reserve(UAVS)
    base = block.base
    block.release()
    taken = block.of(3).mesh
    with socket.socket(socket.AF_INET, kind) as stranger:
        stranger.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, int(kind == socket.SOCK_STREAM))
        stranger.bind((LOOPBACK, taken))
        if kind == socket.SOCK_STREAM:
            stranger.listen()
        with pytest.raises(PortError) as refusal:
            reserve(UAVS, base)
        assert f"port {taken} is in use" in str(refusal.value)
        assert f"{base}-{base + block.size - 1} must be free" in str(refusal.value)
        assert "leave the option out" in str(refusal.value)


def test_without_a_given_port_a_block_with_a_port_in_use_is_passed_over(apart):
    first = reserve(UAVS)
    first.release()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.bind((LOOPBACK, first.of(8).vehicle))
        other = reserve(UAVS)
        other.release()
    assert other.base > first.base


def test_a_given_block_that_another_swarm_holds_is_refused(blocks):
    block = held(blocks, UAVS)
    with pytest.raises(PortError, match=f"port {block.base} is in use"):
        reserve(UAVS, block.base)


def test_a_block_that_is_held_but_not_used_yet_is_not_even_tried(apart, blocks, monkeypatch):
    """Its swarm could find a port in use at the very moment at which another one tries it."""
    first, second = (held(blocks, range(1, 9)) for _ in range(2))
    assert second.base == first.base + 100
    first.release()
    tried = []

    class Spy(socket.socket):
        def bind(self, address):
            tried.append((self.type, address[1]))
            super().bind(address)

    monkeypatch.setattr(socket, "socket", Spy)
    large = held(blocks, range(1, 41))
    assert large.base > second.base
    assert not [port for kind, port in tried if kind == socket.SOCK_DGRAM and port in all_ports(second)]
    assert [port for kind, port in tried if kind == socket.SOCK_STREAM and port in all_ports(second)] in (
        [],
        [second.base],
    )


def test_a_large_block_is_held_wherever_a_small_one_could_begin(blocks):
    """Else a small swarm could take its middle while the large one still looks at its ports one by one."""
    large = held(blocks, range(1, 41))
    for begin in range(large.base, large.base + large.size, 100):
        with pytest.raises(PortError, match=f"port {begin} is in use"):
            reserve(UAVS, begin)


@pytest.mark.parametrize("place", range(100))
def test_wherever_a_block_is_put_it_does_not_hold_a_port_that_its_swarm_opens_itself(place):
    block = PortBlock(20000 + place, tuple(range(1, 41)))
    opened = {*block.viewer, *(block.of(uav).mesh for uav in block.uavs)}
    assert not opened & set(block.guarded)
    assert set(block.guarded) <= set(range(block.base, block.base + block.size))


def test_a_given_free_block_is_taken_as_it_is(apart, blocks):
    free = reserve(UAVS)
    free.release()
    assert held(blocks, UAVS, free.base).base == free.base


def test_the_folder_of_running_swarms_is_private_to_the_user():
    assert runtime_folder().stat().st_mode & 0o077 == 0


@pytest.mark.parametrize("base", [0, -5, 65536 - 51, 1 << 64])
def test_a_block_that_is_not_among_the_ports_is_refused(base):
    with pytest.raises(PortError, match=f"port {base}: the block of 52 ports must begin from 1 to 65484"):
        reserve(UAVS, base)


def test_the_last_block_of_all_is_one(blocks):
    block = held(blocks, UAVS, 65536 - 52)
    assert block.base + block.size == 65536


def unreachable(self, address):
    raise OSError(errno.ENETUNREACH, "Network is unreachable")


def forbidden(self, address):
    raise PermissionError(errno.EACCES, "Permission denied")


def test_without_loopback_nothing_begins(monkeypatch):
    monkeypatch.setattr(socket.socket, "connect", unreachable)
    with pytest.raises(PortError, match=r"loopback \(127.0.0.1\): Network is unreachable; `ip link set lo up`"):
        reserve(UAVS)


def test_ports_of_root_are_not_said_to_be_in_use(monkeypatch):
    monkeypatch.setattr(socket.socket, "bind", forbidden)
    with pytest.raises(PortError, match="port 80: only root"):
        reserve(UAVS, 80)
