"""Reads telemetry: what the station keeps of it is taken from the bytes of a datagram, the rest is left to pymavlink.

A hundred UAVs tell some four thousand messages a second. Those that come again and again are read here; a datagram that
holds any other, or is not perfect, is read by pymavlink as a whole. Both ways read and refuse the same.
"""

from __future__ import annotations

import math
import socket
import struct
from collections.abc import Callable, Collection, Iterator
from typing import Any, NamedTuple

from ftcc.link.codec import Codec, dialect
from ftcc.link.mavlink import LOOPBACK, STATION

__all__ = ["ARRAY", "HEARTBEAT", "Telemetry", "TelemetrySocket"]

HEARTBEAT = dialect.MAVLINK_MSG_ID_HEARTBEAT
ARRAY = dialect.MAVLINK_MSG_ID_DEBUG_FLOAT_ARRAY

_MAGIC = dialect.PROTOCOL_MARKER_V2
_HEADER = dialect.HEADER_LEN_V2
_CHECKSUM = 2
_LARGEST_DATAGRAM = 4096
_DATAGRAMS_PER_READ = 1024
"""Five times what a hundred UAVs send at once: whoever sends without end must not hold the station."""
_RECEIVE_BUFFER = 4 << 20
"""Room for what arrives while the station is busy, bytes; the kernel may grant less and drops what does not fit."""


class Telemetry(NamedTuple):
    """A message of a UAV."""

    system: int
    """MAVLink system id."""
    kind: int
    """Message id."""
    frame: bytes
    """The message as it came."""
    name: str = ""
    """Of a DEBUG_FLOAT_ARRAY."""
    stamp_us: int = 0
    """Its simulated time; 0 if it has none."""
    values: tuple[float, ...] = ()
    """Its numbers; the custom mode of a HEARTBEAT. Nothing of other messages."""


class TelemetrySocket:
    """Hears datagrams on a port of loopback, from the ports in ``sources`` alone.

    Raises
    ------
    OSError
        If the port is in use.
    """

    def __init__(self, port: int, sources: Collection[int]) -> None:
        self._sources = frozenset((LOOPBACK, source) for source in sources)
        self._codec = Codec(STATION, 1)
        self.foreign_datagrams = 0
        """Datagrams dropped because of where they came from."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
        self._socket.bind((LOOPBACK, port))

    def fileno(self) -> int:
        """For ``select``."""
        return self._socket.fileno()

    def close(self) -> None:
        """Free the port."""
        self._socket.close()

    def receive(self) -> Iterator[list[Telemetry]]:
        """What has arrived, a list a datagram; bad data and values that are not finite are dropped."""
        for _ in range(_DATAGRAMS_PER_READ):
            try:
                datagram, sender = self._socket.recvfrom(_LARGEST_DATAGRAM)
            except BlockingIOError:
                return
            if sender in self._sources:
                yield self.parse(datagram)
            else:
                self.foreign_datagrams += 1

    def parse(self, datagram: bytes) -> list[Telemetry]:
        """The messages of a datagram, in order."""
        messages = _parse_frames(datagram)
        if messages is None:
            messages = [_from_pymavlink(message) for message in self._codec.parse(datagram)]
        return messages


def _from_pymavlink(message: Any) -> Telemetry:
    """What pymavlink has read."""
    system, kind, frame = message.get_srcSystem(), message.get_msgId(), bytes(message.get_msgbuf())
    if kind == HEARTBEAT:
        return Telemetry(system, kind, frame, values=(message.custom_mode,))
    stamp = getattr(message, "time_usec", 1000 * getattr(message, "time_boot_ms", 0))
    if kind == ARRAY:
        return Telemetry(system, kind, frame, message.name, stamp, tuple(message.data))
    return Telemetry(system, kind, frame, stamp_us=stamp)


def _parse_frames(datagram: bytes) -> list[Telemetry] | None:
    """The messages of a datagram; None if it is not made of perfect frames of the `_FORMATS` ones alone."""
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
        # Zeros at the end of a payload are not sent.
        message = format_.read(datagram[at + 5], format_.kind, frame, datagram[begin:stop].ljust(format_.size, b"\0"))
        if message is None:
            return None
        messages.append(message)
        at = stop + _CHECKSUM
    return messages


class _Format(NamedTuple):
    """A message that is read here."""

    kind: int
    size: int
    """Bytes of its payload."""
    seed: bytes
    """What its checksum ends with (CRC_EXTRA)."""
    read: Callable[[int, int, bytes, bytes], Telemetry | None]
    """Of system, kind, frame and whole payload; None where a value is not finite."""


def _format(message: Any, read: Callable[[int, int, bytes, bytes], Telemetry | None]) -> tuple[int, _Format]:
    return message.id, _Format(message.id, message.unpacker.size, bytes([message.crc_extra]), read)


_STATE = struct.Struct("<I6f")
"""ATTITUDE and LOCAL_POSITION_NED."""
_HUD = struct.Struct("<4f")
"""The floats of VFR_HUD, which it begins with."""
_ARRAY = struct.Struct("<QH10s58f")


def _parse_heartbeat(system: int, kind: int, frame: bytes, payload: bytes) -> Telemetry:
    return Telemetry(system, kind, frame, values=(int.from_bytes(payload[:4], "little"),))


def _parse_state(system: int, kind: int, frame: bytes, payload: bytes) -> Telemetry | None:
    stamp, *values = _STATE.unpack(payload)
    return Telemetry(system, kind, frame, stamp_us=1000 * stamp) if math.isfinite(sum(values)) else None


def _parse_hud(system: int, kind: int, frame: bytes, payload: bytes) -> Telemetry | None:
    return Telemetry(system, kind, frame) if math.isfinite(sum(_HUD.unpack_from(payload))) else None


def _parse_unstamped(system: int, kind: int, frame: bytes, _payload: bytes) -> Telemetry:
    return Telemetry(system, kind, frame)


def _parser_with_stamp(octets: int, unit: int) -> Callable[[int, int, bytes, bytes], Telemetry]:
    """What reads whole numbers that begin with their time, of so many octets and us a unit."""

    def read(system: int, kind: int, frame: bytes, payload: bytes) -> Telemetry:
        return Telemetry(system, kind, frame, stamp_us=unit * int.from_bytes(payload[:octets], "little"))

    return read


def _parse_array(system: int, kind: int, frame: bytes, payload: bytes) -> Telemetry | None:
    stamp, _, name, *values = _ARRAY.unpack(payload)
    # The sum of float32 as float64 is finite if, and only if, all are.
    if not math.isfinite(sum(values)):
        return None
    return Telemetry(system, kind, frame, name.split(b"\0", 1)[0].decode("ascii", "replace"), stamp, tuple(values))


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
