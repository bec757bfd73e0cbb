"""Ports for what a test starts: none that the kernel gives to somebody else in between."""

from __future__ import annotations

import itertools
import os
import socket
from contextlib import closing

from ftcc.link.mavlink import LOOPBACK

# Above what Linux gives to sockets that ask for any port (up to 60999), and above the blocks of swarms; each worker of
# a run of tests has its own.
_FIRST, _EACH, _WORKERS = 61000, 500, 8
_worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
_mine = itertools.cycle(range(_FIRST + _worker % _WORKERS * _EACH, _FIRST + (_worker % _WORKERS + 1) * _EACH))


def free_port() -> int:
    """A port that nobody has bound, neither by TCP nor by UDP, and that no later call gives for long."""
    for port in itertools.islice(_mine, _EACH):
        if all(_is_free(kind, port) for kind in (socket.SOCK_STREAM, socket.SOCK_DGRAM)):
            return port
    raise OSError("no free port")


def _is_free(kind: socket.SocketKind, port: int) -> bool:
    with closing(socket.socket(socket.AF_INET, kind)) as probe:
        try:
            probe.bind((LOOPBACK, port))
        except OSError:
            return False
    return True
