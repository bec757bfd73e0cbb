"""Stubs: pairs of processes that do only what the wire between a vehicle and its autopilot demands.

The vehicle sends ATTITUDE_QUATERNION and LOCAL_POSITION_NED in one datagram over a connected loopback socket, waits
for one HIL_ACTUATOR_CONTROLS and reads it; the autopilot does the reverse. In lockstep within a pair, no mesh, no law,
no recording. Once with pymavlink, message by message in Python, and once with a single compiled loop. What a flight
reaches beside them shows what everything else in it costs.
"""

from __future__ import annotations

import multiprocessing
import resource
import signal
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

from pymavlink.dialects.v20 import common as dialect

__all__ = ["KINDS", "StubResult", "fly_stub"]

CONTROL_RATE = 100.0
"""Ticks in a simulated second."""
_TRIED = 500
"""Ticks after which it is known how many make a measurement."""
_PATIENCE = 120.0
"""Wall time for anything, s."""
_UNUSED = (0.0,) * 12


@dataclass(frozen=True)
class StubResult:
    """What pairs of stub processes reach."""

    factor: float
    """Times real time at 100 Hz of the slowest pair."""
    vehicle_us: float
    """Processor time of a vehicle process a tick, us."""
    autopilot_us: float

    @property
    def pair_us(self) -> float:
        """Of a pair, us."""
        return self.vehicle_us + self.autopilot_us


def _bare(component: int) -> Any:
    mav = dialect.MAVLink(None, srcSystem=1, srcComponent=component)
    mav.robust_parsing = True
    return mav


def _python_vehicle(link: socket.socket, ticks: int) -> int:
    """Send ``ticks`` states and wait for the command that answers each; the number of answers."""
    mav = _bare(25)
    elevator = 0.0
    for tick in range(ticks):
        attitude = dialect.MAVLink_attitude_quaternion_message(
            10 * tick, 1.0, 0.1, 0.2, 0.3 + elevator, 0.01, 0.02, 0.03
        )
        position = dialect.MAVLink_local_position_ned_message(10 * tick, 100.0 + tick, 5.0, -1000.0, 30.0, 0.1, 0.2)
        datagram = attitude.pack(mav)
        mav.seq = (mav.seq + 1) % 256
        datagram += position.pack(mav)
        mav.seq = (mav.seq + 1) % 256
        link.send(datagram)
        (answer,) = mav.parse_buffer(link.recv(4096))
        if answer.get_type() != "HIL_ACTUATOR_CONTROLS" or answer.time_usec != 10_000 * tick:
            return tick
        elevator = answer.controls[1]
    return ticks


def _python_autopilot(link: socket.socket, ticks: int) -> int:
    """Answer ``ticks`` states with a command each; the number of states."""
    mav = _bare(1)
    for tick in range(ticks):
        attitude, position = mav.parse_buffer(link.recv(4096))
        if attitude.get_type() != "ATTITUDE_QUATERNION" or position.get_type() != "LOCAL_POSITION_NED":
            return tick
        controls = (0.1 * attitude.q2, 0.1 * attitude.q3, 0.0, 0.5 + 1e-6 * position.x, *_UNUSED)
        command = dialect.MAVLink_hil_actuator_controls_message(1000 * attitude.time_boot_ms, controls, 0, 0)
        link.send(command.pack(mav))
        mav.seq = (mav.seq + 1) % 256
    return ticks


def _compiled_vehicle(link: socket.socket, ticks: int) -> int:
    from tests.bench.compiled_wire import fly_vehicle

    return int(fly_vehicle(link.fileno(), ticks))


def _compiled_autopilot(link: socket.socket, ticks: int) -> int:
    from tests.bench.compiled_wire import fly_autopilot

    return int(fly_autopilot(link.fileno(), ticks))


KINDS: dict[str, tuple[Callable[[socket.socket, int], int], Callable[[socket.socket, int], int]]] = {
    "pymavlink": (_python_vehicle, _python_autopilot),
    "compiled": (_compiled_vehicle, _compiled_autopilot),
}
"""Vehicle and autopilot of each stub."""


def _member(fly: Callable[[socket.socket, int], int], warm_up: int, ticks: int, parent: Connection) -> None:
    """Body of a stub process: its port to the parent, its peer's from it, then a short and the measured exchange."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends it
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind(("127.0.0.1", 0))
        parent.send(link.getsockname()[1])
        link.connect(("127.0.0.1", parent.recv()))
        parent.send("connected")
        parent.recv()
        fly(link, 1)  # the first call loads, or compiles
        flown = fly(link, warm_up)
        parent.send("ready")
        parent.recv()
        used, begun = resource.getrusage(resource.RUSAGE_SELF), time.perf_counter()
        flown += fly(link, ticks)
        took, now = time.perf_counter() - begun, resource.getrusage(resource.RUSAGE_SELF)
        cpu = now.ru_utime - used.ru_utime + now.ru_stime - used.ru_stime
        parent.send((flown - warm_up, took, cpu))


def _received(pipe: Connection) -> Any:
    if not pipe.poll(_PATIENCE):
        raise TimeoutError(f"a stub process has said nothing for {_PATIENCE:.0f} s")
    return pipe.recv()


def _run(kind: str, pairs: int, ticks: int) -> StubResult:
    """Fly ``pairs`` for exactly ``ticks``."""
    context = multiprocessing.get_context("forkserver")
    # Loaded once, for all.
    context.set_forkserver_preload(["tests.bench.stubs", "tests.bench.compiled_wire"])
    processes, pipes = [], []
    try:
        for _ in range(pairs):
            for fly in KINDS[kind]:
                ours, theirs = context.Pipe()
                process = context.Process(target=_member, args=(fly, 20, ticks, theirs), daemon=True)
                process.start()
                theirs.close()
                processes.append(process)
                pipes.append(ours)
        ports = [_received(pipe) for pipe in pipes]
        for n, pipe in enumerate(pipes):
            pipe.send(ports[n ^ 1])
        for said in ("connected", "ready"):
            for pipe in pipes:
                if _received(pipe) != said:
                    raise RuntimeError(f"a stub process did not become {said}")
            for pipe in pipes:
                pipe.send("go")
        results = [_received(pipe) for pipe in pipes]
    finally:
        for process in processes:
            process.kill()
            process.join()
        for pipe in pipes:
            pipe.close()
    if any(flown != ticks for flown, _, _ in results):
        raise RuntimeError(f"the {kind} stub did not understand a datagram")
    slowest = max(took for _, took, _ in results)
    vehicle, autopilot = (
        1e6 * sum(cpu for _, _, cpu in results[side::2]) / (pairs * ticks) for side in (0, 1)
    )  # fmt: skip
    return StubResult(ticks / slowest / CONTROL_RATE, vehicle, autopilot)


def fly_stub(kind: str, pairs: int, seconds: float = 3.0) -> StubResult:
    """Fly ``pairs`` of stub processes of a kind of `KINDS` for about ``seconds`` of wall time."""
    tried = _run(kind, pairs, _TRIED)
    ticks = round(tried.factor * CONTROL_RATE * seconds)
    return _run(kind, pairs, ticks) if ticks > _TRIED else tried
