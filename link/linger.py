"""Zenoh's sockets towards other computers closed at once: a computer that is gone must not hold up the others.

Zenoh sets SO_LINGER to 10 s. Where a link is given up with bytes on their way, closing its socket would block the
session's thread for so long, and with it every other link (measured, Zenoh 1.10).
"""

from __future__ import annotations

import contextlib
import os
import socket
import struct
from typing import Any

__all__ = ["close_at_once", "linger_again"]

_AT_ONCE = struct.pack("ii", 1, 0)
_FAREWELL = struct.pack("ii", 1, 1)
"""Of an orderly end: what was just sent has a second to leave."""


def close_at_once(session: Any) -> Any:
    """Keep the TCP sockets of this process from lingering, now and whenever the session has a new link.

    Returns the listener, to be undeclared at the end.
    """
    return session.info.declare_link_events_listener(lambda _: _set_linger(_AT_ONCE), history=True)


def linger_again() -> None:
    """Before an orderly end: let what was just sent leave."""
    _set_linger(_FAREWELL)


def _set_linger(value: bytes) -> None:
    """Set SO_LINGER of all TCP sockets of this process."""
    for entry in os.listdir("/proc/self/fd"):
        # A descriptor may be closed meanwhile, or be no socket.
        with contextlib.suppress(OSError):
            if os.readlink(f"/proc/self/fd/{entry}").startswith("socket:"):
                with socket.socket(fileno=os.dup(int(entry))) as link:
                    if link.type == socket.SOCK_STREAM and link.family in (socket.AF_INET, socket.AF_INET6):
                        link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, value)
