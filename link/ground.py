"""The sockets by which an autopilot speaks with the ground: to one address, or with whoever calls."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from typing import Any

from ftcc.link.codec import Codec
from ftcc.link.mavlink import LOOPBACK
from ftcc.link.signing import Signing

__all__ = ["LISTENERS", "Address", "GroundSocket", "Peer"]

Address = tuple[str, int]

LISTENERS: tuple[Address, ...] = ((LOOPBACK, 14550), (LOOPBACK, 14540))
"""Where ground stations and offboard programs listen by custom."""

_GUESTS = 8
"""Callers that are remembered at a time."""
_SILENCE = 10.0
"""Wall time after which a caller that says nothing is forgotten, s."""
_REFUSED = 1.5
"""Wall time for which an address counts as deserted after a refused datagram, s: beyond the next HEARTBEAT."""
_DATAGRAMS_PER_READ = 64
_LARGEST_DATAGRAM = 4096
_FULL = 1200
"""Bytes after which a further datagram is begun: no network fragments that."""

_LENIENT = ("SET_ATTITUDE_TARGET", "SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT")
"""Targets in which clients put nan where they ask for nothing."""


class Peer:
    """Somebody on the ground, as far as one autopilot's one socket is concerned."""

    def __init__(self, link: socket.socket, address: Address, connected: bool, codec: Codec) -> None:
        self.address = address
        self.heard = time.monotonic()
        """When it was last heard, wall s (monotonic)."""
        self._socket = link
        self._connected = connected
        self._codec = codec
        self._refused = float("-inf")

    @property
    def there(self) -> bool:
        """Whether somebody listens, as far as is known."""
        return time.monotonic() - self._refused > _REFUSED

    def refused(self) -> None:
        """Nobody listens there."""
        self._refused = time.monotonic()

    def answered(self) -> None:
        """Somebody does."""
        self.heard = time.monotonic()
        self._refused = float("-inf")

    def send(self, *messages: Any) -> None:
        """Send ``messages``, several to a datagram; what the system cannot take is lost, as a datagram may be."""
        datagram = b""
        for message in messages:
            datagram += self._codec.pack(message)
            if len(datagram) > _FULL:
                self._put(datagram)
                datagram = b""
        if datagram:
            self._put(datagram)

    def _put(self, datagram: bytes) -> None:
        try:
            if self._connected:
                self._socket.send(datagram)
            else:
                self._socket.sendto(datagram, self.address)
        except ConnectionRefusedError:
            self.refused()
        except OSError:
            return  # A full buffer, or no way there at present.


class GroundSocket:
    """One UDP socket towards the ground.

    Parameters
    ----------
    system, component : int
        Ids with which messages are sent.
    port : int
        Local port; 0 lets the system choose.
    to : (host, port), optional
        With it the socket is connected: the one peer is spoken to unasked, and datagrams of others are dropped by the
        kernel. Without, whoever sends a valid message becomes a peer for as long as it goes on talking.
    signing : Signing, optional
        See `Codec`.
    """

    def __init__(
        self, system: int, component: int, port: int, to: Address | None = None, signing: Signing | None = None
    ) -> None:
        self._ids = (system, component)
        self._signing = signing
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self.codec = Codec(system, component, signing, _LENIENT)
        """Reads what comes; its counters say what was dropped."""
        self._peers: dict[Address, Peer] = {}
        loopback = to is None or to[0].startswith("127.")
        self._socket.bind((LOOPBACK if loopback else "0.0.0.0", port))
        self._to: Peer | None = None
        if to is not None:
            self._socket.connect(to)
            self._to = self._peers[to] = Peer(self._socket, to, True, self.codec)

    def fileno(self) -> int:
        """For ``select``."""
        return self._socket.fileno()

    @property
    def peers(self) -> list[Peer]:
        """Who is spoken to."""
        return list(self._peers.values())

    def receive(self) -> Iterator[tuple[Peer, Any]]:
        """The messages that have arrived, with their senders."""
        for _ in range(_DATAGRAMS_PER_READ):
            try:
                datagram, address = self._socket.recvfrom(_LARGEST_DATAGRAM)
            except BlockingIOError:
                return
            except ConnectionRefusedError:
                if self._to is not None:
                    self._to.refused()
                continue
            messages = self.codec.parse(datagram)
            if messages:
                peer = self._to or self._peer(address)
                peer.answered()
                for message in messages:
                    yield peer, message

    def _peer(self, address: Address) -> Peer:
        """The caller at ``address``; beyond the number that is remembered one is answered, but not remembered."""
        if address in self._peers:
            return self._peers[address]
        self.forget_the_silent()
        caller = Peer(self._socket, address, False, Codec(*self._ids, self._signing))
        if len(self._peers) < _GUESTS:
            self._peers[address] = caller
        return caller

    def forget_the_silent(self) -> None:
        """Callers that have not been heard for long are peers no more."""
        if self._to is None:
            late = time.monotonic() - _SILENCE
            self._peers = {address: peer for address, peer in self._peers.items() if peer.heard > late}

    def close(self) -> None:
        """Free the port."""
        self._socket.close()
