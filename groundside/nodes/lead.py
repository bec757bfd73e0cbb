"""The leading computer's side: nodes join, get their processes, are watched, and bring their recordings home."""

from __future__ import annotations

import dataclasses
import subprocess
import time
from collections.abc import Callable, Iterable, Sequence
from multiprocessing.connection import wait
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ftcc.groundside.nodes.control_plane import PLANE, ControlPlane, for_node, from_node
from ftcc.groundside.nodes.files import FileError, Receiver
from ftcc.groundside.nodes.known_node import KnownNode, RemoteChild, difference, files_of, flown
from ftcc.groundside.nodes.messages import (
    Delivered,
    ForChild,
    FromChild,
    GivenUp,
    Join,
    Leaving,
    Placed,
    Refused,
    Start,
    Welcome,
)
from ftcc.groundside.nodes.plan import NodesError, NodesPlan
from ftcc.groundside.nodes.program import program
from ftcc.groundside.nodes.relay import GROUND, LISTENER, PAIR, STATION, Relay, route_of
from ftcc.groundside.swarm import Child, Exited, Part
from ftcc.link.addresses import is_loopback, resolve
from ftcc.link.gate import EventReport
from ftcc.link.mavlink import LOOPBACK
from ftcc.link.mesh import port_of
from ftcc.link.mesh_keys import LEAD
from ftcc.link.mesh_security import lead_access
from ftcc.link.ports import PortBlock
from ftcc.link.process import MeshPlace, Setting

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission

__all__ = ["Nodes"]

_LEAST_START = 0.3
"""Wall time between sending a pace to other computers and its first tick, at least, s."""
_ROUND_TRIPS = 6.0
"""The same in round trips of the slowest node."""
_WALL_TIMEOUT = 3.0
"""On the wall clock a link of the mesh over which nothing comes is given up after so long, s."""
_FAREWELL = 3.0
"""Longest wait for the nodes to leave, wall s."""
_LOG = "node-{}.log"


class Nodes:
    """The nodes of one flight; see `ftcc.groundside.swarm.Elsewhere`.

    Parameters
    ----------
    plan : which computer flies what.
    mission : the resolved scenario.
    folder : the run's.
    ports : this computer's block, for all UAVs.
    lockstep : whether all wait for each other.
    signed : whether MAVLink to the ground is signed.
    tls : folder of keys, or None: nothing is encrypted.
    """

    def __init__(
        self,
        plan: NodesPlan,
        mission: Mission,
        folder: Path,
        ports: PortBlock,
        *,
        lockstep: bool,
        signed: bool = False,
        tls: Path | None = None,
    ) -> None:
        plan.require_in(spec.uav for spec in mission.vehicles)
        self.plan = plan
        self.start_delay = _LEAST_START
        self._mission = mission
        self._folder = folder
        self._ports = ports
        self._lockstep = lockstep
        self._signed = signed
        self._tls = tls
        self._started = False
        self._nodes = {
            node.name: KnownNode(
                node,
                tuple(spec.uav for spec in mission.vehicles if plan.vehicle_at(spec.uav) == node.name),
                tuple(spec.uav for spec in mission.vehicles if plan.autopilot_at(spec.uav) == node.name),
            )
            for node in plan.nodes
        }
        address, port = resolve(plan.listen)
        self._address = address
        self.endpoint = f"{'tls' if tls else 'tcp'}/{f'[{address}]' if ':' in address else address}:{port}"
        rights = lead_access(PLANE, self._nodes)
        self._control = ControlPlane(self.endpoint, None, plan.timeout, tls, LEAD, rights)
        for name, node in self._nodes.items():
            self._control.listen_for_messages(from_node(name, "message"), name)
            self._control.listen_for_bytes(from_node(name, "file"), self._file_taker(node))
            self._control.listen_for_bytes(from_node(name, "datagram"), self._datagram_taker(node))
            self._control.watch(from_node(name, "alive"), self._token_watcher(name))
        self._control.answer(self._answer, time.time_ns)

    # Before the flight.

    def start_by_ssh(self) -> None:
        """Start `ftcc node` on each node that has an address for ssh.

        Raises
        ------
        NodesError
            If there is no ssh, or no such address.
        """
        logs = self._folder / "logs"
        logs.mkdir(exist_ok=True)
        reached = [node for node in self._nodes.values() if node.fields.ssh]
        if not reached:
            raise NodesError('--ssh: no node of the plan has ssh = "user@host"')
        for node in reached:
            secure = f"--tls {node.fields.tls}" if self._tls else "--insecure"
            command = f"{node.fields.command} node --join {self.plan.listen} --name {node.name} {secure}"
            with (logs / _LOG.format(node.name)).open("wb") as log:
                try:
                    node.ssh = subprocess.Popen(
                        ["ssh", "-o", "BatchMode=yes", node.fields.ssh, command],
                        stdin=subprocess.DEVNULL,
                        stdout=log,
                        stderr=log,
                        start_new_session=True,
                    )
                except OSError as error:
                    raise NodesError(f"--ssh: ssh cannot be started: {error.strerror}") from None

    def gather(self, report: Callable[[str], None], period: float) -> None:
        """Wait until all nodes have joined and hold their ports; Ctrl-C is noticed every ``period`` s.

        Raises
        ------
        NodesError
            If the flight cannot be with one of them.
        """
        secure = f"--tls {self._tls}" if self._tls else "--insecure"
        for name in self._nodes:
            report(f"waiting for node {name}: ftcc node --join {self.plan.listen} --name {name} {secure}")
        while any(node.placed is None for node in self._nodes.values()):
            wait([self._control.fileno()], period)
            for name, what in self._control.take():
                node = self._nodes[name]
                match what:
                    case Placed():
                        node.placed = what
                        report(f"node {name} at {node.address} flies {flown(node)}; clock {node.offset}")
                        self._check_clock(node)
                    case Leaving(why):
                        raise NodesError(f"node {name}: {why}")
                    case False:
                        node.address, node.placed = "", None
            for text in self._control.refusals():
                report(text)
            for node in self._nodes.values():
                if node.ssh is not None and node.ssh.poll() is not None:
                    raise NodesError(
                        f"node {node.name}: ssh ended; see {self._folder / 'logs' / _LOG.format(node.name)}"
                    )
        slowest = max(node.offset.uncertainty for node in self._nodes.values())
        self.start_delay = max(_LEAST_START, 2.0 * _ROUND_TRIPS * slowest)
        if self.plan.known_addresses:
            self._control.ignore_others(port_of(self.endpoint), [node.address for node in self._nodes.values()])

    def _check_clock(self, node: KnownNode) -> None:
        """Refuse the wall clock where the clock of a node is off."""
        if not self._lockstep and abs(node.offset.seconds) > self.plan.largest_offset + node.offset.uncertainty:
            raise NodesError(
                f"--clock wall: the clock of node {node.name} is off by {node.offset}; at most "
                f"{1e3 * self.plan.largest_offset:g} ms are allowed (largest_offset): synchronize the clocks by NTP or "
                "PTP, or fly with --clock lockstep"
            )

    def _answer(self, join: Any) -> Any:
        """Answer a node that wants to join; in Zenoh's thread."""
        if not isinstance(join, Join):
            return Refused("this is no request to join")
        node = self._nodes.get(join.name)
        why = ""
        if node is None:
            why = f"there is no node {join.name!r} in the plan; it has {', '.join(self._nodes)}"
        elif node.address:
            why = f"a node {join.name} has joined already"
        elif self._started:
            why = "the flight has begun without it"
        elif join.program != program():
            why = f"it has {join.program}; the leading computer has {program()}"
        elif join.scenario and join.scenario != self._mission.name:
            why = f"it is to fly {join.scenario}, the swarm flies {self._mission.name}"
        elif join.secured != (self._tls is not None):
            why = "of the two computers one has --tls and the other --insecure"
        else:
            why = difference("vehicles", join.vehicles, node.vehicles) or difference(
                "autopilots", join.autopilots, node.autopilots
            )
        if why:
            return Refused(why)
        assert node is not None
        node.address = join.address
        return Welcome(
            name=self._mission.name,
            run=self._folder.name,
            toml=self._mission.toml,
            vehicles=node.vehicles,
            autopilots=node.autopilots,
            signed=self._signed,
            timeout=self.plan.timeout,
        )

    # The processes there.

    @property
    def children(self) -> Sequence[Child]:
        """Return the processes on all nodes."""
        return [child for node in self._nodes.values() for child in node.children.values()]

    def place(self, uav: int) -> tuple[str, str]:
        """Return where the vehicle and the autopilot of a UAV fly; "" stands for this computer."""
        return self.plan.place(uav)

    def start(self, setting: Setting, parts: Sequence[Part]) -> Setting:
        """Start ``parts`` on the nodes; return the setting with the places of all processes of the mesh."""
        self._started = True
        places = {peer: self._mesh_place(peer) for peer in sorted(set(setting.peer_of.values()))}
        for name, node in self._nodes.items():
            own = tuple(part for part in parts if self._flown_at(part) == name)
            send = self._sender(name)
            node.children = {part.name: RemoteChild(part, send) for part in own}
            node.receiver = Receiver(self._folder, files_of(node))
            node.relay = self._relay_to(node, setting)
            self._control.send(
                for_node(name, "message"),
                Start(
                    parts=own,
                    swarm=setting.swarm,
                    lockstep=setting.lockstep,
                    peer_of=setting.peer_of,
                    peers=places,
                    link_timeout=self._mesh_timeout,
                    known_addresses=self.plan.known_addresses,
                    listeners=setting.listeners,
                    id_offset=setting.id_offset,
                    epoch_us=setting.epoch_us,
                ),
            )
        return dataclasses.replace(
            setting, peers=places, link_timeout=self._mesh_timeout, known_addresses=self.plan.known_addresses
        )

    @property
    def _mesh_timeout(self) -> float:
        """In lockstep nothing may be lost while a link is down; on the wall clock a new link serves sooner."""
        return self.plan.timeout if self._lockstep else min(_WALL_TIMEOUT, self.plan.timeout)

    def _flown_at(self, part: Part) -> str:
        return self.place(part.uavs[0])[0 if part.kind == "vehicle" else 1]

    def _mesh_place(self, peer: int) -> MeshPlace:
        name = self.plan.autopilot_at(peer)
        if not name:
            return MeshPlace("", self._address, self._ports.of(peer).mesh)
        node = self._nodes[name]
        return MeshPlace(name, node.address, node.block.of(peer).mesh)

    def _sender(self, name: str) -> Callable[[ForChild], None]:
        def send(message: ForChild) -> None:
            if not self._nodes[name].gone:
                self._control.send(for_node(name, "message"), message)

        return send

    def _relay_to(self, node: KnownNode, setting: Setting) -> Relay:
        """Carry datagrams to and from a node: telemetry, commands, and MAVLink of pairs that are split."""
        name, ours, theirs = node.name, self._ports, node.block
        relay = Relay(lambda data: self._control.send_bytes(for_node(name, "datagram"), data, droppable=True))
        telemetry = {theirs.of(uav).telemetry: ours.of(uav).telemetry for uav in node.autopilots}
        truth = {theirs.of(uav).truth: ours.of(uav).truth for uav in node.vehicles}
        relay.add_exit(STATION, 0, (LOOPBACK, setting.station), telemetry | truth)
        for i, address in enumerate(setting.listeners):
            if is_loopback(address[0]):
                relay.add_exit(LISTENER, i, address)
        for uav in node.autopilots:
            relay.add_entrance(GROUND, uav, ours.of(uav).ground)
            if not self.plan.vehicle_at(uav):
                relay.add_entrance(PAIR, uav, ours.of(uav).autopilot, {ours.of(uav).vehicle: 0})
        for uav in node.vehicles:
            if not self.plan.autopilot_at(uav):
                relay.add_exit(PAIR, uav, (LOOPBACK, ours.of(uav).autopilot), {0: ours.of(uav).vehicle})
        relay.start()
        return relay

    # What comes from there.

    def fileno(self) -> int:
        """Return a descriptor that is readable if something has come from a node."""
        return self._control.fileno()

    def poll(self) -> Iterable[tuple[Child | None, Any]]:
        """Return what has come: messages of the gate and `Exited`, each with its process, and events."""
        came: list[tuple[Child | None, Any]] = []
        for name, what in self._control.take():
            node = self._nodes[name]
            match what:
                case FromChild(child, message) if child in node.children:
                    came.append((node.children[child], message))
                case Delivered():
                    node.delivered = what
                case Leaving(why):
                    came += self._give_up(node, f"node {name} left: {why}")
                case False if not node.delivered:
                    came += self._give_up(node, f"node {name} at {node.address} is gone")
                case True if node.gone:
                    self._control.send(for_node(name, "message"), GivenUp())
                case FileError():
                    came.append((None, EventReport("error", f"node {name}: {what}")))
        came += [(None, EventReport("warning", text)) for text in self._control.refusals()]
        return came

    def _give_up(self, node: KnownNode, text: str) -> list[tuple[Child | None, Any]]:
        """Return what there is to say of a node that is gone; nobody waits for it any more."""
        if node.gone or not self._started:
            return []
        node.gone = True
        left = f"; what its processes recorded stays there: {node.placed.folder}" if node.placed else ""
        exits = [(child, Exited(None, why=text)) for child in node.children.values() if not child.dead]
        return [(None, EventReport("error", f"{text}{left}")), *exits]

    def _token_watcher(self, name: str) -> Callable[[bool], None]:
        return lambda there: self._control.keep(name, there)

    def _file_taker(self, node: KnownNode) -> Callable[[bytes], bool]:
        def take(data: bytes) -> bool:
            try:
                if node.receiver is not None:
                    node.receiver.take(data)
            except OSError as error:
                self._control.keep(node.name, FileError(str(error)))
            return node.receiver is not None

        return take

    def _datagram_taker(self, node: KnownNode) -> Callable[[bytes], bool]:
        def take(data: bytes) -> bool:
            route = route_of(data)
            ends = self.place(route[1]) if route and route[0] == PAIR else ("", "")
            if node.name in ends and all(ends):
                other = ends[1] if ends[0] == node.name else ends[0]
                self._control.send_bytes(for_node(other, "datagram"), data, droppable=True)
                return True
            return node.relay is not None and node.relay.deliver(data)

        return take

    # After the flight.

    def collect(self, poll: Callable[[], None]) -> None:
        """Wait until the recordings of all nodes that are there have come, as long as something comes."""
        progress, since = -1, time.monotonic()
        while waited := [node for node in self._nodes.values() if not (node.gone or node.delivered)]:
            received = sum(node.receiver.octets for node in waited if node.receiver)
            if received != progress:
                progress, since = received, time.monotonic()
            if time.monotonic() - since > self.plan.timeout:
                names = ", ".join(node.name for node in waited)
                self._control.keep(waited[0].name, FileError(f"recordings of {names} did not come home"))
                poll()
                return
            poll()

    def release(self) -> None:
        """Wait until the nodes, whose processes are released, have left; leave, too."""
        until = time.monotonic() + _FAREWELL
        left = {node.name for node in self._nodes.values() if node.gone}
        while len(left) < len(self._nodes) and time.monotonic() < until and self._started:
            time.sleep(0.02)
            left |= {name for name, what in self._control.take() if what is False}
        self.close()

    def close(self) -> None:
        """Free ports and sessions; nodes that have joined see it, and end."""
        for node in self._nodes.values():
            if node.relay is not None:
                node.relay.close()
        self._control.close()
        for node in self._nodes.values():
            if node.ssh is not None:
                if node.ssh.poll() is None:
                    node.ssh.terminate()
                node.ssh.wait()
