"""The sockets of an autopilot towards ground stations: to one address, or for all that call."""

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
"""Callers remembered at a time, at most."""
_SILENCE = 10.0
"""Wall time after which a silent caller is forgotten, s."""
_QUIET = 2.5
"""Wall time after which a silent caller makes room for a new one, s: two of its HEARTBEATs are missing."""
_REFUSED = 1.5
"""Wall time for which an address counts as closed after a refused datagram, s: longer than to the next HEARTBEAT."""
_DATAGRAMS_PER_READ = 64
_LARGEST_DATAGRAM = 4096
_FULL = 1200
"""Bytes after which a further datagram begins: no network fragments so few."""

_LENIENT = (
    "SET_ATTITUDE_TARGET",
    "SET_POSITION_TARGET_LOCAL_NED",
    "SET_POSITION_TARGET_GLOBAL_INT",
    "MISSION_ITEM",
    "MISSION_ITEM_INT",
)
"""Messages in which nan means "not used"."""


class Peer:
    """A ground station or program, as one socket of one autopilot sees it."""

    def __init__(self, link: socket.socket, address: Address, connected: bool, codec: Codec) -> None:
        self.address = address
        self.heard = time.monotonic()
        """When it was last heard, wall s (monotonic)."""
        self.remembered = True
        """Whether it gets telemetry; otherwise it gets answers alone."""
        self._socket = link
        self._connected = connected
        self._codec = codec
        self._refused = float("-inf")

    @property
    def there(self) -> bool:
        """Whether it listens, as far as is known."""
        return time.monotonic() - self._refused > _REFUSED

    def refused(self) -> None:
        """Note that nobody listens there."""
        self._refused = time.monotonic()

    def answered(self) -> None:
        """Note that it was heard."""
        self.heard = time.monotonic()
        self._refused = float("-inf")

    def send(self, *messages: Any) -> None:
        """Send ``messages``, several to a datagram; a datagram that the system cannot take is lost."""
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
        With it the socket is connected: this peer gets telemetry, and the kernel drops datagrams of others. Without,
        each sender of a valid message becomes a peer for as long as it keeps sending.
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
        """Parses what arrives, and counts what it drops."""
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
        """Those that get telemetry."""
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
        """The caller at ``address``; it is not remembered where active callers take all places."""
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
        """Forget callers that have been silent for long."""
        if self._to is None:
            late = time.monotonic() - _SILENCE
            self._peers = {address: peer for address, peer in self._peers.items() if peer.heard > late}

    def close(self) -> None:
        """Free the port."""
        self._socket.close()
