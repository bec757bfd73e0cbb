"""The ports of a run: one block per swarm, below the ephemeral range, held by a lock file while the swarm flies."""

from __future__ import annotations

import fcntl
import os
import socket
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

from ftcc.link.mavlink import LOOPBACK

__all__ = ["PortError", "PortBlock", "UavPorts", "reserve", "runtime_folder"]

_FIRST, _END = 20000, 32768
_PER_UAV = 4
_SHARED = 4


class PortError(OSError):
    """A port that was asked for is in use, or none is free."""


@dataclass(frozen=True)
class UavPorts:
    """Ports of one UAV."""

    vehicle: int
    autopilot: int
    ground: int
    mesh: int


@dataclass
class PortBlock:
    """Consecutive ports from ``base`` on."""

    base: int
    uavs: tuple[int, ...]
    lock: IO[str] | None = field(default=None, repr=False)

    @property
    def station(self) -> int:
        """Where the ground station hears all vehicles."""
        return self.base

    @property
    def viewer(self) -> tuple[int, int]:
        """Rerun's gRPC port and the port of its web page."""
        return self.base + 1, self.base + 2

    def of(self, uav: int) -> UavPorts:
        """The ports of a UAV."""
        first = self.base + _SHARED + _PER_UAV * self.uavs.index(uav)
        return UavPorts(first, first + 1, first + 2, first + 3)

    @property
    def size(self) -> int:
        return _SHARED + _PER_UAV * len(self.uavs)

    def release(self) -> None:
        """Let others have the block."""
        if self.lock is not None:
            self.lock.close()
            self.lock = None


def runtime_folder() -> Path:
    """Where running swarms are listed and locks lie; private to the user."""
    base = os.environ.get("FTCC_RUNTIME_DIR") or os.environ.get("XDG_RUNTIME_DIR")
    folder = Path(base) / "ftcc" if base else Path(tempfile.gettempdir()) / f"ftcc-{os.getuid()}"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    return folder


def _in_use(ports: Sequence[int]) -> int | None:
    for port in ports:
        for kind in (socket.SOCK_DGRAM, socket.SOCK_STREAM):
            with socket.socket(socket.AF_INET, kind) as probe:
                if kind == socket.SOCK_STREAM:
                    probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                try:
                    probe.bind((LOOPBACK, port))
                except OSError:
                    return port
    return None


def _lock(base: int) -> IO[str] | None:
    handle = (runtime_folder() / f"ports-{base}.lock").open("w")
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        handle.close()
        return None
    return handle


def reserve(uavs: Sequence[int], base: int | None = None) -> PortBlock:
    """A free block for ``uavs``: the one at ``base`` if given, else the first free one.

    Raises
    ------
    PortError
        If a port of the given block is in use (naming it), or no block is free.
    """
    size = PortBlock(0, tuple(uavs)).size
    stride = -(-size // 100) * 100
    candidates = [base] if base is not None else range(_FIRST, _END - size, stride)
    for candidate in candidates:
        block = PortBlock(candidate, tuple(uavs))
        taken = _in_use(range(candidate, candidate + size))
        if taken is None:
            block.lock = _lock(candidate)
            if block.lock is not None:
                return block
        if base is not None:
            raise PortError(
                f"port {taken or candidate} is in use; the block {candidate}-{candidate + size - 1} must be free "
                "(leave the option out to take the first free block)"
            )
    raise PortError(f"no {size} free ports in a row between {_FIRST} and {_END}")
