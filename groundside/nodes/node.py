"""A node: joins a swarm, runs its share of the processes, and sends home what they recorded."""

from __future__ import annotations

import dataclasses
import selectors
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ftcc.groundside.nodes.clock import measure, with_monotonic
from ftcc.groundside.nodes.control_plane import PLANE, ControlPlane, for_node, from_node
from ftcc.groundside.nodes.files import pieces, recorded_files
from ftcc.groundside.nodes.messages import (
    Delivered,
    ForChild,
    FromChild,
    GivenUp,
    Join,
    Kill,
    Leaving,
    Placed,
    Refused,
    Start,
    Welcome,
)
from ftcc.groundside.nodes.plan import NodesError
from ftcc.groundside.nodes.program import program
from ftcc.groundside.nodes.relay import GROUND, LISTENER, PAIR, STATION, Relay
from ftcc.groundside.swarm import Exited, LocalProcesses
from ftcc.link.addresses import Address, is_loopback
from ftcc.link.gate import Ended, Stop
from ftcc.link.mavlink import LOOPBACK
from ftcc.link.mesh_keys import node_name, uav_name
from ftcc.link.mesh_security import Credentials, node_access
from ftcc.link.ports import PortBlock, PortError, reserve
from ftcc.link.process import Setting

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission

__all__ = ["NodeOptions", "run_node"]

_ASK = 2.0
"""Longest wait for the answer of a leading computer, wall s."""
_UNTIL_WELCOME = 10.0
"""Silence after which a link is given up before the plan's timeout is known, wall s."""
_PAUSE = 0.5
"""Wall time between two questions whether it is there, s."""
_FLUSH = 0.2
"""Wall time for a last message to leave, s."""
_LEAD_GONE = "the leading computer is gone"
_END_TIMEOUT = 5.0
"""Time for processes to end by themselves where the leading computer is gone, wall s."""


@dataclasses.dataclass(frozen=True)
class NodeOptions:
    """How a node takes part."""

    lead: Address
    """Where the leading computer listens."""
    name: str
    scenario: str = ""
    """The only scenario that it flies; "" = any."""
    vehicles: tuple[int, ...] | None = None
    autopilots: tuple[int, ...] | None = None
    """The only ids that it flies; None: what the plan says."""
    address: str = ""
    """Numeric address at which other computers reach it; "": that from which it reaches the leading computer."""
    tls: Path | None = None
    """Folder of keys; None: nothing is encrypted."""
    key: Path | None = None
    """Key file for signed MAVLink messages to the ground."""


def run_node(
    options: NodeOptions,
    load: Callable[[Path], Mission],
    new_folder: Callable[[str], Path],
    say: Callable[[str], None],
) -> bool:
    """Take part in one flight, from joining to its end; return whether it ended as the leading computer wanted.

    Parameters
    ----------
    options : how it takes part.
    load : reads the scenario of a run's folder.
    new_folder : makes the folder of a run of the scenario with that name.
    say : prints a line for the user.

    Raises
    ------
    NodesError
        If it may not take part, or cannot.
    """
    with ExitStack() as stack:
        host, port = options.lead
        shown = f"[{host}]" if ":" in host else host
        endpoint = f"{'tls' if options.tls else 'tcp'}/{shown}:{port}"
        say(f"node {options.name}: waiting for the swarm at {shown}:{port}")
        welcome = _let_in(endpoint, options, say)
        # Each end of a link tells the other after which silence it is to be given up, so both need the plan's.
        control = _linked(endpoint, options, welcome.timeout)
        stack.callback(control.close)
        control.listen_for_messages(for_node(options.name, "message"), "lead")
        control.watch_lead(lambda there: control.keep("lead", there))
        if not _is_there(control, welcome.timeout):
            say(f"{_LEAD_GONE} before the flight began")
            return False
        control.live(from_node(options.name, "alive"))
        node = _Node(options, control, welcome, say)
        with _said_to_lead(control, options.name):
            node.place(load, new_folder, stack)
            start = node.wait_for_start()
            if start is not None:
                node.require_keys(start)
        if start is None:
            say(f"{_LEAD_GONE} before the flight began")
            return False
        return node.fly(start, stack)


@contextmanager
def _said_to_lead(control: ControlPlane, name: str) -> Iterator[None]:
    """Tell the leading computer why this node leaves, if it does so within the ``with`` block."""
    try:
        yield
    except BaseException as error:
        why = "it was interrupted" if isinstance(error, KeyboardInterrupt) else str(error)
        control.send(from_node(name, "message"), Leaving(why))
        time.sleep(_FLUSH)
        raise


def _linked(endpoint: str, options: NodeOptions, timeout: float) -> ControlPlane:
    """Return a session towards the leading computer, to be given up after ``timeout`` s of silence."""
    rights = node_access(PLANE, options.name)
    return ControlPlane(None, endpoint, timeout, options.tls, node_name(options.name), rights)


def _let_in(endpoint: str, options: NodeOptions, say: Callable[[str], None]) -> Welcome:
    """Ask by a session of its own until the leading computer answers."""
    control = _linked(endpoint, options, _UNTIL_WELCOME)
    try:
        return _join(control, options, say)
    finally:
        control.close()


def _is_there(control: ControlPlane, seconds: float) -> bool:
    """Wait until the link to the leading computer stands; return whether it does within ``seconds``."""
    until = time.monotonic() + seconds
    with selectors.DefaultSelector() as selector:
        selector.register(control, selectors.EVENT_READ)
        while (left := until - time.monotonic()) > 0.0:
            selector.select(left)
            if ("lead", True) in control.take():
                return True
    return False


def _join(control: ControlPlane, options: NodeOptions, say: Callable[[str], None]) -> Welcome:
    """Ask until the leading computer answers."""
    request = Join(
        name=options.name,
        scenario=options.scenario,
        vehicles=options.vehicles,
        autopilots=options.autopilots,
        program=program(),
        address=options.address or _own_address(options.lead),
        secured=options.tls is not None,
    )
    while True:
        answer = control.ask_to_join(request, _ASK)
        match answer:
            case Welcome():
                return answer
            case Refused(why):
                raise NodesError(f"node {options.name}: refused: {why}")
        for text in control.refusals():
            say(text)
        time.sleep(_PAUSE)


def _own_address(lead: Address) -> str:
    """Return the address from which the leading computer is reached."""
    family = socket.AF_INET6 if ":" in lead[0] else socket.AF_INET
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(lead)  # looks up the route, sends nothing
        except OSError as error:
            raise NodesError(f"--join {lead[0]}:{lead[1]}: {error.strerror}") from None
        return str(probe.getsockname()[0])


class _Node:
    """A node that has been let in."""

    def __init__(
        self, options: NodeOptions, control: ControlPlane, welcome: Welcome, say: Callable[[str], None]
    ) -> None:
        self.options = options
        self.control = control
        self.welcome = welcome
        self.say = say
        self.stopping_since: float | None = None
        self.lead_gone = False
        """For good: its processes end then."""
        self.given_up = False
        """Whether the leading computer has said so."""

    def send(self, message: Any) -> None:
        """Send a message to the leading computer."""
        self.control.send(from_node(self.options.name, "message"), message)

    def place(self, load: Callable[[Path], Mission], new_folder: Callable[[str], Path], stack: ExitStack) -> None:
        """Read the scenario, hold ports, compare clocks, and say so."""
        if self.welcome.signed and self.options.key is None:
            raise NodesError("the links to the ground are signed: give the key file by --key")
        self.folder = new_folder(self.welcome.name)
        (self.folder / "scenario.toml").write_text(self.welcome.toml, encoding="utf-8")
        self.mission = load(self.folder)
        try:
            self.block: PortBlock = reserve(sorted({*self.welcome.vehicles, *self.welcome.autopilots}))
        except PortError as error:
            raise NodesError(str(error)) from None
        stack.callback(self.block.release)
        offset = measure(self.control.ask_clock)
        if offset is None:
            raise NodesError("the leading computer does not answer any more")
        self.offset = offset
        self.send(Placed(f"{socket.gethostname()}:{self.folder.resolve()}", self.block.base, *offset))
        self.say(f"node {self.options.name}: joined {self.welcome.run}; clock of the leading computer {offset}")

    def wait_for_start(self) -> Start | None:
        """Return what is to start; None if the leading computer is gone before."""
        with selectors.DefaultSelector() as selector:
            selector.register(self.control, selectors.EVENT_READ)
            while True:
                selector.select()
                for _, what in self.control.take():
                    if isinstance(what, Start):
                        return what
                    if what is False:
                        return None

    def require_keys(self, start: Start) -> None:
        """Refuse to start processes whose keys cannot be used."""
        if self.options.tls is not None:
            for part in start.parts:
                if part.kind == "autopilot":
                    Credentials(self.options.tls, uav_name(part.uavs[0]))

    def fly(self, start: Start, stack: ExitStack) -> bool:
        """Run the processes until they are released; return whether the leading computer was there all the time."""
        relay, setting = self._setting(start)
        stack.callback(relay.close)
        self.control.listen_for_bytes(for_node(self.options.name, "datagram"), relay.deliver)
        self.local = LocalProcesses(self.mission, setting)
        self.local.start(start.parts)
        stack.callback(self.local.release)
        self.by_name = {child.name: child for child in self.local.children}
        try:
            self._run()
        except KeyboardInterrupt:
            self.send(Leaving("it was interrupted"))
            self._stop()
            self._run_until_ended()
            raise
        if self.lead_gone:
            why = "the swarm flies on without this node, which it had lost" if self.given_up else _LEAD_GONE
            self.say(f"node {self.options.name}: {why}; recorded in {self.folder}")
        else:
            self.say(f"node {self.options.name}: over; recorded in {self.folder}")
        return not self.lead_gone

    def _setting(self, start: Start) -> tuple[Relay, Setting]:
        """Return the way of datagrams to the leading computer, begun, and what the processes here get."""
        key = from_node(self.options.name, "datagram")
        relay = Relay(lambda data: self.control.send_bytes(key, data, droppable=True))
        block, vehicles, autopilots = self.block, self.welcome.vehicles, self.welcome.autopilots
        telemetry = [block.of(uav).telemetry for uav in autopilots]
        truth = [block.of(uav).truth for uav in vehicles]
        relay.add_entrance(STATION, 0, block.station, {port: port for port in (*telemetry, *truth)})
        listeners = tuple(
            (LOOPBACK, relay.add_entrance(LISTENER, i)) if is_loopback(address[0]) else address
            for i, address in enumerate(start.listeners)
        )
        for uav in autopilots:
            relay.add_exit(GROUND, uav, (LOOPBACK, block.of(uav).ground))
            if uav not in vehicles:
                relay.add_exit(PAIR, uav, (LOOPBACK, block.of(uav).autopilot), {0: block.of(uav).vehicle})
        for uav in set(vehicles) - set(autopilots):
            relay.add_entrance(PAIR, uav, block.of(uav).autopilot, {block.of(uav).vehicle: 0})
        relay.start()
        setting = Setting(
            swarm=start.swarm,
            timing=self.mission.timing,
            lockstep=start.lockstep,
            ports={uav: block.of(uav) for uav in block.uavs},
            peer_of=start.peer_of,
            station=block.station,
            folder=self.folder,
            listeners=listeners,
            key=self.options.key,
            home=self.mission.home,
            id_offset=start.id_offset,
            epoch_us=start.epoch_us,
            computer=self.options.name,
            peers=start.peers,
            link_timeout=start.link_timeout,
            known_addresses=start.known_addresses,
            tls=self.options.tls,
        )
        return relay, setting

    def _run(self) -> None:
        """Carry messages both ways until all processes have ended, send the recordings, wait for the release."""
        delivered = False
        while not self._all_gone:
            self._wait()
            if not delivered and self._all_ended and not self.lead_gone:
                self._deliver()
                delivered = True
            if self.lead_gone and self.stopping_since is None:
                self._stop()
            self._kill_if_late()

    def _run_until_ended(self) -> None:
        while not self._all_ended:
            self._wait()
            self._kill_if_late()

    @property
    def _all_ended(self) -> bool:
        return all(child.ended or child.dead for child in self.local.children)

    @property
    def _all_gone(self) -> bool:
        return all(child.dead for child in self.local.children) or (self.lead_gone and self._all_ended)

    def _stop(self) -> None:
        self.stopping_since = time.monotonic()
        for child in self.local.children:
            child.send(Stop())

    def _kill_if_late(self) -> None:
        if self.stopping_since is not None and time.monotonic() - self.stopping_since > _END_TIMEOUT:
            for child in self.local.children:
                if not (child.ended or child.dead):
                    child.kill()

    def _wait(self) -> None:
        """Wait for something to come from the processes or the leading computer, and carry it to the other side."""
        with selectors.DefaultSelector() as selector:
            for source in (self.local, self.control):
                selector.register(source, selectors.EVENT_READ)
            selector.select(0.1)
        for child, message in self.local.poll():
            if isinstance(message, Ended):
                child.ended = message
            child.dead = child.dead or isinstance(message, Exited)
            self.send(FromChild(child.name, message))
        for text in self.control.refusals():
            self.say(text)
        for _, what in self.control.take():
            match what:
                case ForChild(name, Kill()) if name in self.by_name:
                    self.by_name[name].kill()
                case ForChild(name, message) if name in self.by_name:
                    # On the wall clock the hosts' clocks count, which NTP keeps; in lockstep nothing depends on it.
                    offset = self.offset.seconds if self.local.setting.lockstep else 0.0
                    self.by_name[name].send(with_monotonic(message, offset))
                case False | GivenUp():
                    self.lead_gone = True
                    self.given_up = self.given_up or isinstance(what, GivenUp)
                case True if self.lead_gone:
                    # It may not have missed this node, whose processes end now.
                    self.send(Leaving("it had lost the leading computer"))

    def _deliver(self) -> None:
        """Send home what the processes recorded."""
        files = recorded_files(self.folder)
        for path in files:
            for piece in pieces(self.folder, path):
                self.control.send_bytes(from_node(self.options.name, "file"), piece, droppable=False)
        self.send(Delivered(len(files)))
