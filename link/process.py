"""What every process of a swarm shares: its setting, waiting for sockets, its log, telemetry's pace, its end."""

from __future__ import annotations

import contextlib
import faulthandler
import os
import resource
import selectors
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

from ftcc.link.gate import Gate, LauncherGoneError
from ftcc.link.mavlink import LOOPBACK
from ftcc.link.ports import UavPorts
from ftcc.link.timing import Timing

__all__ = ["RESEND", "MeshPlace", "Setting", "Stall", "Telemetry", "Waiter", "process_main"]

_TELEMETRY = 0.1
"""Least period of telemetry, simulated and wall s."""
RESEND = 0.05
"""Wall time after which a datagram that was not answered is sent again (lockstep), s."""
_STALL = 10.0
"""Wall time without progress after which a process reports for which UAVs it waits, s."""


class MeshPlace(NamedTuple):
    """Where an autopilot process is reached by others of its mesh."""

    computer: str
    address: str
    """Numeric."""
    port: int


@dataclass(frozen=True)
class Setting:
    """What a process gets of its run beside the specifications of its UAVs."""

    swarm: str
    timing: Timing
    lockstep: bool
    ports: dict[int, UavPorts]
    peer_of: dict[int, int]
    """The first UAV of the autopilot process in which each UAV flies."""
    station: int
    """Port of the ground station."""
    folder: Path
    """The run's folder."""
    listeners: tuple[tuple[str, int], ...] = ()
    """Addresses where other ground stations may listen: they get telemetry, their ports are never bound."""
    key: Path | None = None
    """Key file: with it messages to ground stations are signed, and theirs must be."""
    home: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where the origin of the local frame lies: latitude, longitude (deg), altitude of z = 0 (m)."""
    id_offset: int = 0
    """Added to a UAV's id to make its MAVLink system id towards the ground."""
    epoch_us: int = 0
    """Unix time that counts as simulated time 0, us."""
    computer: str = ""
    """Name of the computer on which the process runs; "" where all do."""
    peers: Mapping[int, MeshPlace] = field(default_factory=dict)
    """By the first UAV of each autopilot process, where its mesh is, if the swarm flies on several computers."""
    link_timeout: float = 1.0
    """Wall time after which a mesh link over which nothing comes counts as broken, s."""
    tls: Path | None = None
    """Folder of keys: with it the mesh is encrypted, and speaks only to those who belong to it."""
    known_addresses: bool = False
    """Whether the mesh ignores callers from addresses that are none of the swarm's computers."""

    def system(self, uav: int) -> int:
        """MAVLink system id of a UAV towards the ground."""
        return uav + self.id_offset

    def mesh_endpoint(self, peer: int) -> str:
        """Where the mesh of an autopilot process, named by its first UAV, is reached: "tcp/127.0.0.1:20008"."""
        scheme = "tcp" if self.tls is None else "tls"
        if peer in self.peers:
            place = self.peers[peer]
            host = f"[{place.address}]" if ":" in place.address else place.address
            return f"{scheme}/{host}:{place.port}"
        return f"{scheme}/{LOOPBACK}:{self.ports[peer].mesh}"

    def is_far(self, peer: int) -> bool:
        """Whether an autopilot process, named by its first UAV, runs on another computer."""
        return peer in self.peers and self.peers[peer].computer != self.computer


class Waiter:
    """Waits for any of several sockets and pipes, and calls their handlers."""

    def __init__(self) -> None:
        self._selector = selectors.DefaultSelector()

    def add(self, source: Any, handle: Callable[[], None]) -> None:
        """Call ``handle`` when ``source`` (with ``fileno``) can be read."""
        self._selector.register(source, selectors.EVENT_READ, handle)

    def wait(self, seconds: float) -> bool:
        """Wait at most ``seconds`` and handle what can be read; False if nothing came."""
        ready = self._selector.select(max(0.0, seconds))
        for key, _ in ready:
            key.data()
        return bool(ready)

    def fileno(self) -> int:
        """A descriptor that is readable when one of them is."""
        return self._selector.fileno()

    def close(self) -> None:
        self._selector.close()


class Telemetry:
    """When telemetry is due: at 10 Hz simulated or wall, whichever is slower, and at the end."""

    def __init__(self, timing: Timing) -> None:
        self.every = max(1, round(_TELEMETRY / timing.period))
        """Ticks between two at which telemetry may be due."""
        self._end = timing.ticks
        self._last = -1e9

    def due(self, tick: int) -> bool:
        """Whether telemetry is due at this tick."""
        if tick == self._end:
            return True
        if tick % self.every:
            return False
        now = time.monotonic()
        # A tenth of slack: a tick that comes a little early must not halve the rate.
        if now - self._last < 0.9 * _TELEMETRY:
            return False
        self._last = now
        return True


class Stall:
    """Notices that a process makes no progress."""

    def __init__(self) -> None:
        self._since = time.monotonic()
        self._said = False

    def progress(self) -> None:
        """Note that there is progress."""
        self._since = time.monotonic()
        self._said = False

    @property
    def long(self) -> bool:
        """True once, when there has been none for 10 s."""
        if self._said or time.monotonic() - self._since < _STALL:
            return False
        self._said = True
        return True


@contextlib.contextmanager
def _log(path: Path) -> Iterator[None]:
    """Send standard output and error, also of C code and of a crash, to the process's log."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", buffering=1) as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
        faulthandler.enable(file)
        yield
        sys.stdout.flush()
        sys.stderr.flush()
        faulthandler.disable()


def process_main(name: str, pipe: Connection, setting: Setting, main: Callable[..., None], specs: Any) -> None:
    """Body of every child process: ``main(specs, setting, gate)`` under a log; exit code 1 if it raises.

    Ctrl-C is for the launcher: it reaches the children as a message.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    code = 0
    with _log(setting.folder / "logs" / f"{name}.log"):
        try:
            main(specs, setting, Gate(pipe))
        except LauncherGoneError:
            print("the launcher is gone: ending", flush=True)
            code = 3
        except Exception:
            traceback.print_exc()
            code = 1
        used = resource.getrusage(resource.RUSAGE_SELF)
        print(
            f"used {used.ru_utime:.2f} s user, {used.ru_stime:.2f} s system, {used.ru_maxrss / 1024:.0f} MB", flush=True
        )
    # Skip the interpreter's clean-up: files are closed, and foreign threads must not keep a process alive.
    os._exit(code)
