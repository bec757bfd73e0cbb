"""What a vehicle and an autopilot say to each other in a tick, as one compiled loop, and nothing else.

A yardstick: no flight whose processes exchange these datagrams one by one can be faster than these loops. Therefore it
shares no code with what it measures: framing, checksum and system calls are written here once more, as plainly as
possible. Each loop is one call from Python; the C library is called from compiled code.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numba.core import types
from pymavlink.dialects.v20 import common as dialect

__all__ = ["fly_autopilot", "fly_vehicle"]

_send = types.ExternalFunction("send", types.intp(types.int32, types.voidptr, types.uintp, types.int32))
_recv = types.ExternalFunction("recv", types.intp(types.int32, types.voidptr, types.uintp, types.int32))

_ATTITUDE = dialect.MAVLink_attitude_quaternion_message
_POSITION = dialect.MAVLink_local_position_ned_message
_CONTROLS = dialect.MAVLink_hil_actuator_controls_message
# Message id, greatest length and CRC_EXTRA of each.
_ATTITUDE_ID, _ATTITUDE_LENGTH, _ATTITUDE_SEED = _ATTITUDE.id, _ATTITUDE.unpacker.size, _ATTITUDE.crc_extra
_POSITION_ID, _POSITION_LENGTH, _POSITION_SEED = _POSITION.id, _POSITION.unpacker.size, _POSITION.crc_extra
_CONTROLS_ID, _CONTROLS_LENGTH, _CONTROLS_SEED = _CONTROLS.id, _CONTROLS.unpacker.size, _CONTROLS.crc_extra

_MAGIC = dialect.PROTOCOL_MARKER_V2
_HEADER = dialect.HEADER_LEN_V2
_BUFFER = 1024
"""Bytes."""


def _checksum_table() -> np.ndarray:
    """Of X.25 as MAVLink uses it, by byte."""
    table = np.zeros(256, np.uint16)
    for byte in range(256):
        value = byte
        for _ in range(8):
            value = value >> 1 ^ (0x8408 if value & 1 else 0)
        table[byte] = value
    return table


_TABLE = _checksum_table()


@numba.njit(cache=True)
def _checksum(data, first, last, seed):
    """Over the bytes first..last-1 and the message's seed."""
    value = np.uint16(0xFFFF)
    for n in range(first, last):
        value = (value >> 8) ^ _TABLE[(value ^ data[n]) & 0xFF]
    return (value >> 8) ^ _TABLE[(value ^ np.uint16(seed)) & 0xFF]


@numba.njit(cache=True)
def _frame(out, at, payload, length, number, seed, sequence, component):
    """Write a frame at byte ``at``; where it ends."""
    while length > 1 and payload[length - 1] == 0:
        length -= 1
    out[at] = _MAGIC
    out[at + 1] = length
    out[at + 2] = 0
    out[at + 3] = 0
    out[at + 4] = sequence & 0xFF
    out[at + 5] = 1
    out[at + 6] = component
    out[at + 7] = number & 0xFF
    out[at + 8] = number >> 8 & 0xFF
    out[at + 9] = number >> 16 & 0xFF
    end = at + _HEADER + length
    for n in range(length):
        out[at + _HEADER + n] = payload[n]
    value = _checksum(out, at + 1, end, seed)
    out[end] = value & 0xFF
    out[end + 1] = value >> 8
    return end + 2


@numba.njit(cache=True)
def _parse(data, at, end, payload, number, length, seed):
    """Check the frame at byte ``at`` and copy its payload; where it ends, or -1 if it is not that message."""
    if end - at < _HEADER + 3 or data[at] != _MAGIC or data[at + 2] != 0:
        return -1
    told = np.int64(data[at + 1])
    stop = at + _HEADER + told
    if told == 0 or told > length or stop + 2 > end:
        return -1
    if np.int64(data[at + 7]) | np.int64(data[at + 8]) << 8 | np.int64(data[at + 9]) << 16 != number:
        return -1
    value = _checksum(data, at + 1, stop, seed)
    if data[stop] != value & 0xFF or data[stop + 1] != value >> 8:
        return -1
    for n in range(told):
        payload[n] = data[at + _HEADER + n]
    for n in range(told, length):
        payload[n] = 0
    return stop + 2


@numba.njit(cache=True)
def _finite(floats, first, count):
    for n in range(first, first + count):  # noqa: SIM110 (numba knows no generators in all())
        if not math.isfinite(floats[n]):
            return False
    return True


@numba.njit("int64(int32, int64)", cache=True, nogil=True)
def fly_vehicle(socket, ticks):
    """Send ``ticks`` states and wait for the command that answers each; the number of answers."""
    out, got = np.zeros(_BUFFER, np.uint8), np.zeros(_BUFFER, np.uint8)
    attitude, position, controls = np.zeros(64, np.uint8), np.zeros(64, np.uint8), np.zeros(96, np.uint8)
    turn, place, command = attitude.view(np.float32), position.view(np.float32), controls.view(np.float32)
    turn_stamp, place_stamp = attitude.view(np.uint32), position.view(np.uint32)
    answered = controls.view(np.uint64)
    for tick in range(ticks):
        for n in range(7):
            turn[1 + n] = 0.1 + 0.01 * n + command[2]
        for n in range(6):
            place[1 + n] = 100.0 + tick + n
        turn_stamp[0] = 10 * tick
        place_stamp[0] = 10 * tick
        if not (_finite(turn, 1, 7) and _finite(place, 1, 6)):
            return tick
        end = _frame(out, 0, attitude, _ATTITUDE_LENGTH, _ATTITUDE_ID, _ATTITUDE_SEED, 2 * tick, 25)
        end = _frame(out, end, position, _POSITION_LENGTH, _POSITION_ID, _POSITION_SEED, 2 * tick + 1, 25)
        _send(socket, out.ctypes.data, end, 0)
        size = _recv(socket, got.ctypes.data, _BUFFER, 0)
        if _parse(got, 0, size, controls, _CONTROLS_ID, _CONTROLS_LENGTH, _CONTROLS_SEED) < 0:
            return tick
        if answered[0] != np.uint64(10_000 * tick) or not _finite(command, 2, 16):
            return tick
    return ticks


@numba.njit("int64(int32, int64)", cache=True, nogil=True)
def fly_autopilot(socket, ticks):
    """Answer ``ticks`` states with a command each; the number of states."""
    out, got = np.zeros(_BUFFER, np.uint8), np.zeros(_BUFFER, np.uint8)
    attitude, position, controls = np.zeros(64, np.uint8), np.zeros(64, np.uint8), np.zeros(96, np.uint8)
    turn, place, command = attitude.view(np.float32), position.view(np.float32), controls.view(np.float32)
    stamp, answer = attitude.view(np.uint32), controls.view(np.uint64)
    for tick in range(ticks):
        size = _recv(socket, got.ctypes.data, _BUFFER, 0)
        at = _parse(got, 0, size, attitude, _ATTITUDE_ID, _ATTITUDE_LENGTH, _ATTITUDE_SEED)
        if at < 0 or _parse(got, at, size, position, _POSITION_ID, _POSITION_LENGTH, _POSITION_SEED) < 0:
            return tick
        if not (_finite(turn, 1, 7) and _finite(place, 1, 6)):
            return tick
        answer[0] = np.uint64(1000) * stamp[0]
        for n in range(4):
            command[2 + n] = 0.1 * turn[1 + n] + 1e-6 * place[1]
        end = _frame(out, 0, controls, _CONTROLS_LENGTH, _CONTROLS_ID, _CONTROLS_SEED, tick, 1)
        _send(socket, out.ctypes.data, end, 0)
    return ticks
