"""An autopilot as a MAVLink vehicle: what it sends to the ground, and how it answers."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable
from typing import Any

from ftcc.airside.ground.commands import COMMANDS, READING, Answer, Request
from ftcc.airside.ground.failures import Failures
from ftcc.airside.ground.offboard import Offboard
from ftcc.airside.ground.parameters import Parameters
from ftcc.airside.ground.requests import CHANGING, MESSAGES
from ftcc.airside.ground.seat import Seat
from ftcc.airside.ground.streams import STREAMS, Schedule, heartbeat, rates_of
from ftcc.link.ground import GroundSocket, Peer
from ftcc.link.mavlink import AUTOPILOT, LOOPBACK, dialect, status_text
from ftcc.link.signing import Signing, read_key

__all__ = ["GroundLink"]

_M = dialect
_HEARTBEAT = 1.0
"""Period of HEARTBEAT, wall s."""
_REPEAT = 5.0
"""Wall time within which a repeated command is answered as before, s."""

_Key = tuple[int, int, int, str]


class GroundLink:
    """All that one autopilot has to do with the ground."""

    def __init__(self, seat: Seat) -> None:
        self.seat = seat
        setting = seat.setting
        self.system = setting.system(seat.spec.uav)
        """MAVLink system id."""
        ports = setting.ports[seat.spec.uav]
        self._signing: Signing | None = None
        if setting.key is not None:
            memory = setting.key.with_name(f"{setting.key.name}.stamps") / f"{self.system}-{AUTOPILOT}.json"
            self._signing = Signing(read_key(setting.key), memory)
        station = (LOOPBACK, setting.station)
        self._station = GroundSocket(self.system, AUTOPILOT, ports.telemetry, station, self._signing)
        self._callers = GroundSocket(self.system, AUTOPILOT, ports.ground, None, self._signing)
        listeners = [GroundSocket(self.system, AUTOPILOT, 0, to, self._signing) for to in setting.listeners]
        self.sockets = (self._station, self._callers, *listeners)
        """To be listened to."""
        self._rates = rates_of(seat, station=False)
        self._schedules: dict[Peer, Schedule] = {
            peer: Schedule(rates_of(seat, socket is self._station)) for socket in self.sockets for peer in socket.peers
        }
        self._flows = list(self._schedules.items())
        self._last_heartbeat = 0.0
        self._answered: dict[_Key, tuple[tuple[float, ...], float, Any]] = {}
        """By sender and command: its parameters, when, and the COMMAND_ACK."""
        self.after_answer: Callable[[], None] | None = None
        """What a command sends behind its COMMAND_ACK."""
        self.failures = Failures(self)
        self.offboard = Offboard(self)
        self.parameters = Parameters(seat, self.rate, self._set_rate)

    # Towards the ground.

    @property
    def peers(self) -> list[Peer]:
        """The ground stations, beside the swarm's own, which hears everything from its processes."""
        return [peer for socket in self.sockets[1:] for peer in socket.peers if peer.there]

    def report(self, now_us: int) -> None:
        """After a tick: say what acts, and send the telemetry that is due."""
        self.failures.tell_what_acts(now_us)
        for peer, schedule in self._flows:
            due = schedule.due(now_us)
            if due and peer.there:
                peer.send(*(STREAMS[n].make(self.seat) for n in due))

    @property
    def next_us(self) -> int:
        """Simulated time before which there is nothing to `report`, unless the ground asks for something."""
        return min([self.failures.next_us, *(schedule.next_us for _, schedule in self._flows)])

    @property
    def next_wall(self) -> float:
        """Wall time (monotonic, s) before which there is nothing either: what has been armed knows no wall clock."""
        return -math.inf if self.failures.armed else min(schedule.next_wall for _, schedule in self._flows)

    def attend(self) -> None:
        """Between ticks, also while the swarm is held: HEARTBEAT, and what must not wait for ever."""
        self.failures.attend()
        now = time.monotonic()
        if now - self._last_heartbeat < _HEARTBEAT:
            return
        self._last_heartbeat = now
        self.offboard.attend()
        self._callers.forget_the_silent()
        present = [peer for socket in self.sockets for peer in socket.peers]
        self._schedules = {peer: self.schedule(peer) for peer in present}
        self._flows = list(self._schedules.items())
        beat = heartbeat(self.seat, self.seat.alive)
        for socket in self.sockets:
            for peer in socket.peers:
                peer.send(beat)

    def text(self, severity: int, text: str, peer: Peer | None = None) -> None:
        """STATUSTEXT to every ground station, or to one."""
        for one in self.peers if peer is None else [peer]:
            one.send(status_text(severity, text))

    def end(self) -> None:
        """The UAV ends: its last words."""
        if self.seat.alive:
            self.seat.alive = False
            self._last_heartbeat = 0.0
            self.attend()

    # Rates.

    def streams_of(self, message: float) -> list[int]:
        """Places in `STREAMS` of a message that this UAV has."""
        return [
            n
            for n, stream in enumerate(STREAMS)
            if stream.message == message and not (stream.followers_only and self.seat.leader)
        ]

    def rate(self, n: int) -> float:
        """Default rate of stream ``n``, Hz."""
        return self._rates[n]

    def _set_rate(self, n: int, rate: float) -> None:
        self._rates[n] = rate
        for socket in self.sockets[1:]:
            for peer in socket.peers:
                self.schedule(peer).set(n, rate)

    def schedule(self, peer: Peer) -> Schedule:
        """What flows to ``peer``."""
        if peer not in self._schedules:
            self._schedules[peer] = Schedule(self._rates)
            self._flows = list(self._schedules.items())
        return self._schedules[peer]

    # From the ground.

    def listen(self, socket: GroundSocket) -> None:
        """Answer what has come by ``socket``; what is for other systems is left alone."""
        for peer, message in socket.receive():
            kind = message.get_type()
            handle = MESSAGES.get(kind)
            if handle is None or message.get_srcSystem() == self.system:
                continue
            system = getattr(message, "target_system", 0)
            component = getattr(message, "target_component", 0)
            if system not in (0, self.system) or component not in (0, AUTOPILOT):
                continue
            if self._signing is not None and kind in CHANGING:
                self._signing.remember()
            handle(self, peer, message)

    def obey(self, request: Request, repeated: bool) -> None:
        """Carry out a command and answer it; a repetition of one that was answered is answered likewise."""
        key = (request.system, request.component, request.command, repr(request.peer.address))
        last = self._answered.get(key)
        same = last is not None and repr(last[0]) == repr(request.parameters)
        if repeated and last is not None and same and time.monotonic() - last[1] < _REPEAT:
            request.peer.send(last[2])
            return
        handle = COMMANDS.get(request.command)
        if handle is None:
            answer: Answer | None = Answer(_M.MAV_RESULT_UNSUPPORTED)
        elif not self.seat.alive and request.command not in READING:
            answer = Answer(_M.MAV_RESULT_DENIED, "this UAV is lost")
        else:
            answer = handle(self, request)
        if answer is not None:
            self.answer(request, answer)

    def answer(self, request: Request, answer: Answer) -> None:
        """COMMAND_ACK; STATUSTEXT where it needs a reason; a line in the log where something happened."""
        ack = _M.MAVLink_command_ack_message(
            request.command, answer.result, 0, answer.detail, request.system, request.component
        )
        key = (request.system, request.component, request.command, repr(request.peer.address))
        self._answered[key] = (request.parameters, time.monotonic(), ack)
        while len(self._answered) > 64:
            del self._answered[next(iter(self._answered))]
        request.peer.send(ack)
        if self.after_answer is not None:
            follow, self.after_answer = self.after_answer, None
            follow()
        if answer.result == _M.MAV_RESULT_ACCEPTED:
            if answer.event:
                self.seat.note(answer.event, "info", request.who, "accepted")
        elif answer.text:
            self.text(_M.MAV_SEVERITY_WARNING, answer.text, request.peer)
            if request.command in READING:
                return
            name = _M.enums["MAV_CMD"][request.command].name.removeprefix("MAV_CMD_")
            outcome = _M.enums["MAV_RESULT"][answer.result].name.removeprefix("MAV_RESULT_").lower()
            self.seat.note(f"{name} {outcome.replace('_', ' ')}: {answer.text}", "warning", request.who, outcome)

    def dropped(self) -> dict[str, int]:
        """What came and was no message for us, by reason."""
        names = ("bad_data", "not_finite", "not_signed")
        return {name: sum(getattr(socket.codec, name) for socket in self.sockets) for name in names}

    def close(self) -> None:
        """Free the ports."""
        if self._signing is not None:
            with contextlib.suppress(OSError):
                self._signing.remember()
        for socket in self.sockets:
            socket.close()
