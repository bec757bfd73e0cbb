"""Datagrams between two computers: MAVLink that would cross the network travels over the control plane instead.

Each process speaks to loopback alone. Where its partner is on another computer, a relay has the partner's port: an
`Entrance` takes datagrams from whoever sends them there, an `Exit` on the other side sends them on, by one socket for
each of the senders, so that answers find their way back.
"""

from __future__ import annotations

import contextlib
import selectors
import socket
import struct
import threading
from collections.abc import Callable, Mapping

from ftcc.link.addresses import Address, family_of
from ftcc.link.mavlink import LOOPBACK

__all__ = ["GROUND", "LISTENER", "PAIR", "STATION", "Relay", "route_of"]

STATION, GROUND, LISTENER, PAIR = range(4)
"""Channels: to our station; from callers to an autopilot; to ground stations; between vehicle and autopilot."""

_HEADER = struct.Struct("<BHH")
"""Channel, its number (a UAV or the index of a ground station), and whose datagram it is."""
_LARGEST = 65535
_FLOWS = 1024
"""Senders that an entrance remembers, at most: the oldest makes room."""
_LOOK = 0.5
"""Longest wait of the thread, s: so long may it take until it ends."""


def route_of(data: bytes) -> tuple[int, int] | None:
    """Return channel and number of a datagram on its way; None where it is too short to have any."""
    if len(data) < _HEADER.size:
        return None
    channel, number, _ = _HEADER.unpack_from(data)
    return channel, number


class Relay:
    """One end of the way between two computers.

    Parameters
    ----------
    send : sends bytes to the other end.
    """

    def __init__(self, send: Callable[[bytes], None]) -> None:
        self._send = send
        self._selector = selectors.DefaultSelector()
        self._entrances: dict[tuple[int, int], _Entrance] = {}
        self._exits: dict[tuple[int, int], _Exit] = {}
        self._lock = threading.Lock()
        self._ending = False
        self._thread = threading.Thread(target=self._run, name="relay", daemon=True)

    def start(self) -> None:
        """Begin to carry datagrams; from here on sockets may only be added by `deliver`."""
        self._thread.start()

    def add_entrance(self, channel: int, number: int, port: int = 0, flow_of: Mapping[int, int] | None = None) -> int:
        """Take datagrams at a port of loopback; 0: a free one. Return the port.

        ``flow_of`` says, by the sender's port, whose datagram one is; others are dropped. Without it senders are
        numbered as they come.
        """
        entrance = _Entrance(port, flow_of)
        self._entrances[channel, number] = entrance
        self._selector.register(entrance.socket, selectors.EVENT_READ, (channel, number, entrance))
        return entrance.port

    def add_exit(self, channel: int, number: int, to: Address, bound: Mapping[int, int] | None = None) -> None:
        """Send datagrams on to an address; ``bound`` gives the port from which, by whose datagram it is."""
        self._exits[channel, number] = _Exit(to, bound)

    def deliver(self, data: bytes) -> bool:
        """Send a datagram from the other end on, from any thread; False if it belongs nowhere."""
        if len(data) < _HEADER.size:
            return False
        channel, number, flow = _HEADER.unpack_from(data)
        datagram = data[_HEADER.size :]
        with self._lock:
            if self._ending:
                return True
            entrance, way_out = self._entrances.get((channel, number)), self._exits.get((channel, number))
            if entrance is not None:
                entrance.answer(flow, datagram)
            elif way_out is not None:
                link, is_new = way_out.socket_of(flow)
                if is_new:
                    self._selector.register(link, selectors.EVENT_READ, (channel, number, flow))
                # Nobody listens there, or the buffer is full: a datagram may be lost.
                with contextlib.suppress(OSError):
                    link.send(datagram)
            return entrance is not None or way_out is not None

    def _run(self) -> None:
        while not self._ending:
            for key, _ in self._selector.select(_LOOK):
                channel, number, whose = key.data
                link: socket.socket = key.fileobj  # type: ignore[assignment]
                with contextlib.suppress(OSError):
                    datagram, sender = link.recvfrom(_LARGEST)
                    flow = whose.flow_of(sender) if isinstance(whose, _Entrance) else whose
                    if flow is not None:
                        self._send(_HEADER.pack(channel, number, flow) + datagram)

    def close(self) -> None:
        """Free the ports."""
        with self._lock:
            self._ending = True
        if self._thread.is_alive():
            self._thread.join()
        self._selector.close()
        for entrance in self._entrances.values():
            entrance.socket.close()
        for way_out in self._exits.values():
            way_out.close()


class _Entrance:
    """A bound port, and those who have sent something to it."""

    def __init__(self, port: int, flow_of: Mapping[int, int] | None) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind((LOOPBACK, port))
        self.socket.setblocking(False)
        self.port: int = self.socket.getsockname()[1]
        self._fixed = flow_of
        self._flows: dict[Address, int] = {}
        self._senders: dict[int, Address] = {}
        self._next = 0

    def flow_of(self, sender: Address) -> int | None:
        """Return the number of a sender; None if nothing is expected from there."""
        if self._fixed is not None:
            known = self._fixed.get(sender[1])
            if known is not None:
                self._senders[known] = sender
            return known
        if sender not in self._flows:
            flow, self._next = self._next, (self._next + 1) % _FLOWS
            if flow in self._senders:
                del self._flows[self._senders[flow]]
            self._flows[sender], self._senders[flow] = flow, sender
        return self._flows[sender]

    def answer(self, flow: int, datagram: bytes) -> None:
        """Send a datagram to a sender."""
        if flow in self._senders:
            with contextlib.suppress(OSError):
                self.socket.sendto(datagram, self._senders[flow])


class _Exit:
    """An address, and a socket towards it for each sender at the entrance."""

    def __init__(self, to: Address, bound: Mapping[int, int] | None) -> None:
        self._to = to
        self._bound = bound
        self._sockets: dict[int, socket.socket] = {}

    def socket_of(self, flow: int) -> tuple[socket.socket, bool]:
        """Return the socket of a sender, and whether it is new."""
        if flow in self._sockets:
            return self._sockets[flow], False
        link = socket.socket(family_of(self._to[0]), socket.SOCK_DGRAM)
        link.setblocking(False)
        if self._bound is not None:
            link.bind((LOOPBACK, self._bound.get(flow, 0)))
        link.connect(self._to)
        self._sockets[flow] = link
        return link, True

    def close(self) -> None:
        """Close all sockets."""
        for link in self._sockets.values():
            link.close()
