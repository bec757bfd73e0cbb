"""The records that the UAVs of a process exchange: with each other directly, with everybody else over the mesh.

In lockstep it also knows for whom a tick must wait, and holds a sender back that would run ahead of those who hear it:
acknowledgements travel with the hearers' own records.
"""

from __future__ import annotations

import collections
from collections.abc import Iterator, Sequence

from ftcc.airside.spec import AutopilotSpec
from ftcc.link.gate import Gate, Said
from ftcc.link.mesh import Mesh
from ftcc.link.process import Setting
from ftcc.link.record import Record, RecordError

__all__ = ["Neighbourhood"]

_AHEAD = 4
"""Lockstep: records that a sender may be ahead of the acknowledgement of those who hear it, beyond the latency."""
_NOTHING_MORE = 2**31 - 1
"""Sequence number acknowledged by a UAV that hears nobody, or has ended."""


class _Link:
    """An in-edge as its receiver manages it."""

    def __init__(self) -> None:
        self.pending: collections.deque[Record] = collections.deque()
        """Records that are not due yet."""
        self.newest = -1
        """Sequence number of the newest record received."""
        self.ended = False
        """The sender has ended: nothing more will come."""


class Neighbourhood:
    """Who hears whom among and around the UAVs of a process."""

    def __init__(self, specs: Sequence[AutopilotSpec], setting: Setting, gate: Gate) -> None:
        self._specs = specs
        self._timing = setting.timing
        self._gate = gate
        self._own = {spec.uav for spec in specs}
        self._links = [{n.uav: _Link() for n in spec.neighbours} for spec in specs]
        self._acknowledged: dict[int, int] = {}
        """Lockstep: what each hearer outside this process has acknowledged."""
        self._complete = -1
        """Lockstep: all records up to this sequence number are here."""
        self._bad_records = 0
        self._mesh = self._open_mesh(setting)

    def _open_mesh(self, setting: Setting) -> Mesh | None:
        """The process's peer, or None if all its neighbours are in this very process."""
        senders = {(spec.uav, n.uav) for spec in self._specs for n in spec.neighbours if n.uav not in self._own}
        hearers = {(spec.uav, uav) for spec in self._specs for uav in spec.hearers if uav not in self._own}
        if not senders and not hearers:
            return None
        linked = {uav for _, uav in senders | hearers}
        hears = {uav for _, uav in senders}
        if setting.lockstep:
            # An edge is subscribed to at both ends, for the acknowledgements.
            self._acknowledged = {uav: -1 for _, uav in hearers}
            hears, hearers = linked, hearers | senders
        # A peer listens on the port of its process's first UAV; of two peers the later one connects.
        me = self._specs[0].uav
        peers = {setting.peer_of[uav] for uav in linked}
        connect = [setting.ports[peer].mesh for peer in sorted(peers) if peer < me]
        listen = setting.ports[me].mesh if any(peer > me for peer in peers) else None
        return Mesh(setting.swarm, self._own, hears, hearers, listen, connect, setting.lockstep)

    @property
    def ready(self) -> bool:
        """Whether all who hear this process's UAVs have subscribed."""
        return self._mesh is None or self._mesh.ready

    @property
    def awaited(self) -> str:
        """Whose subscription is still awaited, as text."""
        return ", ".join(self._mesh.awaited) if self._mesh else ""

    def publish(self, record: Record) -> None:
        """Give a record to all who hear its sender."""
        self._sort(record)
        if self._mesh:
            self._mesh.publish(record.uav, record.pack())

    def take(self) -> None:
        """Take in what the mesh has brought; what is no record is counted and reported once."""
        if self._mesh is None:
            return
        for payload in self._mesh.receive():
            try:
                record = Record.unpack(payload)
            except RecordError as error:
                self._bad_records += 1
                if self._bad_records == 1:
                    self._gate.tell(Said("warning", f"mesh: {error}"))
                continue
            self._sort(record)
            if record.uav in self._acknowledged:
                self._acknowledged[record.uav] = _NOTHING_MORE if record.last else record.heard

    def _sort(self, record: Record) -> None:
        for links in self._links:
            link = links.get(record.uav)
            if link is None:
                continue
            if record.last:
                link.ended = True
            elif record.sequence > link.newest:
                link.newest = record.sequence
                link.pending.append(record)

    def due(self, i: int, now_us: int) -> Iterator[tuple[int, Record]]:
        """The records for UAV ``i`` whose latency has passed, each with the index of its in-edge."""
        for edge, link in enumerate(self._links[i].values()):
            while link.pending and link.pending[0].stamp_us + self._timing.latency_us <= now_us:
                yield edge, link.pending.popleft()

    def missing(self, tick: int, alive: Sequence[int]) -> str:
        """Lockstep: what a tick of the UAVs ``alive`` (indices) still needs of the mesh, as text; empty if nothing."""
        if self._mesh is None:
            return ""
        due = tick * self._timing.period_us - self._timing.latency_us
        needed = due // self._timing.exchange_us if due >= 0 else -1
        tells = tick % self._timing.exchange_every == 0
        if needed == self._complete and not tells:
            return ""
        self.take()
        for sender, link in self._outside(alive):
            if link.newest < needed:
                return f"record {needed} of UAV {sender}"
        self._complete = needed
        if tells:
            window = _AHEAD - (-self._timing.latency_us // self._timing.exchange_us)
            awaited = tick // self._timing.exchange_every - window
            for hearer, heard in self._acknowledged.items():
                if heard < awaited and hearer not in self._gate.gone:
                    return f"UAV {hearer} to acknowledge record {awaited}"
        return ""

    def heard(self, alive: Sequence[int]) -> int:
        """Sequence number up to which the UAVs ``alive`` have received everything from outside this process."""
        return min((link.newest for _, link in self._outside(alive)), default=_NOTHING_MORE)

    def _outside(self, alive: Sequence[int]) -> Iterator[tuple[int, _Link]]:
        """In-edges from living senders in other processes."""
        for i in alive:
            for sender, link in self._links[i].items():
                if sender not in self._own and not link.ended and sender not in self._gate.gone:
                    yield sender, link

    def close(self) -> None:
        """Leave the mesh."""
        if self._mesh:
            self._mesh.close()
