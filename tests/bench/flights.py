"""Flights with processes as a user starts them, watched from outside: how fast, how punctual, and who used how much."""

from __future__ import annotations

import math
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import get_args

import psutil  # type: ignore[import-untyped]

from ftcc.groundside.swarm.pace import Kind, PaceMeter, Sample, Setup, processes_of
from ftcc.groundside.swarm.registry import ask_swarm, find_swarm

__all__ = ["FTCC", "Flight", "fly"]

FTCC = [sys.executable, "-m", "ftcc.groundside.cli"]
_OUTCOME = re.compile(r"flew ([\d.]+) s in ([\d.]+) s \(([\d.]+) times real time\), (\d+) of (\d+) ticks late")
_CONTROL_RATE = 100.0
"""Hz, of all swarms that are flown here."""
_LOOK = 0.3
"""Wall time between two samples, s."""
_TAKEN_OFF = 0.3
"""Simulated time before which starting is still going on, s."""
_PATIENCE = 60.0
"""Wall time without progress after which a flight is given up, s; the first start compiles for longer."""
_FIRST_START = 600.0


@dataclass(frozen=True)
class Flight:
    """One flight."""

    factor: float
    """Times real time, as the command says; nan if it failed."""
    late: float
    """Share of late ticks."""
    processes: int
    """Of vehicles and autopilots."""
    cpu_us: dict[Kind, float] = field(default_factory=dict)
    """Processor time of each kind of process per pair and tick, us; empty if the flight was too short."""
    problem: str = ""


def fly(scenario: Path | str, uavs: int, *options: str, duration: float, viewer: str = "none") -> Flight:
    """Fly a scenario by ``ftcc fly`` in a folder that is thrown away."""
    with tempfile.TemporaryDirectory(prefix="ftcc-bench-") as room:
        folder = Path(room) / f"bench-{os.getpid()}-{time.monotonic_ns() % 1_000_000}"
        command = [*FTCC, "fly", str(scenario), "--duration", f"{duration:g}", "--out", str(folder)]
        command += ["--viewer", viewer, "--no-browser", *options]
        output = Path(room) / "output"
        with output.open("w") as file:
            environment = {**os.environ, "COLUMNS": "200"}
            run = subprocess.Popen(command, stdout=file, stderr=subprocess.STDOUT, env=environment)
            try:
                samples = _watch(run, folder, duration)
                run.wait()
            finally:
                if run.poll() is None:
                    run.terminate()
                    run.wait()
        said = output.read_text()
    processes = max((len(sample.used) for sample in samples), default=0)
    processes -= 1 + (viewer != "none") if processes else 0
    outcome = _OUTCOME.search(said)
    if run.returncode or outcome is None or float(outcome[1]) < 0.99 * duration:
        lines = said.strip().splitlines() or ["said nothing"]
        words = ("died", "lost", "wait", "not ready")
        problem = next((line for line in lines if any(word in line for word in words)), lines[-1])
        return Flight(math.nan, math.nan, processes, problem=problem.strip())
    _, _, factor, late, ticks = (float(text) for text in outcome.groups())
    return Flight(factor, late / max(ticks, 1.0), processes, _shares(samples, uavs))


def _watch(run: subprocess.Popen[bytes], folder: Path, duration: float) -> list[Sample]:
    """Samples of a running flight, from its take-off to shortly before its end."""
    samples: list[Sample] = []
    processes: list[tuple[str, int, Kind]] = []
    viewers: list[int] = []
    meter = PaceMeter(Setup(None, 0, 1, 1, 1))
    reached, until = -1.0, time.monotonic() + _FIRST_START
    while run.poll() is None:
        if time.monotonic() > until:
            run.send_signal(signal.SIGINT)
            break
        time.sleep(_LOOK if samples else 0.05)
        try:
            t = ask_swarm(find_swarm(folder.name), "status")["t"]
        except (LookupError, OSError):
            if samples:
                break  # It is over.
            continue  # It has not begun.
        if t > reached:
            reached, until = t, time.monotonic() + _PATIENCE
        if not _TAKEN_OFF <= t < duration:
            continue
        if not processes:
            processes = processes_of(folder, run.pid)
            viewers = [one.pid for one in psutil.Process(run.pid).children() if one.name() == "rerun"]
        samples.append(meter.sample(time.monotonic(), t, processes, viewers, run.pid))
    return samples


def _shares(samples: list[Sample], uavs: int) -> dict[Kind, float]:
    """Processor time by kind per pair and tick, us."""
    if len(samples) < 2 or samples[-1].t <= samples[0].t:
        return {}
    first, last = samples[0], samples[-1]
    ticks = (last.t - first.t) * _CONTROL_RATE * uavs
    used = {one: last.used[one] - first.used[one] for one in last.used if one in first.used}
    return {
        kind: 1e6 * sum(seconds for one, seconds in used.items() if one.kind == kind) / ticks for kind in get_args(Kind)
    }
