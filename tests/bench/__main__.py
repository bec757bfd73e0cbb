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

from rich.console import Console
from rich.table import Table

from ftcc.airside.autopilots import build, tick_of
from ftcc.groundside.mission import Mission, resolve
from ftcc.groundside.scenario import load
from ftcc.groundside.simulate import fly, simulate

FTCC = [sys.executable, "-m", "ftcc.groundside.cli"]
REPEATS = 3


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
    """Simulations of the whole containment scenario."""
    for form in ("flight", "monograph"):
        mission = resolve(load("containment", form=form))
        flown = median(partial(fly, mission))
        table.add_row(f"simulate containment, {form}, 400 s", f"{flown:.2f} s", f"{400.0 / flown:.0f} x real time")
        recorded = median(partial(simulate_anew, mission, folder))
        table.add_row("   the same with its recording", f"{recorded:.2f} s", "")


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


def law_step() -> float:
    """Time of one tick of one follower's law (two sub-steps), called from Python, s."""
    mission = resolve(load("containment", form="flight"))
    autopilots, inbox = build(mission.autopilots[:1], mission.timing)
    autopilots.own[0, 3:5] = 1000.0, 30.0
    step = partial(tick_of("containment").control, autopilots, inbox, 0, 0.01)
    step()
    return statistics.median(seconds(step) for _ in range(2000))


def laws(table: Table) -> None:
    """One tick of the law, compiled and as plain Python."""
    code = "from tests.bench.__main__ import law_step; print(law_step())"
    for name, disable in (("compiled, called from Python", "0"), ("plain Python", "1")):
        environment = {**os.environ, "NUMBA_DISABLE_JIT": disable}
        run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
        table.add_row(f"law of containment, {name}", f"{1e6 * float(run.stdout):.1f} us", "")


def main() -> None:
    """All benchmarks."""
    table = Table("what", "measured", "", box=None)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        laws(table)
        in_one_process(table, folder)
        start_up(table, folder)
        with_processes(table, folder)
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
