"""The records that the UAVs of a process exchange with those of other processes, over the mesh.

In lockstep this also decides what a tick must wait for, and how far the process may run ahead of its receivers: their
acknowledgements travel with their own transmissions.
"""

from __future__ import annotations

import collections
import time
from collections.abc import Sequence

import numpy as np

from ftcc.airside.group import AutopilotGroup
from ftcc.airside.spec import AutopilotSpec
from ftcc.link.exchange import (
    Header,
    Transmission,
    begin,
    new_transmission,
    octets_of,
    problem_text,
    senders_in,
    take_in,
)
from ftcc.link.gate import EventReport, Gate, NetworkReport
from ftcc.link.mesh import Mesh, port_of
from ftcc.link.mesh_door import Door
from ftcc.link.mesh_keys import uav_name
from ftcc.link.mesh_refusals import RefusalCounter, RefusalTexts
from ftcc.link.mesh_security import Credentials, security, uav_access
from ftcc.link.process import Setting

__all__ = ["Neighbourhood"]

_EVERYTHING = 2**31 - 1
"""Number that stands for all transmissions, past and to come: of a process that has ended."""
_KEPT = 64
"""Transmissions kept: more than a sender may be ahead of its receivers."""
_STALLED = 5.0
"""Wall time without progress after which transmissions are sent again, s."""
_NETWORK_PERIOD = 1.0
"""Wall time between two reports on the network, s."""
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
        receivers = {setting.peer_of[uav] for spec in specs for uav in spec.receivers if uav not in own}
        linked = senders | receivers
        self._newest = dict.fromkeys(senders, -1)
        """Number of the last transmission of each sending process."""
        self._acknowledged = dict.fromkeys(receivers, -1)
        """Number up to which each receiving process has this one's."""
        self._incoming = new_transmission(_MOST_RECORDS, group.autopilots.shared.shape[1])
        self._mesh: Mesh | None = None
        self._texts: RefusalTexts | None = None
        if linked:
            group.on_mesh[0] = 1
            # A peer listens on the port of its process's first UAV; of two peers the later one connects.
            me = specs[0].uav
            connect = [setting.mesh_endpoint(peer) for peer in sorted(linked) if peer < me]
            listen = setting.mesh_endpoint(me) if any(peer > me for peer in linked) else None
            # In lockstep an edge is subscribed to at both ends, for the acknowledgements.
            sources, targets = (linked, linked) if setting.lockstep else (senders, receivers)
            far = [peer for peer in linked if setting.is_far(peer)]
            secured, refusals = {}, None
            if setting.tls is not None:
                rights = uav_access(setting.swarm, me, sources, targets)
                secured = security(Credentials(setting.tls, uav_name(me)), rights)
                names = {setting.mesh_endpoint(peer): uav_name(peer) for peer in linked}
                refusals = RefusalCounter(rights, names)
            self._mesh = Mesh(
                setting.swarm,
                me,
                sources,
                targets,
                listen,
                connect,
                setting.lockstep,
                setting.link_timeout,
                far,
                secured,
            )
            if refusals is not None:
                refusals.watch(self._mesh.session)
                self._texts = RefusalTexts(refusals)
                if setting.known_addresses and listen:
                    callers = {setting.peers[peer].address for peer in linked if peer in setting.peers}
                    self._texts.door = Door(port_of(listen), callers)
        self._own = specs[0].uav
        self._traffic = self._mesh.traffic if self._mesh else {}
        self._reported = time.monotonic()
        self._kept: collections.deque[tuple[int, bytes]] = collections.deque(maxlen=_KEPT if setting.lockstep else 0)
        """Number and octets of the last transmissions, where they may have to be sent again."""
        self._progress, self._moved = -1, time.monotonic()
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
        """Whether all receivers have subscribed."""
        return self._mesh is None or self._mesh.ready

    @property
    def awaited(self) -> str:
        """Processes that have not subscribed yet, as text."""
        return ", ".join(self._mesh.awaited) if self._mesh else ""

    def publish(self) -> None:
        """Put the group's transmission on the mesh."""
        if self._mesh:
            octets = octets_of(self._group.transmission)
            if self._traffic:
                header = Header(*self._group.transmission.words[: len(Header._fields)].tolist())
                self._kept.append((header.number, octets))
            self._mesh.publish(octets)
        self._group.transmission.used[0] = 0

    def end(self) -> None:
        """Send a last transmission, after which nobody waits for this process."""
        transmission = self._group.transmission
        begin(transmission, _EVERYTHING, _EVERYTHING, 1, self._group.autopilots.shared.shape[1])
        self.publish()

    def receive(self) -> None:
        """Read what the mesh has brought; what is no transmission is counted, and the first logged."""
        if self._mesh:
            for sender, payload in self._mesh.receive():
                self._read(sender, payload)
        self._count()

    def _read(self, sender: int, payload: bytes) -> None:
        incoming = self._incoming
        words, rest = divmod(len(payload), 8)
        if rest or words > len(incoming.words):
            self._warn_once(f"{len(payload)} bytes are no transmission")
            return
        incoming.words[:words] = np.frombuffer(payload, "<i8")
        incoming.used[0] = words
        stranger = self._not_of(sender, incoming)
        if stranger is not None:
            self._warn_once(f"the process of UAV {sender} speaks in the name of UAV {stranger}")
            return
        problem = take_in(incoming, self._group.exchange)
        if problem:
            self._warn_once(problem_text(problem, incoming))
            return
        header = Header(*incoming.words[: len(Header._fields)].tolist())
        if sender in self._traffic and header.number != _EVERYTHING:
            self._traffic[sender].numbered(header.number)
        if sender in self._newest:
            self._newest[sender] = max(self._newest[sender], header.number)
        if sender in self._acknowledged:
            self._acknowledged[sender] = max(self._acknowledged[sender], header.heard)

    def _not_of(self, sender: int, transmission: Transmission) -> int | None:
        """A UAV whose record stands in a transmission although it does not fly in the process of its sender."""
        return next((uav for uav in senders_in(transmission) if self._peer_of.get(uav) != sender), None)

    def send_again_if_stalled(self, progress: int) -> None:
        """Send again what is not acknowledged, where ``progress`` has not changed for long.

        A link to another computer that was given up while it was down has lost what was on its way.
        """
        now = time.monotonic()
        if progress != self._progress or not self._mesh:
            self._progress, self._moved = progress, now
        elif self._traffic and now - self._moved > _STALLED:
            self._moved = now
            for number, octets in self._kept:
                if number > self._group.acknowledged[0]:
                    self._mesh.publish(octets)

    def report_network(self, now_us: int, last: bool = False) -> None:
        """Report once a second, wall time, and at the end how the network serves the links with other computers."""
        if self._traffic and (last or time.monotonic() - self._reported >= _NETWORK_PERIOD):
            self._reported = time.monotonic()
            for sender, traffic in self._traffic.items():
                self._gate.report(NetworkReport(self._own, sender, now_us, *traffic.report()))

    def report_refusals(self, last: bool = False) -> None:
        """Report now and then, and at the end, who was refused by the mesh."""
        for text in self._texts.due(last) if self._texts else ():
            self._gate.report(EventReport("warning", text))

    def _warn_once(self, text: str) -> None:
        self._bad += 1
        if self._bad == 1:
            self._gate.report(EventReport("warning", f"mesh: {text}"))

    def _count(self) -> None:
        """Set up to which number everything is received and acknowledged; processes that have died do not count."""
        gone = {self._peer_of[uav] for uav in self._gate.gone}
        newest = [number for peer, number in self._newest.items() if peer not in gone]
        acknowledged = [number for peer, number in self._acknowledged.items() if peer not in gone]
        self._group.complete[0] = min(newest, default=_EVERYTHING)
        self._group.acknowledged[0] = min(acknowledged, default=_EVERYTHING)

    def missing(self) -> str:
        """The processes whose last transmission or acknowledgement is the oldest, as text."""
        oldest = sorted((number, peer) for peer, number in {**self._acknowledged, **self._newest}.items())
        return ", ".join(f"UAV {peer}" for number, peer in oldest if number == oldest[0][0])

    def close(self) -> None:
        """Leave the mesh."""
        if self._mesh:
            self._mesh.close()
        if self._texts is not None:
            self._texts.close()
