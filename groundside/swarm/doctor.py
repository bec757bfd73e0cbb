"""Measure whether this machine can fly a scenario, and how fast, by flying it for a few seconds.

The scenario flies in lockstep, as fast as possible, with all its processes, mesh and recording, but without a viewer
and without MAVLink listeners. A whole flight reaches the pace of these seconds. If it is below the requested speed, the
limit and the advice come from `pace`.
"""

from __future__ import annotations

import math
import os
import shutil
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import psutil  # type: ignore[import-untyped]

from ftcc.groundside.dashboard import Event, Pace
from ftcc.groundside.swarm.pace import Kind, PaceMeter, Sample, Setup, judge, processes_of, usable_cores
from ftcc.link.ports import PortError, reserve

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission

__all__ = ["Finding", "Prediction", "describe_machine", "examine", "judge_prediction", "predict"]

_MEASURED = 3.5
"""Wall time over which a flight is measured, s."""
_SETTLED = 0.7
"""Wall time after which the pace is steady, s."""
_LEAST_MEASURED = 1.0
"""Shortest measurement if the scenario is over sooner, wall s."""
_LONGEST = 36_000.0
"""Simulated duration to which a scenario is extended, so that it flies until it is stopped, s."""
_SAMPLE_PERIOD = 0.25
"""Wall time between two samples, s."""
_RESERVE = 1.15
"""Factor by which the pace must exceed the requested speed, so that other programs do not disturb it."""
_UNUSED_LISTENERS = (("127.0.0.1", 9), ("127.0.0.1", 9))
"""As many listeners as in a flight; port 9 (discard) is unused."""


class Finding(NamedTuple):
    """One row of the doctor's table."""

    what: str
    found: str
    verdict: str


@dataclass(frozen=True)
class Prediction:
    """Measured performance of a flight on this machine."""

    pack: int
    processes: int
    """Number of vehicle and autopilot processes."""
    pace: Pace
    """Pace when flying as fast as possible; the factor is nan if the flight was too short."""
    memory: float
    """Memory of all processes, shared memory counted once, bytes."""
    start: float
    """Time until all processes were ready, wall s."""
    problem: str = ""
    """Why it did not fly; empty if it did."""


def examine(
    mission: Mission,
    speed: float = 1.0,
    seconds: float = _MEASURED,
    progress: Callable[[str], None] = lambda text: None,
) -> list[Finding]:
    """Examine this machine, and measure how fast it flies ``mission``: once with ``--pack auto``, once unpacked.

    Parameters
    ----------
    speed : wanted speed, times real time; inf: as fast as possible.
    seconds : wall time over which each flight is measured, after its start.
    progress : called with the current step, which may take a minute.
    """
    from ftcc.groundside.swarm.launcher import automatic_pack

    findings = describe_machine(mission)
    if not mission.wire:
        return [*findings, Finding(mission.name, "an ideal exchange", "flies in one process only: ftcc simulate")]
    uavs = len(mission.vehicles)
    for pack in sorted({automatic_pack(uavs), 1}, reverse=True):
        how = f"--pack auto ({pack})" if pack > 1 else "unpacked"
        progress(f"flying {mission.name} {how} for {seconds:g} s")
        findings.append(judge_prediction(f"{mission.name}, {how}", predict(mission, pack, seconds), speed))
    return findings


def describe_machine(mission: Mission) -> list[Finding]:
    """Return interpreter, cores, memory, ports, compiled code, and programs that only some tests need."""
    from ftcc.link.numba_cache import cache_folder

    cores = usable_cores()
    memory = psutil.virtual_memory()
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    drivers = Path("/usr/share/vulkan/icd.d")
    vulkan = sorted(path.stem for path in drivers.glob("*.json")) if drivers.is_dir() else []
    functions = len(list(cache_folder.rglob("*.nbi")))
    return [
        Finding("Python", sys.version.split()[0], "ok"),
        Finding("cores", str(cores), "ok" if cores >= 2 else "few"),
        Finding("memory", f"{memory.available / 1e9:.1f} of {memory.total / 1e9:.1f} GB free", "ok"),
        _ports(mission),
        Finding(
            "compiled code", str(cache_folder), f"{functions} functions" if functions else "compiled at first start"
        ),
        Finding(
            "Chromium (browser tests)",
            chromium or "not found",
            "ok" if chromium and shutil.which("chromedriver") else "optional",
        ),
        Finding(
            "Mesa Vulkan (pictures without a screen)",
            ", ".join(vulkan[:3]) or "not found",
            "ok" if vulkan else "optional: mesa-vulkan-drivers",
        ),
    ]


def _ports(mission: Mission) -> Finding:
    try:
        block = reserve([spec.uav for spec in mission.vehicles])
    except PortError as error:
        return Finding("ports", str(error), "missing")
    block.release()
    return Finding("ports", f"{block.base}-{block.base + block.size - 1}", "free")


def judge_prediction(what: str, flown: Prediction, speed: float) -> Finding:
    """Compare a prediction with the wanted ``speed``."""
    if flown.problem:
        return Finding(what, "does not fly", flown.problem)
    if math.isnan(flown.pace.factor):
        return Finding(what, "too short to measure", "give it a longer duration")
    found = (
        f"{flown.pace.factor:.1f} times real time, {flown.processes} processes, {flown.memory / 1e9:.1f} GB, "
        f"ready after {flown.start:.0f} s"
    )
    why = f"{flown.pace.limit}; {flown.pace.advice}" if flown.pace.advice else flown.pace.limit
    if math.isinf(speed):
        return Finding(what, found, why)
    if flown.pace.factor >= _RESERVE * speed:
        return Finding(what, found, f"ok: holds --speed {speed:g}")
    if flown.pace.factor >= speed:
        return Finding(what, found, f"tight at --speed {speed:g}: {why}")
    return Finding(what, found, f"too slow for --speed {speed:g}: {why}")


@dataclass
class _Watch:
    """Samples a flight from within, and stops it after enough samples."""

    folder: Path
    meter: PaceMeter
    seconds: float
    duration: float
    """Duration of the scenario, simulated s."""
    created: float = field(default_factory=time.monotonic)
    begun: float = math.inf
    """When all processes were ready (monotonic, s)."""
    processes: list[tuple[str, int, Kind]] = field(default_factory=list)
    memory: float = 0.0
    samples: list[Sample] = field(default_factory=list)
    enough: bool = False
    problems: list[str] = field(default_factory=list)

    def on_start(self, _address: str | None) -> None:
        """Record that all processes are ready."""
        self.begun = time.monotonic()

    def on_event(self, event: Event) -> None:
        """Record an error of the flight."""
        if event.severity == "error" and event.t <= self.duration:
            self.problems.append(event.text.splitlines()[0])

    def on_progress(self, t: float, _pace: Pace, _late: int) -> None:
        """Take a sample at simulated time ``t``; stop the flight after enough of them."""
        now = time.monotonic()
        if self.enough or now - self.begun < _SETTLED:
            return
        if not self.processes:
            self.processes = processes_of(self.folder, os.getpid())
            self.memory = _used_memory()
            return  # this took a while, so that ``t`` is old
        if not self.samples or now - self.samples[-1].wall >= _SAMPLE_PERIOD:
            self.samples.append(self.meter.sample(now, t, self.processes, [], os.getpid()))
        if now - self.samples[0].wall >= (self.seconds if t <= self.duration else _LEAST_MEASURED):
            self.enough = True
            # In a separate thread, because this one has to answer the command.
            threading.Thread(target=_stop_swarm, args=(self.folder.name,), daemon=True).start()


def predict(mission: Mission, pack: int, seconds: float = _MEASURED) -> Prediction:
    """Fly ``mission``, measure it over ``seconds`` of wall time, and predict how a whole flight would go.

    Raises
    ------
    KeyboardInterrupt
        If the flight was stopped from outside.
    """
    from ftcc.groundside.swarm.flight import FlightOptions, fly_swarm
    from ftcc.groundside.swarm.launcher import automatic_pack

    uavs = [spec.uav for spec in mission.vehicles]
    setup = Setup(None, len(uavs), pack, automatic_pack(len(uavs)), usable_cores())
    with tempfile.TemporaryDirectory(prefix="ftcc-doctor-") as room:
        folder = Path(room)
        watch = _Watch(folder, PaceMeter(setup), seconds, mission.timing.duration)
        ticks = round(_LONGEST / mission.timing.period)
        lasting = replace(mission, timing=mission.timing._replace(ticks=max(ticks, mission.timing.ticks)))
        options = FlightOptions(folder, lockstep=True, speed=math.inf, pack=pack, listeners=_UNUSED_LISTENERS)
        processes = 2 * -(-len(uavs) // pack)
        try:
            outcome = fly_swarm(lasting, options, reserve(uavs), watch.on_event, watch.on_progress, watch.on_start)
        except (TimeoutError, PortError) as error:
            return Prediction(pack, processes, Pace(math.nan, None), 0.0, math.nan, str(error))
    if outcome.stopped and not watch.enough:
        raise KeyboardInterrupt
    pace = Pace(math.nan, None)
    if len(watch.samples) > 1:
        pace = judge(watch.samples[0], watch.samples[-1], setup)
    problem = "; ".join(watch.problems)
    return Prediction(pack, processes, pace, watch.memory, watch.begun - watch.created, problem)


def _stop_swarm(name: str) -> None:
    """Stop a running swarm."""
    from ftcc.groundside.swarm.registry import ask_swarm, find_swarm

    try:
        ask_swarm(find_swarm(name), "stop")
    except (LookupError, OSError) as error:
        # It ended by itself in the meantime.
        print(f"ftcc doctor: {error}", file=sys.stderr)


def _used_memory() -> float:
    """Return the memory of this process and its descendants, shared memory counted once, bytes."""
    total = 0.0
    for process in (psutil.Process(), *psutil.Process().children(recursive=True)):
        try:
            info = process.memory_full_info()
        except psutil.NoSuchProcess:
            continue
        total += getattr(info, "pss", info.uss)
    return total
