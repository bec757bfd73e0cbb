"""The ports of a run: one block per swarm, below the ephemeral range, held from before its processes start."""

from __future__ import annotations

import errno
import socket
from collections.abc import Sequence
from dataclasses import dataclass, field

from ftcc.link.folders import runtime_folder

__all__ = ["PortBlock", "PortError", "UavPorts", "reserve", "runtime_folder"]

_FIRST, _END = 20000, 32768
_LAST = 65535
_PER_UAV = 6
_SHARED = 4
_STRIDE = 100
"""Blocks begin at multiples of it, unless they are given."""


class PortError(OSError):
    """A requested port is in use, or none is free."""


@dataclass(frozen=True)
class UavPorts:
    """Ports of one UAV."""

    vehicle: int
    """The vehicle's, towards its autopilot."""
    autopilot: int
    """The autopilot's, towards its vehicle."""
    ground: int
    """Where the autopilot listens for ground stations that call."""
    mesh: int
    telemetry: int
    """From which the autopilot sends telemetry to our station."""
    truth: int
    """From which the vehicle sends the truth to our station."""


@dataclass
class PortBlock:
    """Consecutive ports from ``base`` on."""

    base: int
    uavs: tuple[int, ...]
    guards: tuple[socket.socket, ...] = field(default=(), repr=False)
    """Listen on the TCP ports at which a block may begin: their holder holds the block."""

    @property
    def station(self) -> int:
        """Where our ground station listens to all vehicles and autopilots."""
        return self.base

    @property
    def viewer(self) -> tuple[int, int]:
        """Rerun's gRPC port and the port of its web page."""
        return self.base + 1, self.base + 2

    def of(self, uav: int) -> UavPorts:
        """The ports of a UAV."""
        first = self.base + _SHARED + _PER_UAV * self.uavs.index(uav)
        return UavPorts(*range(first, first + _PER_UAV))

    @property
    def size(self) -> int:
        return _SHARED + _PER_UAV * len(self.uavs)

    def release(self) -> None:
        """Release the block."""
        for guard in self.guards:
            guard.close()
        self.guards = ()

    @property
    def guarded(self) -> tuple[int, ...]:
        """The ports on which it is held: its first, and every other at which one begins that is not given.

        Where a block's place is given, some of these may be TCP ports that it uses itself; they are left out.
        """
        begins = range(-(-self.base // _STRIDE) * _STRIDE, self.base + self.size, _STRIDE)
        used = {*self.viewer, *(self.of(uav).mesh for uav in self.uavs)}
        return (self.base, *(port for port in begins if port != self.base and port not in used))


def _refused(error: OSError, port: int) -> OSError | None:
    """Why a port cannot be bound, where it is not in use."""
    if error.errno == errno.EACCES:
        return PortError(f"port {port}: only root may have the ports below 1024")
    return None if error.errno == errno.EADDRINUSE else error


def _require_loopback() -> None:
    """Refuse to begin where loopback is down: sockets can be bound there, but nothing arrives."""
    from ftcc.link.mavlink import LOOPBACK

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((LOOPBACK, _FIRST))  # looks up the route, sends nothing
        except OSError as error:
            raise PortError(
                f"processes cannot speak by loopback ({LOOPBACK}): {error.strerror}; `ip link set lo up` starts it"
            ) from None


def _in_use(block: PortBlock) -> int | None:
    """A port of a held block that is in use, beside those on which it is held."""
    from ftcc.link.mavlink import LOOPBACK  # listing running swarms needs no MAVLink

    ports, held = range(block.base, block.base + block.size), block.guarded
    tcp = [port for port in ports if port not in held]
    for kind, port in (*((socket.SOCK_STREAM, port) for port in tcp), *((socket.SOCK_DGRAM, port) for port in ports)):
        with socket.socket(socket.AF_INET, kind) as probe:
            if kind == socket.SOCK_STREAM:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((LOOPBACK, port))
            except OSError as error:
                if refused := _refused(error, port):
                    raise refused from None
                return port
    return None


def _hold(block: PortBlock) -> int | None:
    """Hold a block; the port for which that is impossible, as another holds or uses it."""
    from ftcc.link.mavlink import LOOPBACK

    for port in block.guarded:
        guard = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        block.guards += (guard,)
        guard.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            guard.bind((LOOPBACK, port))
            guard.listen()
        except OSError as error:
            if refused := _refused(error, port):
                raise refused from None
            return port
    return None


def reserve(uavs: Sequence[int], base: int | None = None) -> PortBlock:
    """Reserve a free block for ``uavs``: the one at ``base`` if given, else the first free one.

    Raises
    ------
    PortError
        If a port of the given block is in use (naming it) or none, no block is free, or there is no loopback.
    """
    size = PortBlock(0, tuple(uavs)).size
    if base is not None and not 0 < base <= _LAST - size + 1:
        raise PortError(f"port {base}: the block of {size} ports must begin from 1 to {_LAST - size + 1}")
    _require_loopback()
    stride = -(-size // _STRIDE) * _STRIDE
    candidates = [base] if base is not None else range(_FIRST, _END - size, stride)
    for candidate in candidates:
        block = PortBlock(candidate, tuple(uavs))
        try:
            # Held first: a port of a block that another swarm holds, but does not use yet, is not bound even to try it.
            taken = _hold(block) or _in_use(block)
        except OSError:
            block.release()
            raise
        if taken is None:
            return block
        block.release()
        if base is not None:
            raise PortError(
                f"port {taken} is in use; the block {candidate}-{candidate + size - 1} must be free "
                "(leave the option out to take the first free block)"
            )
    raise PortError(f"no {size} free ports in a row between {_FIRST} and {_END}")
