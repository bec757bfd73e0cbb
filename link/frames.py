"""MAVLink 2 frames of the five messages of a tick, written and read by compiled code, byte for byte as pymavlink does.

Numbers, lengths, fields and checksum seeds come from pymavlink's dialect when this module is imported. This
module does not read other messages or faulty frames: the caller gives the whole datagram to pymavlink.
"""

from __future__ import annotations

import struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.link.codec import dialect
from ftcc.link.compiled import compiled, compiled_apart, fields, store

__all__ = [
    "ACTUATORS",
    "ATTITUDE",
    "ATTITUDE_TARGET",
    "LARGEST_FRAME",
    "POSITION",
    "POSITION_TARGET",
    "Layout",
    "Payload",
    "clear",
    "new_payload",
    "place",
    "read_frame",
    "write_frame",
]

_MAGIC = dialect.PROTOCOL_MARKER_V2
_HEADER = dialect.HEADER_LEN_V2
_CHECKSUM = 2
_LONGEST = 255
LARGEST_FRAME = _HEADER + _LONGEST + _CHECKSUM
"""Bytes."""


class _Header(NamedTuple):
    """The bytes with which a frame begins."""

    magic: int
    length: int
    """Of the payload, bytes."""
    incompatible: int
    """Flags that a receiver must know, such as that of a signature."""
    compatible: int
    sequence: int
    system: int
    component: int
    number_low: int
    """Message id, 24 bits."""
    number_middle: int
    number_high: int


class Layout(NamedTuple):
    """The layout of the frames of one message."""

    number: int
    """Message id."""
    length: int
    """Bytes of a payload with its extensions."""
    seed: int
    """CRC_EXTRA, with which the checksum ends."""
    first_float: int
    """Where its float fields begin, bytes."""
    floats: int
    """Number of float fields there."""
    first_extension: int
    """Where further float fields begin, bytes."""
    extensions: int
    """Number of floats there."""


def _fields(message: Any) -> list[tuple[str, str, int, int]]:
    """Name, struct code, first byte and number of values of each field in the order of the wire."""
    fields, at = [], 0
    codes = message.native_format.decode().removeprefix("<")
    for name, code, count in zip(message.ordered_fieldnames, codes, message.lengths, strict=True):
        fields.append((name, code, at, count))
        at += count * struct.calcsize(f"<{code}")
    return fields


def layout(message: Any) -> Layout:
    """The layout of a message class of the dialect.

    Raises
    ------
    ValueError
        If its floats stand in more than two places; those of a tick do not.
    """
    runs: list[list[int]] = []
    for _, code, at, count in _fields(message):
        if code == "d":
            raise ValueError(f"{message.msgname} has float64 fields")
        if code != "f":
            continue
        if runs and runs[-1][0] + 4 * runs[-1][1] == at:
            runs[-1][1] += count
        else:
            runs.append([at, count])
    if len(runs) > 2:
        raise ValueError(f"{message.msgname} has floats in {len(runs)} places")
    (first, floats), (extension, more) = [*runs, [0, 0], [0, 0]][:2]
    return Layout(message.id, message.unpacker.size, message.crc_extra, first, floats, extension, more)


def place(message: Any, field: str) -> int:
    """Index of a field in a payload that is read as numbers of the field's own size.

    Raises
    ------
    ValueError
        If the field does not begin at a multiple of its size.
    """
    for name, code, at, _ in _fields(message):
        if name == field:
            size = struct.calcsize(f"<{code}")
            if at % size:
                raise ValueError(f"{message.msgname}.{field} begins at byte {at}")
            return at // size
    raise ValueError(f"{message.msgname} has no field {field}")


ATTITUDE = layout(dialect.MAVLink_attitude_quaternion_message)
POSITION = layout(dialect.MAVLink_local_position_ned_message)
ACTUATORS = layout(dialect.MAVLink_hil_actuator_controls_message)
ATTITUDE_TARGET = layout(dialect.MAVLink_set_attitude_target_message)
POSITION_TARGET = layout(dialect.MAVLink_set_position_target_local_ned_message)

_LAYOUTS = (ATTITUDE, POSITION, ACTUATORS, ATTITUDE_TARGET, POSITION_TARGET)


class Payload(NamedTuple):
    """The payload of one message, and the same bytes as numbers. Fields stand at multiples of their size."""

    octets: NDArray[np.uint8]
    """(256,)."""
    floats: NDArray[np.float32]
    """(64,)."""
    shorts: NDArray[np.uint16]
    """(128,)."""
    words: NDArray[np.uint32]
    """(64,)."""
    longs: NDArray[np.int64]
    """(32,)."""


def new_payload() -> Payload:
    """An empty payload."""
    longs = np.zeros(32, np.int64)
    return Payload(
        octets=longs.view(np.uint8),
        floats=longs.view(np.float32),
        shorts=longs.view(np.uint16),
        words=longs.view(np.uint32),
        longs=longs,
    )


def _checksum_table() -> NDArray[np.int64]:
    """The table of MAVLink's checksum (CRC-16/MCRF4XX), by byte."""
    table = np.zeros(256, np.int64)
    for byte in range(256):
        value = byte
        for _ in range(8):
            value = value >> 1 ^ (0x8408 if value & 1 else 0)
        table[byte] = value
    return table


_TABLE = _checksum_table()


@compiled
def _checksum(data, begin, end, seed):
    """Checksum of the bytes ``begin`` to ``end`` of a frame, as its last two bytes hold it."""
    value = 0xFFFF
    for n in range(begin, end):
        value = value >> 8 ^ _TABLE[(value ^ np.int64(data[n])) & 0xFF]
    return value >> 8 ^ _TABLE[(value ^ seed) & 0xFF]


@compiled
def clear(payload):
    """Set all bytes to 0."""
    for n in range(payload.longs.shape[0]):
        payload.longs[n] = 0


@compiled
def _numbers(octets, first, count):
    """Whether ``count`` float32 from byte ``first`` on are finite: their exponents are not all ones."""
    for n in range(count):
        at = first + 4 * n
        if octets[at + 3] & 0x7F == 0x7F and octets[at + 2] & 0x80 == 0x80:
            return False
    return True


@compiled
def _finite(octets, shape):
    return _numbers(octets, shape.first_float, shape.floats) and _numbers(
        octets, shape.first_extension, shape.extensions
    )


@compiled_apart
def write_frame(payload, shape, system, component, sequence, out, at):
    """Write a message with the layout ``shape`` into the datagram ``out`` from byte ``at`` on.

    Returns where it ends; -1, and writes nothing, if a float in it is nan, infinite or was too large for float32.
    """
    if not _finite(payload.octets, shape):
        return -1
    length = shape.length
    while length > 1 and payload.octets[length - 1] == 0:
        length -= 1
    number = shape.number
    low, middle, high = number & 0xFF, number >> 8 & 0xFF, number >> 16 & 0xFF
    store(_Header(_MAGIC, length, 0, 0, sequence & 0xFF, system, component, low, middle, high), out[at:])
    end = at + _HEADER + length
    for n in range(length):
        out[at + _HEADER + n] = payload.octets[n]
    checksum = _checksum(out, at + 1, end, shape.seed)
    out[end] = checksum & 0xFF
    out[end + 1] = checksum >> 8
    return end + _CHECKSUM


@compiled_apart
def read_frame(data, at, end, payload):
    """Read the frame at byte ``at`` of a datagram of ``end`` bytes into ``payload``.

    Returns
    -------
    number, next : int
        The message id and where the next frame begins; (-1, at) unless there is a valid, unsigned frame of one of the
        five messages with finite floats.
    """
    if end - at < _HEADER + 1 + _CHECKSUM:
        return -1, at
    header = fields(_Header, data[at:])
    if header.magic != _MAGIC or header.incompatible != 0:
        return -1, at
    length = np.int64(header.length)
    stop = at + _HEADER + length
    if length == 0 or stop + _CHECKSUM > end:
        return -1, at
    number = np.int64(header.number_low) | np.int64(header.number_middle) << 8 | np.int64(header.number_high) << 16
    for shape in _LAYOUTS:
        if shape.number == number and length <= shape.length:
            checksum = _checksum(data, at + 1, stop, shape.seed)
            if data[stop] != checksum & 0xFF or data[stop + 1] != checksum >> 8:
                return -1, at
            for n in range(length):
                payload.octets[n] = data[at + _HEADER + n]
            for n in range(length, shape.length):
                payload.octets[n] = 0
            if not _finite(payload.octets, shape):
                return -1, at
            return number, stop + _CHECKSUM
    return -1, at
