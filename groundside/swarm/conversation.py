"""Exchange MAVLink requests and answers with the autopilots of a running swarm; repeat each request until answered."""

from __future__ import annotations

import math
import random
import select
import socket
import struct
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ftcc.groundside.errors import UserError
from ftcc.groundside.swarm.registry import Entry, VehicleEntry, find_swarm
from ftcc.link.codec import Codec
from ftcc.link.mavlink import AUTOPILOT, LOOPBACK, NAME_LENGTH, STATION, as_typed, dialect
from ftcc.link.signing import KeyFileError, Signing, read_key

__all__ = ["Conversation", "NoAnswerError", "RefusedError", "StationError", "as_float32"]

_COMPONENT = dialect.MAV_COMP_ID_MISSIONPLANNER
_NAN = math.nan
_MAX_FLOAT32 = float(np.finfo(np.float32).max)
_REASON_TIMEOUT = 0.1
"""Longest wait for the text that gives the reason of a refusal, wall s."""


class StationError(UserError):
    """A command that was not carried out."""


class NoAnswerError(StationError):
    """The vehicle does not exist, or does not answer."""


class RefusedError(StationError):
    """The vehicle has refused the command."""


class Conversation:
    """Connection to the UAVs of one swarm.

    Parameters
    ----------
    swarm : str or Entry, optional
        Name of the running swarm as `ftcc ps` shows it; needed if several run.
    key : Path, optional
        Key file; default: that of the swarm, if its messages are signed.
    timeout : float
        Wall time to wait for an answer before the request is repeated, s; doubled each time.
    tries : int
        Largest number of times that a request is sent.

    Raises
    ------
    StationError
        If there is no such swarm, or its key cannot be read.
    """

    def __init__(
        self, swarm: str | Entry | None = None, *, key: Path | None = None, timeout: float = 0.4, tries: int = 4
    ) -> None:
        try:
            self.entry = swarm if isinstance(swarm, Entry) else find_swarm(swarm)
            key = key or (Path(self.entry.key) if self.entry.key else None)
            signing = Signing(read_key(key), link=random.randrange(256)) if key else None
        except (LookupError, KeyFileError) as error:
            raise StationError(str(error)) from None
        self._cards = {card.uav: card for card in self.entry.vehicles}
        self._timeout = timeout
        self._tries = tries
        self._codec = Codec(STATION, _COMPONENT, signing)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        self._socket.bind((LOOPBACK, 0))
        self.texts: dict[int, list[str]] = {}
        """STATUSTEXT of each UAV since the last command to it."""

    def close(self) -> None:
        """Free the port."""
        self._socket.close()

    @property
    def uavs(self) -> tuple[int, ...]:
        """Return the ids of the swarm's UAVs."""
        return tuple(self._cards)

    @property
    def followers(self) -> tuple[int, ...]:
        """Return the ids of its followers."""
        return tuple(uav for uav, card in self._cards.items() if card.role == "follower")

    def card(self, uav: int) -> VehicleEntry:
        """Return a UAV's entry in the registry.

        Raises
        ------
        NoAnswerError
            If the swarm has no such UAV.
        """
        if uav not in self._cards:
            there = ", ".join(map(str, self._cards))
            raise NoAnswerError(f"swarm {self.entry.name} has no UAV {uav}; its UAVs are {there}")
        return self._cards[uav]

    def system(self, uav: int) -> int:
        """Return the MAVLink system id of a UAV."""
        return self.card(uav).system

    def get(self, uav: int, name: str) -> float:
        """Return the current value of a parameter.

        Raises
        ------
        RefusedError
            If there is no such parameter.
        """
        return self._read(uav, name)[0]

    def set(self, uav: int, name: str, value: float) -> float:
        """Set a parameter and return its new value.

        Raises
        ------
        RefusedError
            If the UAV refuses the value; the parameter keeps its former value.
        StationError
            If a MAVLink message cannot carry the value.
        """
        before, type_ = self._read(uav, name)
        if type_ == dialect.MAV_PARAM_TYPE_INT32:
            raw = struct.unpack("<f", struct.pack("<i", _as_int32(name, value)))[0]

            def same(one: float) -> bool:
                return one == value
        else:
            raw = as_float32(name, value)

            def same(one: float) -> bool:
                return bool(np.float32(one) == raw)

        if same(before):
            return before
        request = dialect.MAVLink_param_set_message(self.system(uav), AUTOPILOT, name.encode(), raw, type_)
        self.texts[uav] = []

        def is_answer(message: Any) -> bool:
            """Accept the requested value, or the former one after a STATUSTEXT; others answer earlier requests."""
            if message.get_type() != "PARAM_VALUE" or message.param_id.upper() != name.upper():
                return False
            return bool(self.texts[uav]) or same(_value(message))

        after = _value(self._ask(uav, [request], is_answer, f"parameter {name}"))
        if not same(after):
            why = self._reason(uav)
            raise RefusedError(f"UAV {uav}: {name} = {value:.10g} is refused: {why}; the present value is {after:.10g}")
        return after

    def parameters(self, uav: int) -> dict[str, float]:
        """All parameters by name."""
        found: dict[int, tuple[str, float]] = {}
        count = 1
        for _ in range(self._tries):
            self.send(uav, dialect.MAVLink_param_request_list_message(self.system(uav), AUTOPILOT))
            until = time.monotonic() + self._timeout
            while len(found) < count and time.monotonic() < until:
                for message in self.receive(uav, until):
                    if message.get_type() == "PARAM_VALUE":
                        count = message.param_count
                        found[message.param_index] = (message.param_id, _value(message))
            if len(found) == count:
                return dict(found[n] for n in sorted(found))
        raise NoAnswerError(f"UAV {uav} sent only {len(found)} of its parameters")

    def _read(self, uav: int, name: str) -> tuple[float, int]:
        """Return value and type of a parameter."""
        request = dialect.MAVLink_param_request_read_message(
            self.system(uav), AUTOPILOT, name.encode()[:NAME_LENGTH], -1
        )
        return self._parameter(uav, request, name)

    def _parameter(self, uav: int, request: Any, name: str) -> tuple[float, int]:
        def is_answer(message: Any) -> bool:
            return message.get_type() in ("PARAM_VALUE", "PARAM_ERROR") and message.param_id.upper() == name.upper()

        if len(name) > NAME_LENGTH:
            raise RefusedError(f"UAV {uav} has no parameter {name}")
        answer = self._ask(uav, [request], is_answer, f"parameter {name}")
        if answer.get_type() == "PARAM_ERROR":
            raise RefusedError(f"UAV {uav} has no parameter {name}")
        return _value(answer), int(answer.param_type)

    def command(self, uav: int, command: int, *parameters: float) -> Any:
        """Send COMMAND_LONG with up to seven parameters until it is answered, and return the COMMAND_ACK.

        Raises
        ------
        NoAnswerError
            If there is no such UAV or it does not answer.
        RefusedError
            If the UAV does not accept the command; the text holds its reason.
        StationError
            If a parameter is infinite or beyond float32.
        """
        carried = [p if math.isnan(p) else as_float32(f"parameter {n}", p) for n, p in enumerate(parameters, 1)]
        given = (*carried, *(_NAN,) * (7 - len(parameters)))
        requests = [
            dialect.MAVLink_command_long_message(self.system(uav), AUTOPILOT, command, n, *given)
            for n in range(self._tries)
        ]
        self.texts[uav] = []
        name = dialect.enums["MAV_CMD"][command].name.removeprefix("MAV_CMD_")
        ack = self._ask(uav, requests, lambda m: m.get_type() == "COMMAND_ACK" and m.command == command, name)
        if ack.result != dialect.MAV_RESULT_ACCEPTED:
            result = dialect.enums["MAV_RESULT"][ack.result].name.removeprefix("MAV_RESULT_").lower().replace("_", " ")
            raise RefusedError(f"UAV {uav}: {name} {result}: {self._reason(uav)}")
        return ack

    def request(self, uav: int, message: int) -> Any:
        """Request one message of a UAV with REQUEST_MESSAGE and return it."""
        name = dialect.mavlink_map[message].msgname
        request = dialect.MAVLink_command_long_message(
            self.system(uav), AUTOPILOT, dialect.MAV_CMD_REQUEST_MESSAGE, 0, message, _NAN, _NAN, _NAN, _NAN, _NAN, _NAN
        )
        return self._ask(uav, [request], lambda m: m.get_type() == name, name)

    def _ask(self, uav: int, requests: list[Any], is_answer: Callable[[Any], bool], what: str) -> Any:
        """Send ``requests`` one after the other, the last one again, until an answer arrives, and return it."""
        while select.select([self._socket], [], [], 0.0)[0]:
            self.receive(uav, 0.0)  # discard what arrived before the request
        for n in range(self._tries):
            self.send(uav, requests[min(n, len(requests) - 1)])
            until = time.monotonic() + self._timeout * 2**n
            while time.monotonic() < until:
                for message in self.receive(uav, until):
                    if is_answer(message):
                        return message
        seconds = self._timeout * (2**self._tries - 1)
        raise NoAnswerError(f"UAV {uav} of swarm {self.entry.name} does not answer ({what}, {seconds:.1f} s)")

    def send(self, uav: int, message: Any) -> None:
        """Send a message to a UAV without waiting for an answer."""
        self._socket.sendto(self._codec.pack(message), (LOOPBACK, self.card(uav).port))

    def receive(self, uav: int, until: float) -> list[Any]:
        """Return the next messages of one UAV; [] if none arrive before ``until`` (monotonic, s)."""
        if not select.select([self._socket], [], [], max(0.0, until - time.monotonic()))[0]:
            return []
        datagram, sender = self._socket.recvfrom(4096)
        if sender != (LOOPBACK, self.card(uav).port):
            return []
        messages = [m for m in self._codec.parse(datagram) if m.get_srcSystem() == self.system(uav)]
        for message in messages:
            if message.get_type() == "STATUSTEXT":
                self.texts.setdefault(uav, []).append(message.text)
        return messages

    def _reason(self, uav: int) -> str:
        """Return the UAV's reason for a refusal."""
        until = time.monotonic() + _REASON_TIMEOUT
        while not self.texts.get(uav) and time.monotonic() < until:
            self.receive(uav, until)
        return self.texts[uav][-1] if self.texts.get(uav) else "no reason given"


def _as_int32(name: str, value: float) -> int:
    """Return a number as int32, or refuse it."""
    if not (math.isfinite(value) and value == int(value) and -(2**31) <= value < 2**31):
        raise StationError(f"{name} = {value:.10g}: must be a whole number from {-(2**31)} to {2**31 - 1}")
    return int(value)


def as_float32(name: str, value: float) -> float:
    """Round a number to float32, as MAVLink messages carry it.

    Raises
    ------
    StationError
        If it is not finite, or too large.
    """
    if not abs(value) <= _MAX_FLOAT32:  # also where it is nan
        raise StationError(f"{name} = {value:.10g}: must be a finite number, at most {_MAX_FLOAT32:.7g} in size")
    return float(np.float32(value))


def _value(message: Any) -> float:
    """Return the value in a PARAM_VALUE."""
    if message.param_type == dialect.MAV_PARAM_TYPE_INT32:
        return float(struct.unpack("<i", struct.pack("<f", message.param_value))[0])
    return as_typed(message.param_value)
