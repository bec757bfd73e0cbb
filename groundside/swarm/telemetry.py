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

__all__ = ["ARRAY", "HEARTBEAT", "Ear", "TelemetryMessage"]

HEARTBEAT = dialect.MAVLINK_MSG_ID_HEARTBEAT
ARRAY = dialect.MAVLINK_MSG_ID_DEBUG_FLOAT_ARRAY

_MAGIC = dialect.PROTOCOL_MARKER_V2
_HEADER = dialect.HEADER_LEN_V2
_CHECKSUM = 2
_LARGEST_DATAGRAM = 4096
_DATAGRAMS_PER_READ = 1024
"""Five times what a hundred UAVs send at once: whoever sends without end must not hold the station."""
_BUFFER = 4 << 20
"""Room for what arrives while the station is busy, bytes; the kernel may grant less and drops what does not fit."""


class TelemetryMessage(NamedTuple):
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


class Ear:
    """Hears datagrams on a port of loopback, from the ports in ``sources`` alone.

    Raises
    ------
    OSError
        If the port is in use.
    """

    def __init__(self, port: int, sources: Collection[int]) -> None:
        self._sources = frozenset((LOOPBACK, source) for source in sources)
        self._codec = Codec(STATION, 1)
        self.strangers = 0
        """Datagrams dropped because of where they came from."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
        self._socket.bind((LOOPBACK, port))

    def fileno(self) -> int:
        """For ``select``."""
        return self._socket.fileno()

    def close(self) -> None:
        """Free the port."""
        self._socket.close()

    def hear(self) -> Iterator[list[TelemetryMessage]]:
        """What has arrived, a list a datagram; bad data and values that are not finite are dropped."""
        for _ in range(_DATAGRAMS_PER_READ):
            try:
                datagram, sender = self._socket.recvfrom(_LARGEST_DATAGRAM)
            except BlockingIOError:
                return
            if sender in self._sources:
                yield self.read(datagram)
            else:
                self.strangers += 1

    def read(self, datagram: bytes) -> list[TelemetryMessage]:
        """The messages of a datagram, in order."""
        told = _read(datagram)
        if told is None:
            told = [_message_of(message) for message in self._codec.parse(datagram)]
        return told


def _message_of(message: Any) -> TelemetryMessage:
    """What pymavlink has read."""
    system, kind, frame = message.get_srcSystem(), message.get_msgId(), bytes(message.get_msgbuf())
    if kind == HEARTBEAT:
        return TelemetryMessage(system, kind, frame, values=(message.custom_mode,))
    stamp = getattr(message, "time_usec", 1000 * getattr(message, "time_boot_ms", 0))
    if kind == ARRAY:
        return TelemetryMessage(system, kind, frame, message.name, stamp, tuple(message.data))
    return TelemetryMessage(system, kind, frame, stamp_us=stamp)


def _read(datagram: bytes) -> list[TelemetryMessage] | None:
    """The messages of a datagram; None if it is not made of perfect frames of the `_KNOWN` ones alone."""
    told = []
    at, end = 0, len(datagram)
    while at < end:
        begin = at + _HEADER
        if end - begin < _CHECKSUM or datagram[at] != _MAGIC or datagram[at + 2] != 0:
            return None
        stop = begin + datagram[at + 1]
        known = _KNOWN.get(int.from_bytes(datagram[at + 7 : begin], "little"))
        if known is None or stop + _CHECKSUM > end or stop - begin > known.size:
            return None
        checksum = dialect.x25crc(datagram[at + 1 : stop] + known.seed).crc
        if checksum != datagram[stop] | datagram[stop + 1] << 8:
            return None
        frame = datagram[at : stop + _CHECKSUM]
        # Zeros at the end of a payload are not sent.
        one = known.read(datagram[at + 5], known.kind, frame, datagram[begin:stop].ljust(known.size, b"\0"))
        if one is None:
            return None
        told.append(one)
        at = stop + _CHECKSUM
    return told


class _Known(NamedTuple):
    """A message that is read here."""

    kind: int
    size: int
    """Bytes of its payload."""
    seed: bytes
    """What its checksum ends with (CRC_EXTRA)."""
    read: Callable[[int, int, bytes, bytes], TelemetryMessage | None]
    """Of system, kind, frame and whole payload; None where a value is not finite."""


def _known(message: Any, read: Callable[[int, int, bytes, bytes], TelemetryMessage | None]) -> tuple[int, _Known]:
    return message.id, _Known(message.id, message.unpacker.size, bytes([message.crc_extra]), read)


_STATE = struct.Struct("<I6f")
"""ATTITUDE and LOCAL_POSITION_NED."""
_HUD = struct.Struct("<4f")
"""The floats of VFR_HUD, which it begins with."""
_ARRAY = struct.Struct("<QH10s58f")


def _heartbeat(system: int, kind: int, frame: bytes, payload: bytes) -> TelemetryMessage:
    return TelemetryMessage(system, kind, frame, values=(int.from_bytes(payload[:4], "little"),))


def _state(system: int, kind: int, frame: bytes, payload: bytes) -> TelemetryMessage | None:
    stamp, *values = _STATE.unpack(payload)
    return TelemetryMessage(system, kind, frame, stamp_us=1000 * stamp) if math.isfinite(sum(values)) else None


def _hud(system: int, kind: int, frame: bytes, payload: bytes) -> TelemetryMessage | None:
    return TelemetryMessage(system, kind, frame) if math.isfinite(sum(_HUD.unpack_from(payload))) else None


def _unstamped(system: int, kind: int, frame: bytes, _payload: bytes) -> TelemetryMessage:
    return TelemetryMessage(system, kind, frame)


def _with_stamp(octets: int, unit: int) -> Callable[[int, int, bytes, bytes], TelemetryMessage]:
    """What reads whole numbers that begin with their time, of so many octets and us a unit."""

    def read(system: int, kind: int, frame: bytes, payload: bytes) -> TelemetryMessage:
        return TelemetryMessage(system, kind, frame, stamp_us=unit * int.from_bytes(payload[:octets], "little"))

    return read


def _array(system: int, kind: int, frame: bytes, payload: bytes) -> TelemetryMessage | None:
    stamp, _, name, *values = _ARRAY.unpack(payload)
    # The sum of float32 as float64 is finite if, and only if, all are.
    if not math.isfinite(sum(values)):
        return None
    return TelemetryMessage(
        system, kind, frame, name.split(b"\0", 1)[0].decode("ascii", "replace"), stamp, tuple(values)
    )


_KNOWN = dict(
    [
        _known(dialect.MAVLink_heartbeat_message, _heartbeat),
        _known(dialect.MAVLink_sys_status_message, _unstamped),
        _known(dialect.MAVLink_attitude_message, _state),
        _known(dialect.MAVLink_local_position_ned_message, _state),
        _known(dialect.MAVLink_global_position_int_message, _with_stamp(4, 1000)),
        _known(dialect.MAVLink_gps_raw_int_message, _with_stamp(8, 1)),
        _known(dialect.MAVLink_vfr_hud_message, _hud),
        _known(dialect.MAVLink_servo_output_raw_message, _with_stamp(4, 1)),
        _known(dialect.MAVLink_debug_float_array_message, _array),
    ]
)
