"""What flows to which ground station, how often: a schedule of the `STREAMS` for each."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from ftcc.airside.gcs.autopilot_view import AutopilotView
from ftcc.airside.gcs.error_guard import ErrorGuard
from ftcc.airside.gcs.schedule import Schedule
from ftcc.airside.gcs.streams import LOGGED, STREAMS, rates_of
from ftcc.link.gcs_sockets import GcsSocket, Peer

__all__ = ["Telemetry"]


class Telemetry:
    """The telemetry of one autopilot; ``sockets`` are those to the ground, to the swarm's own ``station`` first."""

    def __init__(self, view: AutopilotView, guard: ErrorGuard, sockets: Sequence[GcsSocket]) -> None:
        self._view = view
        self._guard = guard
        self._sockets = sockets
        self._rates = rates_of(view, station=False)
        station = sockets[0]
        self._schedules: dict[Peer, Schedule] = {
            peer: Schedule(rates_of(view, socket is station), LOGGED if socket is station else ())
            for socket in sockets
            for peer in socket.peers
        }
        self._flows = list(self._schedules.items())

    def send_due(self, now_us: int) -> None:
        """Send what is due at this tick."""
        for peer, schedule in self._flows:
            due = schedule.due(now_us)
            if due and peer.there:
                self._send(peer, due)

    def _send(self, peer: Peer, due: list[int]) -> None:
        try:
            peer.send(*(STREAMS[n].make(self._view) for n in due))
        except Exception:
            # One message that cannot be sent must not take the others with it.
            for n in due:
                self._guard.run(f"telemetry {STREAMS[n].name}", partial(self._send_one, peer, n))

    def _send_one(self, peer: Peer, n: int) -> None:
        peer.send(STREAMS[n].make(self._view))

    @property
    def next_us(self) -> int:
        """Simulated time before which nothing is due."""
        return min(schedule.next_us for _, schedule in self._flows)

    @property
    def next_wall(self) -> float:
        """Wall time (monotonic, s) before which nothing is due either."""
        return min(schedule.next_wall for _, schedule in self._flows)

    def default_rate(self, n: int) -> float:
        """Rate of stream ``n`` where a peer asks for no other, Hz."""
        return self._rates[n]

    def set_default_rate(self, n: int, rate: float) -> None:
        """Set the rate of stream ``n`` (Hz; 0 = silent) towards all but the swarm's own station, also those to come."""
        self._rates[n] = rate
        for socket in self._sockets[1:]:
            for peer in socket.peers:
                self.schedule(peer).set(n, rate)

    def schedule(self, peer: Peer) -> Schedule:
        """What flows to ``peer``; to a new one it begins now."""
        if peer not in self._schedules:
            self._schedules[peer] = Schedule(self._rates)
            self._flows = list(self._schedules.items())
        return self._schedules[peer]

    def flows_to(self, peer: Peer) -> bool:
        """Whether ``peer`` has a schedule."""
        return peer in self._schedules

    def drop_departed(self) -> None:
        """Send nothing any more to peers that their socket has forgotten."""
        present = [peer for socket in self._sockets for peer in socket.peers]
        self._schedules = {peer: self.schedule(peer) for peer in present}
        self._flows = list(self._schedules.items())
