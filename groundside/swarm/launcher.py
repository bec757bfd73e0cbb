"""The swarm of one run, as its launcher sees it: started together, judged by what its processes say, and ended.

Its processes run on this computer (`children`) or, if some are placed on others, there too (`Elsewhere`). The launcher
handles processes, ports and messages, not physics.
"""

from __future__ import annotations

import os
import selectors
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, get_args

from ftcc.groundside.dashboard import Event
from ftcc.groundside.swarm.children import Child, Exited, LocalChild, LocalProcesses, Part, Role
from ftcc.groundside.swarm.flow import START, Flow
from ftcc.groundside.swarm.network_log import NetworkLog
from ftcc.link.gate import Ended, EventReport, Go, Gone, Held, LawFailed, Lost, NetworkReport, Ready, Release, Stop
from ftcc.link.ports import PortBlock
from ftcc.link.process import Setting
from ftcc.link.recording import AIRCRAFT_LOST, NETWORK_FILE

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission
    from ftcc.groundside.verdict import Verdict

__all__ = ["Elsewhere", "Outcome", "SwarmProcesses", "automatic_pack", "grouped"]

_END_TIMEOUT = 1.2
"""Time for processes to end by themselves, wall s."""
_ENDED_ON_REQUEST = (0, 3, 255, -9, -15)
"""Exit codes that are normal after a stop, also for SIGTERM to the process group or a fork server that ended first."""


def automatic_pack(uavs: int) -> int:
    """Return the number of vehicles per process that uses every core with as few processes as possible."""
    pairs = max(1, (os.cpu_count() or 2) // 2)
    return max(1, -(-uavs // pairs))


def grouped(uavs: Sequence[int], pack: int, place: Callable[[int], Any] = lambda _: None) -> list[tuple[int, ...]]:
    """Return which UAVs fly in one process: at most ``pack``, and only those with the same ``place``."""
    groups: list[tuple[int, ...]] = []
    for uav in uavs:
        if groups and len(groups[-1]) < pack and place(groups[-1][0]) == place(uav):
            groups[-1] += (uav,)
        else:
            groups.append((uav,))
    return groups


class Elsewhere(Protocol):
    """The processes of a swarm that run on other computers."""

    @property
    def children(self) -> Sequence[Child]:
        """Return the processes there."""
        ...

    @property
    def start_delay(self) -> float:
        """Return the wall time that a pace needs to reach them, s."""
        ...

    def place(self, uav: int) -> tuple[str, str]:
        """Return where the vehicle and the autopilot of a UAV fly; "" stands for this computer."""
        ...

    def start(self, setting: Setting, parts: Sequence[Part]) -> Setting:
        """Start ``parts`` there; return the setting of the processes here, which now know where the others are."""
        ...

    def fileno(self) -> int:
        """Return a descriptor that is readable if something has come from there."""
        ...

    def poll(self) -> Iterable[tuple[Child | None, Any]]:
        """Return what has come: messages of the gate and `Exited`, each with its process."""
        ...

    def collect(self, poll: Callable[[], None]) -> None:
        """Bring the parts of the recording home, calling ``poll`` while they come."""
        ...

    def release(self) -> None:
        """End what is left there."""
        ...


@dataclass
class Outcome:
    """Result of a flight."""

    died: list[str] = field(default_factory=list)
    """Names of processes that died."""
    lost: dict[int, str] = field(default_factory=dict)
    """UAVs whose aircraft was lost, with the reason."""
    law_error: str = ""
    """The error that the control law raised, with file and line; empty: none."""
    late: int = 0
    ticks: int = 0
    """Ticks flown by all vehicles together."""
    flown: int = 0
    """Largest number of ticks that any UAV flew."""
    stopped: bool = False
    """Whether the flight was ended early on request."""
    verdict: Verdict | None = None
    """None if nothing was recorded."""

    @property
    def ok(self) -> bool:
        """Return whether no process died, no aircraft was lost and the law raised no error."""
        return not (self.died or self.lost or self.law_error)


class SwarmProcesses:
    """The processes of one run.

    Parameters
    ----------
    mission : the resolved scenario.
    folder : the run's folder.
    ports : a reserved block.
    lockstep : whether processes wait for each other and the clock; otherwise for the clock alone.
    speed : largest number of simulated seconds per second; inf (only in lockstep): as fast as possible.
    pack : vehicles per process.
    held : hold before the first tick until `Flow.resume`.
    listeners : addresses to which telemetry for other ground stations is sent.
    key : key file for signed MAVLink messages to the ground.
    id_offset : MAVLink system id of a UAV minus its id.
    started : Unix time of simulated time 0, s; default: now.
    elsewhere : the processes on other computers, which have joined.
    tls : folder of keys, with which the mesh is encrypted and speaks only to those who belong to it.
    on_event : called with every event.
    """

    def __init__(
        self,
        mission: Mission,
        folder: Path,
        ports: PortBlock,
        *,
        lockstep: bool,
        speed: float = 1.0,
        pack: int = 1,
        held: bool = False,
        listeners: tuple[tuple[str, int], ...] = (),
        key: Path | None = None,
        id_offset: int = 0,
        started: float | None = None,
        elsewhere: Elsewhere | None = None,
        tls: Path | None = None,
        on_event: Callable[[Event], None],
    ) -> None:
        self.mission = mission
        self.folder = folder
        self.lockstep = lockstep
        self.on_event = on_event
        self.outcome = Outcome()
        self._network = NetworkLog(folder)
        self._network_trouble = ""
        self.children: list[Child] = []
        self.stopping_since: float | None = None
        self._elsewhere = elsewhere
        self._place: Callable[[int], tuple[str, str]] = elsewhere.place if elsewhere else lambda _: ("", "")
        self.flow = Flow(
            mission.timing.period,
            speed,
            lockstep,
            held,
            self.send_to_all,
            self._flying_vehicles,
            elsewhere.start_delay if elsewhere else START,
        )
        uavs = [spec.uav for spec in mission.vehicles]
        groups = grouped(uavs, pack, self._place)
        setting = Setting(
            swarm=f"{folder.name}-{os.getpid()}",
            timing=mission.timing,
            lockstep=lockstep,
            ports={uav: ports.of(uav) for uav in uavs},
            peer_of={uav: group[0] for group in groups for uav in group},
            station=ports.station,
            folder=folder,
            listeners=listeners,
            key=key,
            home=mission.home,
            id_offset=id_offset,
            epoch_us=round((time.time() if started is None else started) * 1e6),
            tls=tls,
        )
        self._parts = [Part(kind, group) for group in groups for kind in get_args(Role)]
        if elsewhere:
            setting = elsewhere.start(setting, [part for part in self._parts if self._flies_elsewhere(part)])
        self._here = LocalProcesses(mission, setting)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._here, selectors.EVENT_READ)
        if elsewhere:
            self._selector.register(elsewhere, selectors.EVENT_READ)

    def _flies_elsewhere(self, part: Part) -> bool:
        """Return whether a part is placed on another computer."""
        return bool(self._place(part.uavs[0])[0 if part.kind == "vehicle" else 1])

    def start(self) -> None:
        """Start all processes on this computer; those elsewhere have been told to start."""
        self._here.start([part for part in self._parts if not self._flies_elsewhere(part)])
        self.children = [*self._here.children, *(self._elsewhere.children if self._elsewhere else ())]

    @property
    def local(self) -> list[LocalChild]:
        """Return the processes on this computer that still fly."""
        return [child for child in self._here.children if not (child.ended or child.dead)]

    @property
    def ready(self) -> bool:
        """Return whether every living process waits for the start of the flight."""
        return all(child.ready or child.dead for child in self.children)

    @property
    def over(self) -> bool:
        """Return whether every process has flown its ticks or died."""
        return all(child.ended or child.dead for child in self.children)

    def go(self) -> None:
        """Start the flight, at the same time for all processes."""
        self.send_to_all(Go(*self.flow.begin()))

    @property
    def flying(self) -> list[Child]:
        """Return the processes that still fly."""
        return [child for child in self.children if not (child.ended or child.dead)]

    def _flying_vehicles(self) -> list[str]:
        """Return the names of the vehicle processes that still fly."""
        return [child.name for child in self.flying if child.kind == "vehicle"]

    def send_to_all(self, message: Any) -> None:
        """Send a message to every process."""
        for child in self.children:
            child.send(message)

    def stop(self) -> None:
        """End the flight now, in an orderly way."""
        if self.stopping_since is None:
            self.stopping_since = time.monotonic()
            self.outcome.stopped = not self.over
            self.send_to_all(Stop())

    def fileno(self) -> int:
        """Return a descriptor that is readable if a process has sent a message or has ended."""
        return self._selector.fileno()

    def poll(self) -> None:
        """Handle the messages of the processes, and of those that have ended."""
        came = [*self._here.poll(), *(self._elsewhere.poll() if self._elsewhere else ())]
        for child, message in came:
            self._handle_message(child, message)
        if self.stopping_since is not None and time.monotonic() - self.stopping_since > self._end_timeout:
            for child in self.children:
                if not (child.ended or child.dead):
                    child.kill()

    @property
    def _end_timeout(self) -> float:
        return _END_TIMEOUT + (2.0 * self._elsewhere.start_delay if self._elsewhere else 0.0)

    def _handle_message(self, child: Child | None, message: Any) -> None:
        """Handle a message of a process, or of another computer."""
        match message:
            case EventReport(severity, text, uav, at_us, who, outcome):
                self.on_event(Event(-1.0 if at_us is None else at_us / 1e6, severity, text, uav, who, outcome))
            case NetworkReport():
                self._log_network(message)
            case _ if child is None:
                raise ValueError(f"{message} belongs to a process")
            case Ready():
                child.ready = True
            case Exited():
                self._handle_exit(child, message)
            case Ended(tick, late, ticks):
                child.ended = message
                self.outcome.flown = max(self.outcome.flown, min(tick, self.mission.timing.ticks))
                if child.kind == "vehicle":
                    self.outcome.late += late
                    self.outcome.ticks += ticks
            case Held(tick):
                self.flow.mark_held(child.name, tick)
            case Lost(uav, at_us, reason):
                self.outcome.lost[uav] = reason
                self.on_event(Event(at_us / 1e6, "error", f"{AIRCRAFT_LOST}{reason}", uav))
            case LawFailed(text, at_us):
                if not self.outcome.law_error:
                    self.outcome.law_error = text
                    self.on_event(Event(at_us / 1e6, "error", text))
                self.stop()

    def _log_network(self, report: NetworkReport) -> None:
        try:
            self._network.write(report)
        except OSError as error:
            if not self._network_trouble:
                self._network_trouble = f"{NETWORK_FILE} is not written any further: {error.strerror or error}"
                self.on_event(Event(-1.0, "error", self._network_trouble))

    def _handle_exit(self, child: Child, exited: Exited) -> None:
        """Handle the end of a process: if unexpected, report it, stop its partner, and make no other wait for it."""
        child.dead = True
        if child.ended:
            return
        if self.stopping_since is None or exited.code not in _ENDED_ON_REQUEST:
            self.outcome.died.append(child.name)
            self.on_event(Event(-1.0, "error", f"process {child.name} {exited}"))
        for other in self.children:
            if other.uavs == child.uavs:
                other.send(Stop())
            elif other.kind == "autopilot":
                for uav in child.uavs:
                    other.send(Gone(uav))

    def collect(self, poll: Callable[[], None]) -> None:
        """Bring home what was recorded on other computers, calling ``poll`` meanwhile; all processes have ended."""
        if self._elsewhere:
            self._elsewhere.collect(poll)

    def release(self) -> None:
        """Release the processes, which have all ended their flight, and wait until they exit."""
        self._selector.close()
        self._network.close()
        self.send_to_all(Release())
        self._here.release()
        if self._elsewhere:
            self._elsewhere.release()
