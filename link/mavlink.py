"""MAVLink 2 over connected UDP: one endpoint a socket, and the messages that vehicle and autopilot exchange."""

from __future__ import annotations

import math
import socket
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from ftcc.link.codec import Codec, dialect

__all__ = [
    "AUTOPILOT",
    "LOOPBACK",
    "NAME_LENGTH",
    "SIMULATOR",
    "STATION",
    "Endpoint",
    "as_typed",
    "dialect",
    "ending_message",
    "ends",
    "float_array",
    "status_text",
]

AUTOPILOT = dialect.MAV_COMP_ID_AUTOPILOT1
"""Component id of an autopilot."""
SIMULATOR = 25
"""Component id of a simulated vehicle (MAV_COMP_ID_USER1)."""
STATION = 254
"""System id of the ground station; other clients use 245 and 255."""
_TEXT = 50
"""Characters of a STATUSTEXT, at most."""
_ARRAY = 58
"""Numbers of a DEBUG_FLOAT_ARRAY."""
NAME_LENGTH = 16
"""Characters of a parameter's name, at most."""
LOOPBACK = "127.0.0.1"

_DATAGRAMS_PER_READ = 64
_LARGEST_DATAGRAM = 4096
_LARGEST = 3.4e38
"""Largest magnitude that float32 holds, rounded down."""


class Endpoint:
    """One UDP socket that speaks MAVLink 2.

    Parameters
    ----------
    system, component : int
        Ids with which messages are sent.
    port : int
        Local port; 0 lets the system choose.
    peer : (host, port), optional
        With a peer the socket is connected, and the kernel drops datagrams of others. Without, it only receives.
    only : collection of int, optional
        Ports on loopback from which datagrams are read; others are dropped and counted.
    host : str
        Local address; loopback by default.
    """

    def __init__(
        self,
        system: int,
        component: int,
        port: int,
        peer: tuple[str, int] | None = None,
        only: Collection[int] | None = None,
        host: str = LOOPBACK,
    ) -> None:
        self.system, self.component = system, component
        self.codec = Codec(system, component)
        self.sequence = np.zeros(1, np.int64)
        """(1,): sequence number of the next message; shared with compiled code that sends by this socket."""
        self._only = frozenset((LOOPBACK, port) for port in only) if only is not None else None
        self.strangers = 0
        """Datagrams dropped because of their sender."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.bind((host, port))
        if peer is not None:
            self._socket.connect(peer)

    def fileno(self) -> int:
        """For ``select``."""
        return self._socket.fileno()

    def close(self) -> None:
        """Free the port."""
        self._socket.close()

    def enlarge_buffer(self) -> None:
        """Enlarge the receive buffer for many senders: the kernel drops what does not fit."""
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)

    def send(self, *messages: Any) -> None:
        """Send ``messages`` in one datagram.

        Raises
        ------
        ValueError
            If a float in one of them is nan, inf or beyond float32: such a value would be believed on the other side.
        """
        datagram = self.pack(*messages)
        try:
            self._socket.send(datagram)
        except ConnectionRefusedError:
            return  # The peer is not there (yet, or any more): there will be no answer.
        except OSError:
            return  # The buffer is full, or there is no route at present: the datagram is lost.

    def pack(self, *messages: Any) -> bytes:
        """``messages`` as one datagram, with the next sequence numbers.

        Raises
        ------
        ValueError
            As `send`.
        """
        datagram = self.codec.pack(*messages, sequence=int(self.sequence[0]))
        self.sequence[0] = (int(self.sequence[0]) + len(messages)) % 256
        return datagram

    def receive(self, datagrams: int = _DATAGRAMS_PER_READ) -> list[Any]:
        """The messages of the next ``datagrams``, in order; bad data and non-finite values are dropped and counted."""
        messages: list[Any] = []
        for _ in range(datagrams):
            try:
                datagram, sender = self._socket.recvfrom(_LARGEST_DATAGRAM)
            except BlockingIOError:
                break
            except ConnectionRefusedError:
                continue
            except OSError:
                break  # No route at present: there will be no answer.
            if self._only is not None and sender not in self._only:
                self.strangers += 1
                continue
            messages += self.codec.parse(datagram)
        return messages


def ending_message() -> Any:
    """The HEARTBEAT by which vehicle and autopilot report to each other that their UAV is lost."""
    return dialect.MAVLink_heartbeat_message(
        dialect.MAV_TYPE_FIXED_WING,
        dialect.MAV_AUTOPILOT_INVALID,
        0,
        0,
        dialect.MAV_STATE_FLIGHT_TERMINATION,
        3,
    )


def ends(message: Any) -> bool:
    """Whether this is an `ending_message`."""
    return bool(message.get_type() == "HEARTBEAT" and message.system_status == dialect.MAV_STATE_FLIGHT_TERMINATION)


def float_array(stamp_us: int, name: str, values: Sequence[float]) -> Any:
    """Up to 58 numbers as a DEBUG_FLOAT_ARRAY; nan, infinite and too large ones are sent as 0."""
    data = [value if abs(value) < _LARGEST else 0.0 for value in values]
    return dialect.MAVLink_debug_float_array_message(stamp_us, name.encode(), 0, data + [0.0] * (_ARRAY - len(data)))


def as_typed(value: float) -> float:
    """The shortest decimal number that float32 stores as ``value``: 0.7 for what arrives as 0.699999988."""
    return float(str(np.float32(value))) if math.isfinite(value) else value


def status_text(severity: int, text: str) -> Any:
    """A STATUSTEXT, cut to the 50 characters that it holds; nothing is left open at its end."""
    return dialect.MAVLink_statustext_message(severity, text.encode("ascii", "replace")[:_TEXT].rstrip(b" (,;"))
