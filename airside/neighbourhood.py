"""The records that the UAVs of a process exchange with those of other processes, over the mesh.

In lockstep it also keeps for whom the process waits, and how far it may run ahead of those who hear it:
acknowledgements travel with the hearers' own transmissions.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ftcc.airside.group import AutopilotGroup
from ftcc.airside.spec import AutopilotSpec
from ftcc.link.exchange import Header, begin, new_transmission, octets_of, problem_text, take_in
from ftcc.link.gate import Gate, Said
from ftcc.link.mesh import Mesh
from ftcc.link.process import Setting

__all__ = ["Neighbourhood"]

_EVERYTHING = 2**31 - 1
"""Number of the transmission that somebody has of whom nothing more will come, or is wanted."""
_MOST_RECORDS = 256
"""In a transmission."""


class Neighbourhood:
    """The other processes that fly neighbours of this one's UAVs; they are called by the ids of their first UAVs."""

    def __init__(self, specs: Sequence[AutopilotSpec], setting: Setting, gate: Gate, group: AutopilotGroup) -> None:
        self._gate = gate
        self._group = group
        self._peer_of = setting.peer_of
        self._bad = 0
        own = {spec.uav for spec in specs}
        senders = {setting.peer_of[n.uav] for spec in specs for n in spec.neighbours if n.uav not in own}
        hearers = {setting.peer_of[uav] for spec in specs for uav in spec.hearers if uav not in own}
        linked = senders | hearers
        self._newest = dict.fromkeys(senders, -1)
        """Number of the last transmission of each process that is heard."""
        self._acknowledged = dict.fromkeys(hearers, -1)
        """Number up to which each hearing process has this one's."""
        self._incoming = new_transmission(_MOST_RECORDS, group.autopilots.shared.shape[1])
        self._mesh: Mesh | None = None
        if linked:
            group.on_mesh[0] = 1
            # A peer listens on the port of its process's first UAV; of two peers the later one connects.
            me = specs[0].uav
            connect = [setting.ports[peer].mesh for peer in sorted(linked) if peer < me]
            listen = setting.ports[me].mesh if any(peer > me for peer in linked) else None
            # In lockstep an edge is subscribed to at both ends, for the acknowledgements.
            hears, heard_by = (linked, linked) if setting.lockstep else (senders, hearers)
            self._mesh = Mesh(setting.swarm, me, hears, heard_by, listen, connect, setting.lockstep)
        self._count()

    def fileno(self) -> int:
        """Descriptor that can be read where the mesh has brought something; -1 without one."""
        return self._mesh.fileno() if self._mesh else -1

    @property
    def mail(self) -> np.ndarray:
        """(1,): 1 where the mesh has brought something."""
        return self._mesh.mail if self._mesh else np.zeros(1, np.int64)

    @property
    def ready(self) -> bool:
        """Whether all who hear this process have subscribed."""
        return self._mesh is None or self._mesh.ready

    @property
    def awaited(self) -> str:
        """Whose subscription is still awaited, as text."""
        return ", ".join(self._mesh.awaited) if self._mesh else ""

    def publish(self) -> None:
        """Put what the group has to say to other processes on the mesh."""
        if self._mesh:
            self._mesh.publish(octets_of(self._group.transmission))
        self._group.transmission.used[0] = 0

    def end(self) -> None:
        """Say that nothing more will come: nobody must wait for this process."""
        transmission = self._group.transmission
        begin(transmission, _EVERYTHING, _EVERYTHING, 1, self._group.autopilots.shared.shape[1])
        self.publish()

    def take(self) -> None:
        """Take in what the mesh has brought; what is no transmission is counted and reported once."""
        if self._mesh:
            for sender, payload in self._mesh.receive():
                self._take_in(sender, payload)
        self._count()

    def _take_in(self, sender: int, payload: bytes) -> None:
        incoming = self._incoming
        words, rest = divmod(len(payload), 8)
        if rest or words > len(incoming.words):
            self._complain(f"{len(payload)} bytes are no transmission")
            return
        incoming.words[:words] = np.frombuffer(payload, "<i8")
        incoming.used[0] = words
        problem = take_in(incoming, self._group.exchange)
        if problem:
            self._complain(problem_text(problem, incoming))
            return
        header = Header(*incoming.words[: len(Header._fields)].tolist())
        if sender in self._newest:
            self._newest[sender] = header.number
        if sender in self._acknowledged:
            self._acknowledged[sender] = header.heard

    def _complain(self, text: str) -> None:
        self._bad += 1
        if self._bad == 1:
            self._gate.tell(Said("warning", f"mesh: {text}"))

    def _count(self) -> None:
        """Tell the compiled flight up to which number everything is here and acknowledged, but for who has died."""
        gone = {self._peer_of[uav] for uav in self._gate.gone}
        newest = [number for peer, number in self._newest.items() if peer not in gone]
        acknowledged = [number for peer, number in self._acknowledged.items() if peer not in gone]
        self._group.complete[0] = min(newest, default=_EVERYTHING)
        self._group.acknowledged[0] = min(acknowledged, default=_EVERYTHING)

    def missing(self) -> str:
        """Whose transmissions or acknowledgements are the oldest, as text."""
        oldest = sorted((number, peer) for peer, number in {**self._acknowledged, **self._newest}.items())
        return ", ".join(f"UAV {peer}" for number, peer in oldest if number == oldest[0][0])

    def close(self) -> None:
        """Leave the mesh."""
        if self._mesh:
            self._mesh.close()
