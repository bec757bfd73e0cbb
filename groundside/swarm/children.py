"""The processes of a swarm that run on this computer: forked, watched, ended. What they say is for others to judge.

Children are forked from a fork server that has loaded all compiled code. Each has a log.
"""

from __future__ import annotations

import abc
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
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ftcc.groundside.swarm.preloading import ACTIVE_VARIABLE, PLANT_VARIABLE, SCHEME_VARIABLE
from ftcc.link.gate import Ended
from ftcc.link.process import Setting, process_main

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission

__all__ = ["Child", "Exited", "LocalChild", "LocalProcesses", "Part", "Role", "log_tail", "no_main_module"]

_END_TIMEOUT = 1.2
"""Time for processes to exit by themselves, wall s."""
_TAIL_LINES = 12
"""Lines of a dead process's log that are reported."""

Role = Literal["vehicle", "autopilot"]
"""Kind of a process."""


@dataclass(frozen=True)
class Part:
    """What one process of the swarm flies."""

    kind: Role
    uavs: tuple[int, ...]

    @property
    def name(self) -> str:
        """Return the name of the process, by which its log and its end are reported."""
        span = f"{self.uavs[0]}" if len(self.uavs) == 1 else f"{self.uavs[0]}-{self.uavs[-1]}"
        return f"uav{span}-{self.kind}"


@dataclass(frozen=True)
class Exited:
    """Said of a process: it is gone."""

    code: int | None
    """Exit code, or minus the signal that killed it; None: unknown."""
    tail: str = ""
    """The last lines of its log."""
    why: str = ""
    """What is known instead of an exit code."""

    def __str__(self) -> str:
        """Return the end of a sentence that begins with the name of the process."""
        killed = self.code is not None and self.code < 0
        how = self.why or (f"killed by signal {-(self.code or 0)}" if killed else f"exit code {self.code}")
        return f"died ({how})" + (f": {self.tail}" if self.tail else "")


class Child(abc.ABC):
    """One process of the swarm, wherever it runs."""

    def __init__(self, part: Part) -> None:
        self.part = part
        self.ready = False
        self.ended: Ended | None = None
        self.dead = False

    @property
    def name(self) -> str:
        """Return the name of the process."""
        return self.part.name

    @property
    def uavs(self) -> tuple[int, ...]:
        """Return the ids of its UAVs."""
        return self.part.uavs

    @property
    def kind(self) -> Role:
        """Return whether it flies vehicles or autopilots."""
        return self.part.kind

    @abc.abstractmethod
    def send(self, message: Any) -> None:
        """Send a message of the gate; one to a process that has ended is lost."""

    @abc.abstractmethod
    def kill(self) -> None:
        """End the process at once."""


class LocalChild(Child):
    """A process on this computer."""

    def __init__(self, part: Part, process: BaseProcess, pipe: Connection) -> None:
        super().__init__(part)
        self.process = process
        self.pipe = pipe

    def send(self, message: Any) -> None:
        """Send a message; a child that has ended is detected by its sentinel."""
        with contextlib.suppress(BrokenPipeError, ConnectionResetError, OSError):
            self.pipe.send(message)

    def kill(self) -> None:
        """End the process at once."""
        self.process.kill()


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


def log_tail(folder: Path, name: str) -> str:
    """Return the last lines of a process's log in a run's folder."""
    path = folder / "logs" / f"{name}.log"
    lines = path.read_text(errors="replace").strip().splitlines() if path.exists() else []
    return "\n".join(lines[-_TAIL_LINES:])


class LocalProcesses:
    """The processes of a run on this computer.

    Parameters
    ----------
    mission : the resolved scenario.
    setting : what every process gets of the run.
    """

    def __init__(self, mission: Mission, setting: Setting) -> None:
        self.mission = mission
        self.setting = setting
        self.children: list[LocalChild] = []
        self._selector = selectors.DefaultSelector()

    def start(self, parts: Sequence[Part]) -> None:
        """Start the processes of ``parts``."""
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
            for part in parts:
                if part.kind == "vehicle":
                    self._spawn(context, part, run_vehicles, [vehicles[uav] for uav in part.uavs])
                else:
                    self._spawn(context, part, run_autopilots, [autopilots[uav] for uav in part.uavs])

    def _spawn(self, context: Any, part: Part, run: Callable[..., None], specs: Sequence[Any]) -> None:
        ours, theirs = context.Pipe()
        # A daemon process ends with the launcher, even if the launcher ends before it has sent a stop, as with Ctrl-C
        # while processes start. Otherwise each would wait for the other forever.
        process = context.Process(
            target=process_main, args=(part.name, theirs, self.setting, run, specs), name=part.name, daemon=True
        )
        process.start()
        theirs.close()
        child = LocalChild(part, process, ours)
        self.children.append(child)
        for source in (ours, process.sentinel):
            self._selector.register(source, selectors.EVENT_READ, child)

    def fileno(self) -> int:
        """Return a descriptor that is readable if a process has sent a message or has ended."""
        return self._selector.fileno()

    def poll(self) -> Iterator[tuple[LocalChild, Any]]:
        """Yield what the processes have sent, and `Exited` for one that is gone, with the process."""
        for child in {key.data.name: key.data for key, _ in self._selector.select(0.0)}.values():
            with contextlib.suppress(EOFError, ConnectionResetError):
                while child.pipe.poll():
                    yield child, child.pipe.recv()
            if not child.process.is_alive():
                for source in (child.pipe, child.process.sentinel):
                    self._selector.unregister(source)
                child.process.join()
                yield child, Exited(child.process.exitcode, log_tail(self.setting.folder, child.name))

    def release(self) -> None:
        """Wait until the processes, which were all told to, have ended; end those that do not."""
        self._selector.close()
        until = time.monotonic() + _END_TIMEOUT
        for child in self.children:
            child.process.join(max(0.0, until - time.monotonic()))
            if child.process.is_alive():
                child.process.kill()
                child.process.join()
            child.pipe.close()
