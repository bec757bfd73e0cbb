"""Receive and parse telemetry: frequent messages directly from their bytes, others with pymavlink.

A hundred UAVs send about four thousand messages per second. The frequent ones are parsed here. If a datagram holds
any other message, or a damaged frame, pymavlink parses all of it. Both parsers accept and refuse the same messages.
"""

from __future__ import annotations

import math
import socket
import struct
from collections.abc import Callable, Collection, Iterator
from typing import Any, NamedTuple

from ftcc.link.codec import Codec, dialect
from ftcc.link.mavlink import LOOPBACK, STATION

__all__ = ["ARRAY", "HEARTBEAT", "TelemetryMessage", "TelemetrySocket"]

HEARTBEAT = dialect.MAVLINK_MSG_ID_HEARTBEAT
ARRAY = dialect.MAVLINK_MSG_ID_DEBUG_FLOAT_ARRAY

_MAGIC = dialect.PROTOCOL_MARKER_V2
_HEADER = dialect.HEADER_LEN_V2
_CHECKSUM = 2
_LARGEST_DATAGRAM = 4096
_DATAGRAMS_PER_READ = 1024
"""Five times what a hundred UAVs send at once, so that a flood of datagrams cannot block the station."""
_RECEIVE_BUFFER = 4 << 20
"""Size of the receive buffer, bytes; the kernel may grant less, and drops what does not fit."""


class TelemetryMessage(NamedTuple):
    """One message of a UAV."""

    system: int
    """MAVLink system id."""
    kind: int
    """Message id."""
    frame: bytes
    """The message as received, with header and checksum."""
    name: str = ""
    """Name of a DEBUG_FLOAT_ARRAY."""
    stamp_us: int = 0
    """Simulated time, us; 0 if the message has none."""
    values: tuple[float, ...] = ()
    """Numbers of a DEBUG_FLOAT_ARRAY, or the custom mode of a HEARTBEAT; else empty."""


class TelemetrySocket:
    """Socket on a loopback port that accepts datagrams only from the ports in ``sources``.

    Raises
    ------
    OSError
        If the port is in use.
    """

    def __init__(self, port: int, sources: Collection[int]) -> None:
        self._sources = frozenset((LOOPBACK, source) for source in sources)
        self._codec = Codec(STATION, 1)
        self.foreign_datagrams = 0
        """Number of datagrams dropped because they came from other ports."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
        self._socket.bind((LOOPBACK, port))

    def fileno(self) -> int:
        """Return the descriptor for ``select``."""
        return self._socket.fileno()

    def close(self) -> None:
        """Free the port."""
        self._socket.close()

    def receive(self) -> Iterator[list[TelemetryMessage]]:
        """Yield the messages of each datagram that has arrived; drop damaged frames and non-finite values."""
        for _ in range(_DATAGRAMS_PER_READ):
            try:
                datagram, sender = self._socket.recvfrom(_LARGEST_DATAGRAM)
            except BlockingIOError:
                return
            if sender in self._sources:
                yield self.parse(datagram)
            else:
                self.foreign_datagrams += 1

    def parse(self, datagram: bytes) -> list[TelemetryMessage]:
        """Return the messages of a datagram, in order."""
        messages = _parse_frames(datagram)
        if messages is None:
            messages = [_from_pymavlink(message) for message in self._codec.parse(datagram)]
        return messages


def _from_pymavlink(message: Any) -> TelemetryMessage:
    """Convert a message that pymavlink has parsed."""
    system, kind, frame = message.get_srcSystem(), message.get_msgId(), bytes(message.get_msgbuf())
    if kind == HEARTBEAT:
        return TelemetryMessage(system, kind, frame, values=(message.custom_mode,))
    stamp = getattr(message, "time_usec", 1000 * getattr(message, "time_boot_ms", 0))
    if kind == ARRAY:
        return TelemetryMessage(system, kind, frame, message.name, stamp, tuple(message.data))
    return TelemetryMessage(system, kind, frame, stamp_us=stamp)


def _parse_frames(datagram: bytes) -> list[TelemetryMessage] | None:
    """Return the messages of a datagram; None unless it consists only of intact frames listed in `_FORMATS`."""
    messages = []
    at, end = 0, len(datagram)
    while at < end:
        begin = at + _HEADER
        if end - begin < _CHECKSUM or datagram[at] != _MAGIC or datagram[at + 2] != 0:
            return None
        stop = begin + datagram[at + 1]
        format_ = _FORMATS.get(int.from_bytes(datagram[at + 7 : begin], "little"))
        if format_ is None or stop + _CHECKSUM > end or stop - begin > format_.size:
            return None
        checksum = dialect.x25crc(datagram[at + 1 : stop] + format_.seed).crc
        if checksum != datagram[stop] | datagram[stop + 1] << 8:
            return None
        frame = datagram[at : stop + _CHECKSUM]
        # MAVLink truncates zeros at the end of a payload.
        message = format_.read(datagram[at + 5], format_.kind, frame, datagram[begin:stop].ljust(format_.size, b"\0"))
        if message is None:
            return None
        messages.append(message)
        at = stop + _CHECKSUM
    return messages


class _Format(NamedTuple):
    """How to parse one kind of message here."""

    kind: int
    size: int
    """Length of the full payload, bytes."""
    seed: bytes
    """Last byte of the checksummed data (CRC_EXTRA)."""
    read: Callable[[int, int, bytes, bytes], TelemetryMessage | None]
    """Function of system, kind, frame and full payload; returns None if a value is not finite."""


def _format(message: Any, read: Callable[[int, int, bytes, bytes], TelemetryMessage | None]) -> tuple[int, _Format]:
    return message.id, _Format(message.id, message.unpacker.size, bytes([message.crc_extra]), read)


_STATE = struct.Struct("<I6f")
"""ATTITUDE and LOCAL_POSITION_NED."""
_HUD = struct.Struct("<4f")
"""The four floats at the beginning of VFR_HUD."""
_ARRAY = struct.Struct("<QH10s58f")


def _parse_heartbeat(system: int, kind: int, frame: bytes, payload: bytes) -> TelemetryMessage:
    return TelemetryMessage(system, kind, frame, values=(int.from_bytes(payload[:4], "little"),))


def _parse_state(system: int, kind: int, frame: bytes, payload: bytes) -> TelemetryMessage | None:
    stamp, *values = _STATE.unpack(payload)
    return TelemetryMessage(system, kind, frame, stamp_us=1000 * stamp) if math.isfinite(sum(values)) else None


def _parse_hud(system: int, kind: int, frame: bytes, payload: bytes) -> TelemetryMessage | None:
    return TelemetryMessage(system, kind, frame) if math.isfinite(sum(_HUD.unpack_from(payload))) else None


def _parse_unstamped(system: int, kind: int, frame: bytes, _payload: bytes) -> TelemetryMessage:
    return TelemetryMessage(system, kind, frame)


def _parser_with_stamp(octets: int, unit: int) -> Callable[[int, int, bytes, bytes], TelemetryMessage]:
    """Return a parser of integer messages whose time comes first, in ``octets`` bytes and units of ``unit`` us."""

    def read(system: int, kind: int, frame: bytes, payload: bytes) -> TelemetryMessage:
        return TelemetryMessage(system, kind, frame, stamp_us=unit * int.from_bytes(payload[:octets], "little"))

    return read


def _parse_array(system: int, kind: int, frame: bytes, payload: bytes) -> TelemetryMessage | None:
    stamp, _, name, *values = _ARRAY.unpack(payload)
    # The sum of float32 as float64 is finite if, and only if, all are.
    if not math.isfinite(sum(values)):
        return None
    return TelemetryMessage(
        system, kind, frame, name.split(b"\0", 1)[0].decode("ascii", "replace"), stamp, tuple(values)
    )


_FORMATS = dict(
    [
        _format(dialect.MAVLink_heartbeat_message, _parse_heartbeat),
        _format(dialect.MAVLink_sys_status_message, _parse_unstamped),
        _format(dialect.MAVLink_attitude_message, _parse_state),
        _format(dialect.MAVLink_local_position_ned_message, _parse_state),
        _format(dialect.MAVLink_global_position_int_message, _parser_with_stamp(4, 1000)),
        _format(dialect.MAVLink_gps_raw_int_message, _parser_with_stamp(8, 1)),
        _format(dialect.MAVLink_vfr_hud_message, _parse_hud),
        _format(dialect.MAVLink_servo_output_raw_message, _parser_with_stamp(4, 1)),
        _format(dialect.MAVLink_debug_float_array_message, _parse_array),
    ]
)
