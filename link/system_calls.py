"""The few system calls that a tick needs, for compiled code and plain Python.

A tick sends and receives datagrams without going back to Python: compiled code calls the C library itself. Each
function here is written twice, once for compiled code and once for plain Python; both call the same function of the
library. Only `wait` and `pause` wait.
"""

from __future__ import annotations

import ctypes
import socket
import time

import numpy as np

from ftcc.link.compiled import external, when_compiled

__all__ = ["READABLE", "monotonic", "pause", "receive", "send", "wait"]

READABLE = 1
"""POLLIN: what `wait` waits for."""

_DONT_WAIT = int(socket.MSG_DONTWAIT)
_MONOTONIC = int(time.CLOCK_MONOTONIC)
_NS = 1_000_000_000

_library = ctypes.CDLL(None)
_library.recv.argtypes = (ctypes.c_int, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int)
_library.recv.restype = ctypes.c_ssize_t
_library.send.argtypes = (ctypes.c_int, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int)
_library.send.restype = ctypes.c_ssize_t
_library.poll.argtypes = (ctypes.c_void_p, ctypes.c_ulong, ctypes.c_int)
_library.poll.restype = ctypes.c_int

_recv = external("recv", "intp", "int32", "voidptr", "uintp", "int32")
_send = external("send", "intp", "int32", "voidptr", "uintp", "int32")
_poll = external("poll", "int32", "voidptr", "uintp", "int32")
_clock_gettime = external("clock_gettime", "int32", "int32", "voidptr")
_nanosleep = external("nanosleep", "int32", "voidptr", "voidptr")


def receive(descriptor, buffer):
    """Read the next datagram of a socket into ``buffer``: its length, at most that of the buffer, or -1 for none.

    Also -1 where the socket only reports that an earlier datagram was refused.
    """
    return _library.recv(descriptor, buffer.ctypes.data, buffer.size, _DONT_WAIT)


@when_compiled(receive)
def _receive(descriptor, buffer):
    return _recv(descriptor, buffer.ctypes.data, buffer.size, _DONT_WAIT)


def send(descriptor, buffer, length):
    """Send the first ``length`` bytes of ``buffer`` as a datagram; one that cannot be sent is lost.

    Returns the number of bytes sent, or -1.
    """
    return _library.send(descriptor, buffer.ctypes.data, length, _DONT_WAIT)


@when_compiled(send)
def _send_compiled(descriptor, buffer, length):
    return _send(descriptor, buffer.ctypes.data, length, _DONT_WAIT)


def wait(polled, milliseconds):
    """Wait until one of several descriptors is readable, at most so many ms; the number of those that are.

    ``polled`` is an (n, 2) int32 array that the library reads as its ``struct pollfd``: descriptor, and events in the
    lower half of the second number; the library sets the upper half.
    """
    return _library.poll(polled.ctypes.data, polled.shape[0], milliseconds)


@when_compiled(wait)
def _wait(polled, milliseconds):
    return _poll(polled.ctypes.data, polled.shape[0], milliseconds)


def monotonic(room):
    """The monotonic clock, s; ``room`` is an int64 array of two for the call's own use."""
    return time.monotonic()


@when_compiled(monotonic)
def _monotonic_compiled(room):
    _clock_gettime(_MONOTONIC, room.ctypes.data)
    return room[0] + room[1] / 1e9


def pause(seconds, room):
    """Sleep; ``room`` as for `monotonic`."""
    time.sleep(seconds)


@when_compiled(pause)
def _pause(seconds, room):
    room[0], room[1] = 0, np.int64(seconds * _NS)
    _nanosleep(room.ctypes.data, room.ctypes.data)
