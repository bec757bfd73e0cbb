"""A command as it comes, by COMMAND_LONG or COMMAND_INT, and what it is answered."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from ftcc.link.gcs_sockets import Peer
from ftcc.link.mavlink import dialect

__all__ = ["ACCEPTED", "BUSY", "DENIED", "UNSUPPORTED", "Answer", "Request", "degrees_of", "read_request", "whole"]

ACCEPTED = dialect.MAV_RESULT_ACCEPTED
DENIED = dialect.MAV_RESULT_DENIED
BUSY = dialect.MAV_RESULT_TEMPORARILY_REJECTED
UNSUPPORTED = dialect.MAV_RESULT_UNSUPPORTED

_NOT_GIVEN = 2**31 - 1
"""What an integer latitude or longitude holds that is not given."""


class Request(NamedTuple):
    """A command."""

    command: int
    parameters: tuple[float, ...]
    """Seven; nan = not given. Latitude and longitude in degrees."""
    frame: int | None
    """MAV_FRAME of a COMMAND_INT."""
    system: int
    component: int
    """Of the sender."""
    peer: Peer

    @property
    def who(self) -> str:
        """The sender, for the log."""
        return f"{self.system}/{self.component}"


class Answer(NamedTuple):
    """What becomes of a command: COMMAND_ACK, and what goes with it."""

    result: int
    text: str = ""
    """Why, for people: sent as STATUSTEXT where the result is not good."""
    event: str = ""
    """What was done, for the log; empty: nothing worth logging."""
    detail: int = 0
    """result_param2."""
    messages: tuple[Any, ...] = ()
    """What is sent behind the COMMAND_ACK."""


def degrees_of(value: int) -> float:
    """Degrees from the 1e-7 degrees of a field; nan where it says "not given"."""
    return math.nan if value == _NOT_GIVEN else value / 1e7


def read_request(message: Any, peer: Peer) -> Request:
    """A COMMAND_LONG or COMMAND_INT."""
    given = [message.param1, message.param2, message.param3, message.param4]
    frame = None
    if message.get_type() == "COMMAND_LONG":
        # Here, too, clients write the integers' "not given": as the float32 next to it.
        given += [math.nan if value >= _NOT_GIVEN else value for value in (message.param5, message.param6)]
        given.append(message.param7)
    else:
        given += [degrees_of(message.x), degrees_of(message.y), message.z]
        frame = int(message.frame)
    sender = message.get_srcSystem(), message.get_srcComponent()
    return Request(int(message.command), tuple(given), frame, *sender, peer)


def whole(value: float, bits: int, signed: bool = True) -> int:
    """The nearest integer that fits into a field."""
    low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
    return int(max(low, min(high, round(value))))
