"""An autopilot as a MAVLink vehicle: its sockets to the ground, what it sends there, and what becomes of what comes."""

from __future__ import annotations

import math
import time
from collections import Counter
from functools import partial
from typing import Any

from ftcc.airside.gcs.autopilot_view import AutopilotView
from ftcc.airside.gcs.error_guard import ErrorGuard
from ftcc.airside.gcs.failures import Failures
from ftcc.airside.gcs.offboard import Offboard
from ftcc.airside.gcs.outbox import Outbox
from ftcc.airside.gcs.parameters import Parameters
from ftcc.airside.gcs.requests import MESSAGES
from ftcc.airside.gcs.services import Services
from ftcc.airside.gcs.signatures import Signatures
from ftcc.airside.gcs.streams import heartbeat
from ftcc.airside.gcs.telemetry import Telemetry
from ftcc.link.gcs_sockets import GcsSocket, Peer
from ftcc.link.mavlink import AUTOPILOT, LOOPBACK, dialect

__all__ = ["GcsLink"]

_HEARTBEAT = 1.0
"""Period of HEARTBEAT, wall s."""
_TURNED_AWAY = 10.0
"""Least wall time between two complaints that there are too many clients, s."""

_SEVERITIES = {
    "info": dialect.MAV_SEVERITY_INFO,
    "warning": dialect.MAV_SEVERITY_WARNING,
    "error": dialect.MAV_SEVERITY_ERROR,
}
"""Severities of events as STATUSTEXT has them."""


class GcsLink:
    """All that one autopilot has to do with the ground."""

    def __init__(self, view: AutopilotView) -> None:
        self.view = view
        setting = view.setting
        self.system = setting.system(view.spec.uav)
        """MAVLink system id."""
        ports = setting.ports[view.spec.uav]
        self._signatures = Signatures(view, self.system)
        signing = self._signatures.signing
        station = GcsSocket(self.system, AUTOPILOT, ports.telemetry, (LOOPBACK, setting.station), signing)
        self._callers = GcsSocket(self.system, AUTOPILOT, ports.ground, None, signing)
        listeners = [GcsSocket(self.system, AUTOPILOT, 0, to, signing) for to in setting.listeners]
        self.sockets = (station, self._callers, *listeners)
        """To be listened to."""
        self._guard = ErrorGuard(view)
        self._last_heartbeat = 0.0
        self._turned_away = -math.inf
        """When a caller was last refused telemetry, wall s (monotonic)."""
        outbox = Outbox(view, self.sockets[1:])
        telemetry = Telemetry(view, self._guard, self.sockets)
        self.services = Services(
            view=view,
            outbox=outbox,
            telemetry=telemetry,
            parameters=Parameters(view, telemetry),
            failures=Failures(view, outbox),
            offboard=Offboard(view, outbox),
        )

    @property
    def errors(self) -> Counter[str]:
        """Errors of this software in what the ground asked for, and how many."""
        return self._guard.errors

    # Towards the ground.

    def report(self, now_us: int) -> None:
        """After a tick: say which failures act now, end an offboard without targets, send telemetry that is due."""
        services = self.services
        self._guard.run("telling what acts", partial(services.failures.report_acting, now_us))
        self._guard.run("offboard's end", partial(services.offboard.end_if_silent, now_us))
        services.telemetry.send_due(now_us)

    @property
    def next_us(self) -> int:
        """Simulated time before which there is nothing to `report`, unless the ground asks for something."""
        services = self.services
        return min(services.failures.next_us, services.offboard.next_us, services.telemetry.next_us)

    @property
    def next_wall(self) -> float:
        """Wall time (monotonic, s) before which there is nothing either: what the flight waits for knows none."""
        if self.services.failures.armed or self.services.offboard.running:
            return -math.inf
        return self.services.telemetry.next_wall

    def attend(self) -> None:
        """Between ticks, also while the swarm is held: HEARTBEAT, and a time limit on the vehicle's answer."""
        self._guard.run("answering for the vehicle", self.services.failures.check_timeout)
        now = time.monotonic()
        if now - self._last_heartbeat < _HEARTBEAT:
            return
        self._last_heartbeat = now
        self._guard.run("HEARTBEAT", self._send_heartbeat)

    def _send_heartbeat(self) -> None:
        self._callers.forget_the_silent()
        self.services.telemetry.drop_departed()
        message = heartbeat(self.view, self.view.alive)
        for socket in self.sockets:
            for peer in socket.peers:
                peer.send(message)

    def take_vehicle_answer(self, message: Any) -> None:
        """COMMAND_ACK of the vehicle."""
        self._guard.run("the vehicle's answer", partial(self.services.failures.take_vehicle_answer, message))

    def end(self) -> None:
        """The UAV ends: a last HEARTBEAT says so."""
        if self.view.alive:
            self.view.alive = False
            self._last_heartbeat = 0.0
            self.attend()

    def show_event(self, severity: str, text: str) -> None:
        """Show an event of this UAV, which the log has from elsewhere, on all ground stations: STATUSTEXT."""
        send = self.services.outbox.send_text
        self._guard.run("STATUSTEXT", partial(send, _SEVERITIES[severity], text))

    # From the ground.

    def listen(self, socket: GcsSocket) -> None:
        """Answer what has come by ``socket``; what is for other systems is left alone."""
        self._guard.run("reading", partial(self._listen, socket))

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
                self._signatures.remember()
            self._guard.run(kind, partial(taken.handle, self.services, peer, message))
        self._signatures.log_refusals(socket.codec)

    def _welcome(self, peer: Peer) -> None:
        """Begin to send telemetry to a new peer, or answer why not."""
        if not peer.remembered:
            now, text = time.monotonic(), "too many clients: answers only, no telemetry"
            if now - self._turned_away > _TURNED_AWAY:
                self._turned_away = now
                self.services.outbox.send_text(dialect.MAV_SEVERITY_WARNING, text, peer)
                self.view.log(f"{text} for {peer.address[0]}:{peer.address[1]}", "warning")
        elif not self.services.telemetry.flows_to(peer):
            self.services.telemetry.schedule(peer)
            peer.send(heartbeat(self.view, self.view.alive))

    def dropped(self) -> dict[str, int]:
        """What came and was no message for us, by reason."""
        found: Counter[str] = Counter()
        for socket in self.sockets:
            found.update(socket.codec.not_signed)
            found.update(bad_data=socket.codec.bad_data, not_finite=socket.codec.not_finite)
        return dict(found)

    def close(self) -> None:
        """Free the ports."""
        self._signatures.remember()
        for socket in self.sockets:
            socket.close()
