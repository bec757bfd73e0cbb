"""The sockets by which an autopilot speaks with the ground: to one address, or with whoever calls."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from typing import Any

from ftcc.link.addresses import Address, family_of, is_loopback
from ftcc.link.codec import Codec
from ftcc.link.mavlink import LOOPBACK
from ftcc.link.signing import Signing

__all__ = ["LISTENERS", "GcsSocket", "Peer"]

LISTENERS: tuple[Address, ...] = ((LOOPBACK, 14550), (LOOPBACK, 14540))
"""Where ground stations and offboard programs listen by custom."""

_CALLERS = 32
"""Callers that are remembered at a time."""
_SILENCE = 10.0
"""Wall time after which a caller that says nothing is forgotten, s."""
_QUIET = 2.5
"""Wall time after which one makes room for a newcomer, s: it has left out two of its own HEARTBEATs."""
_REFUSED = 1.5
"""Wall time for which an address counts as deserted after a refused datagram, s: beyond the next HEARTBEAT."""
_DATAGRAMS_PER_READ = 64
_LARGEST_DATAGRAM = 4096
_FULL = 1200
"""Bytes after which a further datagram is begun: no network fragments that."""

_LENIENT = (
    "SET_ATTITUDE_TARGET",
    "SET_POSITION_TARGET_LOCAL_NED",
    "SET_POSITION_TARGET_GLOBAL_INT",
    "MISSION_ITEM",
    "MISSION_ITEM_INT",
)
"""Messages in which clients put nan where they ask for nothing."""


class Peer:
    """Somebody on the ground, as far as one autopilot's one socket is concerned."""

    def __init__(self, link: socket.socket, address: Address, connected: bool, codec: Codec) -> None:
        self.address = address
        self.heard = time.monotonic()
        """When it was last heard, wall s (monotonic)."""
        self.remembered = True
        """Whether it is spoken to unasked; else it is answered, and no more."""
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


class GcsSocket:
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
        family = family_of(LOOPBACK if to is None else to[0])
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self.codec = Codec(system, component, signing, _LENIENT)
        """Reads what comes; its counters say what was dropped."""
        self._peers: dict[Address, Peer] = {}
        here, anywhere = (LOOPBACK, "0.0.0.0") if family == socket.AF_INET else ("::1", "::")
        self._socket.bind((here if to is None or is_loopback(to[0]) else anywhere, port))
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
            except OSError:
                return  # No way there at present; the next datagram is another matter.
            messages = self.codec.parse(datagram)
            if messages:
                peer = self._to or self._peer(address)
                peer.answered()
                for message in messages:
                    yield peer, message

    def _peer(self, address: Address) -> Peer:
        """The caller at ``address``; where all places are taken by callers that talk it is not remembered."""
        if address in self._peers:
            return self._peers[address]
        self.forget_the_silent()
        caller = Peer(self._socket, address, False, Codec(*self._ids, self._signing))
        if len(self._peers) == _CALLERS:
            quietest = min(self._peers.values(), key=lambda peer: peer.heard)
            if time.monotonic() - quietest.heard < _QUIET:
                caller.remembered = False
                return caller
            del self._peers[quietest.address]
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
