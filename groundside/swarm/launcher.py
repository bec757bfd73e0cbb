"""Launch a swarm: start its processes together, monitor them, and end them.

The launcher handles processes, ports and pipes, not physics. Children are forked from a fork server that has loaded all
compiled code. Each child has a log; if it dies, the end of the log is reported.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import multiprocessing.connection
import os
import selectors
import subprocess
import sys
import threading
import time
import types
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ftcc.groundside.dashboard import Event
from ftcc.groundside.swarm.flow import Flow
from ftcc.groundside.swarm.preloading import ACTIVE_VARIABLE, PLANT_VARIABLE, SCHEME_VARIABLE
from ftcc.link.gate import Ended, EventReport, Go, Gone, Held, LawFailed, Lost, Ready, Release, Stop
from ftcc.link.ports import PortBlock
from ftcc.link.process import Setting, process_main
from ftcc.link.recording import AIRCRAFT_LOST

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission
    from ftcc.groundside.verdict import Verdict

__all__ = ["Child", "Outcome", "SwarmProcesses", "automatic_pack"]

_END_TIMEOUT = 1.2
"""Time for processes to end by themselves, wall s."""
_ENDED_ON_REQUEST = (0, 3, 255, -9, -15)
"""Exit codes that are normal after a stop, also for SIGTERM to the process group or a fork server that ended first."""
_TAIL_LINES = 12
"""Lines of a dead process's log that are reported."""


def automatic_pack(uavs: int) -> int:
    """Return the number of vehicles per process that uses every core with as few processes as possible."""
    pairs = max(1, (os.cpu_count() or 2) // 2)
    return max(1, -(-uavs // pairs))


Role = Literal["vehicle", "autopilot"]
"""Kind of a process."""


@dataclass
class Child:
    """One process of the swarm."""

    name: str
    uavs: tuple[int, ...]
    kind: Role
    process: BaseProcess
    pipe: Connection
    ready: bool = False
    ended: Ended | None = None
    dead: bool = False

    def send(self, message: Any) -> None:
        """Send a message; a child that has ended is detected by its sentinel."""
        with contextlib.suppress(BrokenPipeError, ConnectionResetError, OSError):
            self.pipe.send(message)


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


_main_module_lock = threading.Lock()
"""Swarms may be started by several threads."""


_compiled: list[tuple[str, str, bool]] = []
"""Scheme, plant and whether with active fault tolerance: what has flown; the fork server has loaded the first."""


def _compile_beside_fork_server(what: tuple[str, str, bool]) -> None:
    """Compile what the fork server, which runs already, has not loaded: otherwise each child would, at the same time.

    Where this fails, the children do it, and report what is wrong.
    """
    if _compiled and what not in _compiled:
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        load = [sys.executable, "-c", "import ftcc.groundside.swarm.preload"]
        subprocess.run(
            load, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            check=False,
        )  # fmt: skip
    _compiled.append(what)


@contextlib.contextmanager
def no_main_module() -> Iterator[None]:
    """Keep children from importing the program that started this process."""
    with _main_module_lock:
        main = sys.modules["__main__"]
        sys.modules["__main__"] = types.ModuleType("__main__")
        try:
            yield
        finally:
            sys.modules["__main__"] = main


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
        on_event: Callable[[Event], None],
    ) -> None:
        self.mission = mission
        self.folder = folder
        self.lockstep = lockstep
        self.on_event = on_event
        self.outcome = Outcome()
        self.children: list[Child] = []
        self._selector = selectors.DefaultSelector()
        self.stopping_since: float | None = None
        self.flow = Flow(mission.timing.period, speed, lockstep, held, self.send_to_all, self._flying_vehicles)
        uavs = [spec.uav for spec in mission.vehicles]
        groups = [tuple(uavs[start : start + pack]) for start in range(0, len(uavs), pack)]
        self.setting = Setting(
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
        )
        self.groups = groups

    def start(self) -> None:
        """Start all processes."""
        # Imported here, because only the children need them.
        from ftcc.airside.process import main as run_autopilots
        from ftcc.airside.spec import is_active
        from ftcc.sim.process import main as run_vehicles

        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        os.environ[SCHEME_VARIABLE] = self.mission.scheme.name
        os.environ[PLANT_VARIABLE] = self.mission.plant
        active = is_active(self.mission.autopilots)
        os.environ[ACTIVE_VARIABLE] = str(int(active))
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(["ftcc.groundside.swarm.preload"])
        _compile_beside_fork_server((self.mission.scheme.name, self.mission.plant, active))
        vehicles = {spec.uav: spec for spec in self.mission.vehicles}
        autopilots = {spec.uav: spec for spec in self.mission.autopilots}
        with no_main_module():
            for group in self.groups:
                self._spawn(context, "vehicle", group, run_vehicles, [vehicles[uav] for uav in group])
                self._spawn(context, "autopilot", group, run_autopilots, [autopilots[uav] for uav in group])

    def _spawn(
        self,
        context: Any,
        kind: Literal["vehicle", "autopilot"],
        group: tuple[int, ...],
        run: Callable[..., None],
        specs: Sequence[Any],
    ) -> None:
        span = f"{group[0]}" if len(group) == 1 else f"{group[0]}-{group[-1]}"
        name = f"uav{span}-{kind}"
        ours, theirs = context.Pipe()
        # A daemon process ends with the launcher, even if the launcher ends before it has sent a stop, as with Ctrl-C
        # while processes start. Otherwise each would wait for the other forever.
        process = context.Process(
            target=process_main, args=(name, theirs, self.setting, run, specs), name=name, daemon=True
        )
        process.start()
        theirs.close()
        child = Child(name, group, kind, process, ours)
        self.children.append(child)
        for source in (ours, process.sentinel):
            self._selector.register(source, selectors.EVENT_READ, child)

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
        """Handle the messages of the processes, and detect processes that have ended."""
        for child in {key.data.name: key.data for key, _ in self._selector.select(0.0)}.values():
            with contextlib.suppress(EOFError, ConnectionResetError):
                while child.pipe.poll():
                    self._handle_message(child, child.pipe.recv())
            if not child.process.is_alive():
                self._handle_exit(child)
        if self.stopping_since is not None and time.monotonic() - self.stopping_since > _END_TIMEOUT:
            for child in self.children:
                if not (child.ended or child.dead):
                    child.process.kill()

    def _handle_message(self, child: Child, message: Any) -> None:
        match message:
            case Ready():
                child.ready = True
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
            case EventReport(severity, text, uav, at_us, who, outcome):
                self.on_event(Event(-1.0 if at_us is None else at_us / 1e6, severity, text, uav, who, outcome))

    def _handle_exit(self, child: Child) -> None:
        """Handle the end of a process: if unexpected, report it, stop its partner, and make no other wait for it."""
        child.dead = True
        for source in (child.pipe, child.process.sentinel):
            self._selector.unregister(source)
        child.process.join()
        if child.ended:
            return
        if self.stopping_since is None or child.process.exitcode not in _ENDED_ON_REQUEST:
            self.outcome.died.append(child.name)
            code = child.process.exitcode
            how = f"killed by signal {-code}" if code is not None and code < 0 else f"exit code {code}"
            tail = self.log_tail(child.name)
            self.on_event(Event(-1.0, "error", f"process {child.name} died ({how})" + (f": {tail}" if tail else "")))
        for other in self.children:
            if other.uavs == child.uavs:
                other.send(Stop())
            elif other.kind == "autopilot":
                for uav in child.uavs:
                    other.send(Gone(uav))

    def log_tail(self, name: str) -> str:
        """Return the last lines of a process's log."""
        path = self.folder / "logs" / f"{name}.log"
        lines = path.read_text(errors="replace").strip().splitlines() if path.exists() else []
        return "\n".join(lines[-_TAIL_LINES:])

    def release(self) -> None:
        """Release the processes, which have all ended their flight, and wait until they exit."""
        self._selector.close()
        for child in self.children:
            child.send(Release())
        until = time.monotonic() + _END_TIMEOUT
        for child in self.children:
            child.process.join(max(0.0, until - time.monotonic()))
            if child.process.is_alive():
                child.process.kill()
                child.process.join()
            child.pipe.close()
