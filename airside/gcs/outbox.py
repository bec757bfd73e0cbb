"""What an autopilot says to ground stations beside its telemetry: texts, and the answers to commands."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from ftcc.airside.gcs.answers import ACCEPTED, Answer, Request, whole
from ftcc.airside.gcs.autopilot_view import AutopilotView
from ftcc.link.gcs_sockets import GcsSocket, Peer
from ftcc.link.mavlink import dialect, status_text

__all__ = ["Outbox"]

_M = dialect
_REPEAT = 5.0
"""Wall time within which a repeated command is answered as before, s."""
_ANSWERS = 64
"""Answers that are remembered for repeated commands."""

_Key = tuple[int, int, int, str]


class Outbox:
    """The way to the ground stations; ``sockets`` are all but that of the swarm's own station.

    The swarm's own station reads everything in the launcher's log.
    """

    def __init__(self, view: AutopilotView, sockets: Sequence[GcsSocket]) -> None:
        self._view = view
        self._sockets = sockets
        self._answered: dict[_Key, tuple[tuple[float, ...], float, Any]] = {}
        """By sender and command: its parameters, when, and the COMMAND_ACK."""

    @property
    def peers(self) -> list[Peer]:
        """The ground stations that listen, as far as is known."""
        return [peer for socket in self._sockets for peer in socket.peers if peer.there]

    def send_text(self, severity: int, text: str, peer: Peer | None = None) -> None:
        """STATUSTEXT to every ground station, or to one."""
        for one in self.peers if peer is None else [peer]:
            one.send(status_text(severity, text))

    def answer(self, request: Request, answer: Answer, read_only: bool = False) -> None:
        """COMMAND_ACK; STATUSTEXT where it needs a reason; a line in the log unless the command is ``read_only``."""
        ack = _M.MAVLink_command_ack_message(
            request.command, answer.result, 0, whole(answer.detail, 32), request.system, request.component
        )
        self._answered[_key(request)] = (request.parameters, time.monotonic(), ack)
        while len(self._answered) > _ANSWERS:
            del self._answered[next(iter(self._answered))]
        request.peer.send(ack)
        if answer.messages:
            request.peer.send(*answer.messages)
        if answer.result == ACCEPTED:
            if answer.event:
                self._view.log(answer.event, "info", request.who, "accepted")
        elif answer.text:
            self.send_text(_M.MAV_SEVERITY_WARNING, answer.text, request.peer)
            if read_only:
                return
            name = _M.enums["MAV_CMD"][request.command].name.removeprefix("MAV_CMD_")
            outcome = _M.enums["MAV_RESULT"][answer.result].name.removeprefix("MAV_RESULT_").lower()
            self._view.log(f"{name} {outcome.replace('_', ' ')}: {answer.text}", "warning", request.who, outcome)

    def answer_again(self, request: Request) -> bool:
        """Answer the repetition of a command as before; False where it was not answered, or long ago."""
        parameters, at, ack = self._answered.get(_key(request), ((), 0.0, None))
        if ack is None or repr(parameters) != repr(request.parameters) or time.monotonic() - at >= _REPEAT:
            return False
        request.peer.send(ack)
        return True


def _key(request: Request) -> _Key:
    return request.system, request.component, request.command, repr(request.peer.address)
