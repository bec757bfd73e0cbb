"""Prints what flights and their parts cost on this machine.

Ratios (times real time) are measured in one run each; compare runs on the same quiet machine only.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from ftcc.airside.autopilots import build, tick_of
from ftcc.airside.flight_path import Own
from ftcc.groundside.mission import Mission, resolve
from ftcc.groundside.scenario import load, shipped
from ftcc.groundside.simulate import fly, simulate

FTCC = [sys.executable, "-m", "ftcc.groundside.cli"]
REPEATS = 3
FLIGHT = 300.0
"""s."""
COPIES = 100
"""Of an autopilot, so that the call from Python does not count."""


def seconds(action: Callable[[], object]) -> float:
    """Wall time of an action, s."""
    begun = time.perf_counter()
    action()
    return time.perf_counter() - begun


def median(action: Callable[[], object]) -> float:
    """Median wall time of some runs after a first one that compiles and warms up, s."""
    action()
    return statistics.median(seconds(action) for _ in range(REPEATS))


def in_one_process(table: Table, folder: Path) -> None:
    """Simulations of every shipped scenario, in its first form, for at most `FLIGHT`."""
    for name in shipped():
        length = min(FLIGHT, load(name).plan.duration)
        mission = resolve(load(name, duration=length))
        flown = median(partial(fly, mission))
        recorded = median(partial(simulate_anew, mission, folder))
        table.add_row(
            f"simulate {name} {mission.form}, {len(mission.uavs)} vehicles, {length:g} s",
            f"{flown:.2f} s, recorded {recorded:.2f} s",
            f"{length / flown:.0f} x real time, recorded {length / recorded:.0f} x",
        )


def simulate_anew(mission: Mission, folder: Path) -> None:
    """Simulate and record in a new folder."""
    simulate(mission, Path(tempfile.mkdtemp(dir=folder)) / "run")


def with_processes(table: Table, folder: Path) -> None:
    """Flights in lockstep, a minute of containment each."""
    for name, pack in (("16 processes", "1"), ("--pack auto", "auto")):
        factors = []
        for repeat in range(REPEATS):
            run = subprocess.run(
                [
                    *FTCC, "fly", "containment", "--speed", "max", "--viewer", "none", "--duration", "60",
                    "--pack", pack, "--out", str(folder / f"fly-{pack}-{repeat}"),
                ],
                capture_output=True, text=True, check=True, env={**os.environ, "COLUMNS": "200"},
            )  # fmt: skip
            line = next(line for line in run.stdout.splitlines() if "times real time" in line)
            factors.append(float(line.split("(")[1].split()[0]))
        table.add_row(
            f"fly containment --speed max, {name}, 60 s",
            f"{min(factors):.1f} .. {max(factors):.1f}",
            f"median {statistics.median(factors):.1f} x real time",
        )


def start_up(table: Table, folder: Path) -> None:
    """Whole commands whose flight takes next to nothing."""
    flags = {"simulate": [], "fly": ["--speed", "max", "--viewer", "none"]}
    for command, more in flags.items():
        whole = median(partial(run_anew, [*FTCC, command, "containment", "--duration", "0.1", *more], folder))
        table.add_row(f"ftcc {command} of 0.1 s, whole command", f"{whole:.2f} s", "")


def run_anew(command: list[str], folder: Path) -> None:
    """Run a command with a new run folder."""
    subprocess.run([*command, "--out", f"{tempfile.mkdtemp(dir=folder)}/run"], capture_output=True, check=True)


def law_step(scenario: str) -> float:
    """Time of one control period of a follower amid a flight: inbox, reference, law, command; s."""
    mission = resolve(load(scenario, duration=0.2))
    flight = fly(mission)
    now = {name: flight.column(name, mission.uavs[0])[-1] for name in flight.names}
    autopilots, inbox = build(mission.autopilots[:1] * COPIES, mission.timing)
    autopilots.own[:] = [now.get(name, 0.0) for name in Own._fields]
    active, ok, controls = np.ones(COPIES, np.int64), np.ones(COPIES, np.int64), np.zeros((COPIES, 4))
    law = tick_of(mission.scheme.name)
    tick = partial(law.hear_and_control, autopilots, inbox, active, controls, ok, 0, mission.timing.period_us)
    tick()
    assert ok.all(), "a command that is not finite"
    return statistics.median(seconds(tick) for _ in range(50)) / COPIES


def laws(table: Table, folder: Path) -> None:
    """One control period of every law, compiled and as plain Python."""
    code = "import sys; from tests.bench.__main__ import law_step; print(*(law_step(name) for name in sys.argv[1:]))"
    names = list(one_scenario_per_scheme())
    measured = []
    for disable in ("0", "1"):
        environment = {**os.environ, "NUMBA_DISABLE_JIT": disable}
        command = [sys.executable, "-c", code, *names]
        run = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
        measured.append([float(word) for word in run.stdout.split()])
    for name, compiled, plain in zip(names, *measured, strict=True):
        table.add_row(
            f"one control period of {load(name).plan.scheme}",
            f"{1e6 * compiled:.2f} us, plain Python {1e6 * plain:.0f} us",
            f"ratio {plain / compiled:.0f}",
        )


def one_scenario_per_scheme() -> dict[str, str]:
    """A shipped scenario of every law that has one: scheme by scenario."""
    found: dict[str, str] = {}
    for name in shipped():
        scheme = load(name).plan.scheme
        if scheme not in found.values():
            found[name] = scheme
    return found


def dashboard(table: Table, folder: Path) -> None:
    """What the ground process pays for a picture of eight UAVs, ten of which it draws in a second of wall time."""
    from ftcc.groundside.dashboard import Dashboard
    from tests.groundside.synthetic_swarm import SUBJECT, flight

    pictures = list(flight(30.0))
    for viewer in ("none", "web"):
        recording = folder / f"{viewer}.rrd"
        shown = Dashboard(SUBJECT, recording=recording, viewer=viewer)  # type: ignore[arg-type]
        shown.log(pictures[0])
        time.sleep(3.0 if viewer == "web" else 0.0)
        begun = time.process_time()
        for picture in pictures[1:]:
            shown.log(picture)
            time.sleep(0.02)
        cost = (time.process_time() - begun) / (len(pictures) - 1)
        shown.close()
        size = recording.stat().st_size / len(pictures)
        name = "recorded" + (" and in the web viewer" if viewer == "web" else "")
        table.add_row(f"a picture of 8 UAVs, {name}", f"{1e3 * cost:.1f} ms", f"{1e3 * cost:.1f} % of a core at 10 Hz")
        table.add_row("   in the recording", f"{size / 1e3:.1f} kB", f"{10.0 * size * 3600.0 / 1e6:.0f} MB an hour")


PARTS = {"laws": laws, "simulate": in_one_process, "start": start_up, "fly": with_processes, "dashboard": dashboard}


def main() -> None:
    """The benchmarks that are named on the command line, or all."""
    table = Table("what", "measured", "", box=None)
    with tempfile.TemporaryDirectory() as folder:
        for part in sys.argv[1:] or PARTS:
            PARTS[part](table, Path(folder))
    Console(width=140).print(table)


if __name__ == "__main__":
    main()
