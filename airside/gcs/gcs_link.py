"""An autopilot as a MAVLink vehicle: what it sends to the ground, and how it answers."""

from __future__ import annotations

import math
import time
import traceback
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any

from ftcc.airside.gcs.answers import Answer, Request, whole
from ftcc.airside.gcs.commands import COMMANDS
from ftcc.airside.gcs.failures import Failures
from ftcc.airside.gcs.offboard import Offboard
from ftcc.airside.gcs.parameters import Parameters
from ftcc.airside.gcs.requests import MESSAGES
from ftcc.airside.gcs.schedule import Schedule
from ftcc.airside.gcs.seat import Seat
from ftcc.airside.gcs.signatures import Signatures
from ftcc.airside.gcs.streams import LOGGED, STREAMS, heartbeat, rates_of
from ftcc.link.gate import LauncherGoneError
from ftcc.link.gcs_sockets import GcsSocket, Peer
from ftcc.link.mavlink import AUTOPILOT, LOOPBACK, dialect, status_text

__all__ = ["GcsLink"]

_M = dialect
_HEARTBEAT = 1.0
"""Period of HEARTBEAT, wall s."""
_REPEAT = 5.0
"""Wall time within which a repeated command is answered as before, s."""

_TURNED_AWAY = 10.0
"""Least wall time between two complaints that there are too many clients, s."""

_Key = tuple[int, int, int, str]


class GcsLink:
    """All that one autopilot has to do with the ground."""

    def __init__(self, seat: Seat) -> None:
        self.seat = seat
        setting = seat.setting
        self.system = setting.system(seat.spec.uav)
        """MAVLink system id."""
        ports = setting.ports[seat.spec.uav]
        self.signatures = Signatures(seat, self.system)
        signing = self.signatures.signing
        station = (LOOPBACK, setting.station)
        self._station = GcsSocket(self.system, AUTOPILOT, ports.telemetry, station, signing)
        self._callers = GcsSocket(self.system, AUTOPILOT, ports.ground, None, signing)
        listeners = [GcsSocket(self.system, AUTOPILOT, 0, to, signing) for to in setting.listeners]
        self.sockets = (self._station, self._callers, *listeners)
        """To be listened to."""
        self._rates = rates_of(seat, station=False)
        self._schedules: dict[Peer, Schedule] = {
            peer: Schedule(rates_of(seat, socket is self._station), LOGGED if socket is self._station else ())
            for socket in self.sockets
            for peer in socket.peers
        }
        self._flows = list(self._schedules.items())
        self._last_heartbeat = 0.0
        self._turned_away = -math.inf
        """When a caller was told that there is no place for it, wall s (monotonic)."""
        self._answered: dict[_Key, tuple[tuple[float, ...], float, Any]] = {}
        """By sender and command: its parameters, when, and the COMMAND_ACK."""
        self.after_answer: Callable[[], None] | None = None
        """What a command sends behind its COMMAND_ACK."""
        self.faults: Counter[str] = Counter()
        """What failed here, and how often: faults of this software, each flown past."""
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
        self._survive("telling what acts", partial(self.failures.tell_what_acts, now_us))
        self._survive("offboard's end", partial(self.offboard.expire, now_us))
        for peer, schedule in self._flows:
            due = schedule.due(now_us)
            if due and peer.there:
                self._send(peer, due)

    def _send(self, peer: Peer, due: list[int]) -> None:
        try:
            peer.send(*(STREAMS[n].make(self.seat) for n in due))
        except Exception:
            # One message that cannot be sent must not take the others with it.
            for n in due:
                self._survive(f"telemetry {STREAMS[n].name}", partial(self._send_one, peer, n))

    def _send_one(self, peer: Peer, n: int) -> None:
        peer.send(STREAMS[n].make(self.seat))

    def _survive(self, what: str, do: Callable[[], None]) -> None:
        """Do something that the ground has asked for; a fault of ours is counted, told once, and flown past."""
        try:
            do()
        except LauncherGoneError:
            raise
        except Exception as error:
            self.faults[what] += 1
            if self.faults[what] == 1:
                traceback.print_exc()
                self.seat.note(f"{what} failed, a fault of this software: {error!r}", "error")

    @property
    def next_us(self) -> int:
        """Simulated time before which there is nothing to `report`, unless the ground asks for something."""
        return min([self.failures.next_us, self.offboard.next_us, *(schedule.next_us for _, schedule in self._flows)])

    @property
    def next_wall(self) -> float:
        """Wall time (monotonic, s) before which there is nothing either: what the flight waits for knows none."""
        if self.failures.armed or self.offboard.running:
            return -math.inf
        return min(schedule.next_wall for _, schedule in self._flows)

    def attend(self) -> None:
        """Between ticks, also while the swarm is held: HEARTBEAT, and what must not wait for ever."""
        self._survive("answering for the vehicle", self.failures.attend)
        now = time.monotonic()
        if now - self._last_heartbeat < _HEARTBEAT:
            return
        self._last_heartbeat = now
        self._survive("HEARTBEAT", self._beat)

    def _beat(self) -> None:
        self._callers.forget_the_silent()
        present = [peer for socket in self.sockets for peer in socket.peers]
        self._schedules = {peer: self.schedule(peer) for peer in present}
        self._flows = list(self._schedules.items())
        beat = heartbeat(self.seat, self.seat.alive)
        for socket in self.sockets:
            for peer in socket.peers:
                peer.send(beat)

    def vehicle_answered(self, message: Any) -> None:
        """COMMAND_ACK of the vehicle."""
        self._survive("the vehicle's answer", partial(self.failures.vehicle_answered, message))

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

    def listen(self, socket: GcsSocket) -> None:
        """Answer what has come by ``socket``; what is for other systems is left alone."""
        self._survive("reading", partial(self._listen, socket))

    def _listen(self, socket: GcsSocket) -> None:
        for peer, message in socket.receive():
            self._welcome(peer)
            kind = message.get_type()
            taken = MESSAGES.get(kind)
            sender = message.get_srcSystem(), message.get_srcComponent()
            # What has our own ids is our own, sent back; another component of our system is a computer on board.
            if taken is None or sender == (self.system, AUTOPILOT):
                continue
            system = getattr(message, "target_system", 0)
            component = getattr(message, "target_component", 0)
            if system not in (0, self.system) or component not in (0, AUTOPILOT):
                continue
            if taken.changing:
                self.signatures.remember()
            self._survive(kind, partial(taken.handle, self, peer, message))
        self.signatures.tell(socket.codec)

    def _welcome(self, peer: Peer) -> None:
        """Begin to send telemetry to who is new, or say why not."""
        if not peer.remembered:
            now, text = time.monotonic(), "too many clients: answers only, no telemetry"
            if now - self._turned_away > _TURNED_AWAY:
                self._turned_away = now
                self.text(_M.MAV_SEVERITY_WARNING, text, peer)
                self.seat.note(f"{text} for {peer.address[0]}:{peer.address[1]}", "warning")
        elif peer not in self._schedules:
            self.schedule(peer)
            peer.send(heartbeat(self.seat, self.seat.alive))

    def obey(self, request: Request, repeated: bool) -> None:
        """Carry out a command and answer it; a repetition of one that was answered is answered likewise."""
        key = (request.system, request.component, request.command, repr(request.peer.address))
        last = self._answered.get(key)
        same = last is not None and repr(last[0]) == repr(request.parameters)
        if repeated and last is not None and same and time.monotonic() - last[1] < _REPEAT:
            request.peer.send(last[2])
            return
        command = COMMANDS.get(request.command)
        if command is None:
            answer: Answer | None = Answer(_M.MAV_RESULT_UNSUPPORTED)
        elif not self.seat.alive and not command.reading:
            answer = Answer(_M.MAV_RESULT_DENIED, "this UAV is lost")
        else:
            answer = command.handle(self, request)
        if answer is not None:
            self.answer(request, answer)

    def answer(self, request: Request, answer: Answer) -> None:
        """COMMAND_ACK; STATUSTEXT where it needs a reason; a line in the log where something happened."""
        ack = _M.MAVLink_command_ack_message(
            request.command, answer.result, 0, whole(answer.detail, 32), request.system, request.component
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
            if COMMANDS[request.command].reading:
                return
            name = _M.enums["MAV_CMD"][request.command].name.removeprefix("MAV_CMD_")
            outcome = _M.enums["MAV_RESULT"][answer.result].name.removeprefix("MAV_RESULT_").lower()
            self.seat.note(f"{name} {outcome.replace('_', ' ')}: {answer.text}", "warning", request.who, outcome)

    def dropped(self) -> dict[str, int]:
        """What came and was no message for us, by reason."""
        found: Counter[str] = Counter()
        for socket in self.sockets:
            found.update(socket.codec.not_signed)
            found.update(bad_data=socket.codec.bad_data, not_finite=socket.codec.not_finite)
        return dict(found)

    def close(self) -> None:
        """Free the ports."""
        self.signatures.remember()
        for socket in self.sockets:
            socket.close()
