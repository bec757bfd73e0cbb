"""The door of a mesh: strangers are dropped by the kernel, and counted; those who belong to it come in."""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Iterator

import pytest

from ftcc.link.mesh_door import Door
from tests.support.ports import free_port

Listening = socket.socket


@pytest.fixture(params=["127.0.0.1", "::1", "::"])
def listening(request: pytest.FixtureRequest) -> Iterator[Listening]:
    family = socket.AF_INET6 if ":" in request.param else socket.AF_INET
    try:
        one = socket.create_server((request.param, free_port()), family=family, dualstack_ipv6=request.param == "::")
    except OSError as error:
        pytest.skip(f"{request.param}: {error.strerror}")
    with one:
        yield one


def comes_in(listening: Listening, called: str, source: str) -> bool:
    """Whether a call from an address of loopback is taken, and what it says is heard."""
    address = (called, listening.getsockname()[1])
    try:
        with socket.create_connection(address, timeout=0.3, source_address=(source, 0)) as caller:
            accepted, _ = listening.accept()
            with accepted:
                caller.sendall(b"hello")
                return accepted.recv(5) == b"hello"
    except TimeoutError:
        return False


def descriptors_of(one: socket.socket) -> list[int]:
    """This process's descriptors of a socket; what other tests left open and is closed meanwhile does not count."""
    inode = os.fstat(one.fileno()).st_ino
    found = []
    for name in os.listdir("/proc/self/fd"):
        with contextlib.suppress(FileNotFoundError):
            if os.stat(f"/proc/self/fd/{name}").st_ino == inode:
                found.append(int(name))
    return found


def test_only_named_addresses_come_in(listening):
    here = listening.getsockname()[0]
    six, four = here in ("::1", "::"), here in ("127.0.0.1", "::")
    door = Door(listening.getsockname()[1], ["10.1.2.3", "127.0.0.2", "fd00::7"])
    assert door.dropped == 0
    if four:
        assert comes_in(listening, "127.0.0.1", "127.0.0.2")
        assert not comes_in(listening, "127.0.0.1", "127.0.0.3")
    if six:
        assert not comes_in(listening, "::1", "::1")
    dropped = door.dropped
    assert dropped >= 1
    door.close()
    # The filter stays; a new one takes its place.
    again = Door(listening.getsockname()[1], ["fd00::7", "::1", "127.0.0.3"])
    if four:
        assert comes_in(listening, "127.0.0.1", "127.0.0.3")
        assert not comes_in(listening, "127.0.0.1", "127.0.0.2")
    if six:
        assert comes_in(listening, "::1", "::1")
    again.close()


def test_a_door_needs_a_listening_port_and_numeric_addresses():
    port = free_port()
    with pytest.raises(ValueError, match=f"port {port}: nothing in this process listens there"):
        Door(port, ["127.0.0.1"])
    with socket.create_server(("127.0.0.1", port)) as listening:
        with pytest.raises(ValueError, match="'host-a'"):
            Door(port, ["host-a"])
        with pytest.raises(ValueError, match="201 addresses: a door knows 200 at most"):
            Door(port, [f"10.0.{n // 200}.{n % 200}" for n in range(201)])
        Door(port, [f"10.0.0.{n}" for n in range(200)]).close()
        assert descriptors_of(listening) == [listening.fileno()]
