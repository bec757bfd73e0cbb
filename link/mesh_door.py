"""Lets only the computers of a swarm call a listening mesh: the kernel drops the first packet of all others.

Zenoh takes a pause of 0.1 s after each failed handshake, so that a flood of them keeps new links waiting, and each
caller that waits holds a descriptor. A socket filter, which needs no privilege, keeps strangers from getting that far.
It looks at addresses only: whoever is on one of those computers, or can answer in its name, still meets TLS.
"""

from __future__ import annotations

import contextlib
import ctypes
import ipaddress
import os
import socket
import stat
import struct
from collections.abc import Iterable

__all__ = ["Door"]

_ATTACH = getattr(socket, "SO_ATTACH_FILTER", 26)
_MEMINFO, _DROPS, _WORDS = 55, 8, 9
"""SO_MEMINFO, and where in its words the dropped packets stand."""
_BYTE, _WORD, _SHIFT, _IF_EQUAL, _RETURN = 0x30, 0x20, 0x74, 0x15, 0x06
"""Instructions of the classic packet filter: load a byte, a word, shift right, jump if equal, return."""
_NETWORK = 0xFFF00000
"""Offset that means the beginning of the IP header."""
_WHOLE = 0xFFFFFFFF
_SOURCE = {4: 12, 6: 8}
"""By version of IP, where in its header the source's address stands."""
_MOST = 200
"""Addresses that one filter holds; the kernel takes 4096 instructions."""

Instruction = tuple[int, int, int, int]
"""Code, jump if true, jump if false, constant."""


class Door:
    """The listening sockets of this process on a port, which from here on ignore callers from other addresses.

    Parameters
    ----------
    port : TCP port on which Zenoh listens in this process.
    addresses : numeric addresses of the computers that may call.

    Raises
    ------
    ValueError
        If an address is not numeric, there are too many, or nothing listens on the port.
    """

    def __init__(self, port: int, addresses: Iterable[str]) -> None:
        known = sorted({ipaddress.ip_address(address) for address in addresses}, key=str)
        if len(known) > _MOST:
            raise ValueError(f"{len(known)} addresses: a door knows {_MOST} at most")
        self._sockets = _listening(port)
        if not self._sockets:
            raise ValueError(f"port {port}: nothing in this process listens there")
        for one in self._sockets:
            _attach(one, _program(known))

    @property
    def dropped(self) -> int:
        """Packets that were dropped so far; a caller sends its first one some times before it gives up."""
        words = (one.getsockopt(socket.SOL_SOCKET, _MEMINFO, 4 * _WORDS) for one in self._sockets)
        return sum(struct.unpack_from("I", some, 4 * _DROPS)[0] for some in words)

    def close(self) -> None:
        """Let go of the sockets; they keep their filter."""
        for one in self._sockets:
            one.close()


def _listening(port: int) -> list[socket.socket]:
    """Duplicates of this process's sockets that listen on a TCP port."""
    found = []
    for name in os.listdir("/proc/self/fd"):
        with contextlib.suppress(OSError):  # no socket, or closed in the meantime
            if stat.S_ISSOCK(os.stat(f"/proc/self/fd/{name}").st_mode):
                one = socket.socket(fileno=os.dup(int(name)))
                if _listens(one, port):
                    found.append(one)
                else:
                    one.close()
    return found


def _listens(one: socket.socket, port: int) -> bool:
    return (
        one.family in (socket.AF_INET, socket.AF_INET6)
        and one.type == socket.SOCK_STREAM
        and bool(one.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN))
        and one.getsockname()[1] == port
    )


def _program(addresses: Iterable[ipaddress.IPv4Address | ipaddress.IPv6Address]) -> list[Instruction]:
    """Take packets whole from ``addresses``, nothing of all others."""
    program: list[Instruction] = []
    for address in addresses:
        words = struct.unpack(f"!{len(address.packed) // 4}I", address.packed)
        source = _NETWORK + _SOURCE[address.version]
        version: tuple[list[Instruction], int] = ([(_BYTE, 0, 0, _NETWORK), (_SHIFT, 0, 0, 4)], address.version)
        checks = [version, *(([(_WORD, 0, 0, source + 4 * n)], word) for n, word in enumerate(words))]
        block: list[Instruction] = [(_RETURN, 0, 0, _WHOLE)]
        for load, wanted in reversed(checks):
            # What differs jumps behind the return of this address.
            block = [*load, (_IF_EQUAL, 0, len(block), wanted), *block]
        program += block
    return [*program, (_RETURN, 0, 0, 0)]


def _attach(one: socket.socket, program: list[Instruction]) -> None:
    """Give a socket a filter; sockets that it accepts inherit it."""
    code = b"".join(struct.pack("HBBI", *instruction) for instruction in program)
    held = ctypes.create_string_buffer(code, len(code))
    one.setsockopt(socket.SOL_SOCKET, _ATTACH, struct.pack("HP", len(program), ctypes.addressof(held)))
