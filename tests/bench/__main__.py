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
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from ftcc.airside.autopilots import build, tick_of
from ftcc.groundside.mission import resolve
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
        flown = median(lambda mission=mission: fly(mission))
        table.add_row(f"simulate containment, {form}, 400 s", f"{flown:.2f} s", f"{400.0 / flown:.0f} x real time")
        count = iter(range(100))
        recorded = median(lambda mission=mission, count=count: simulate(mission, folder / f"{form}{next(count)}"))
        table.add_row("   the same with its recording", f"{recorded:.2f} s", "")


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
    for name, arguments in (
        ("simulate", ["simulate", "containment", "--duration", "0.1"]),
        ("fly", ["fly", "containment", "--speed", "max", "--viewer", "none", "--duration", "0.1"]),
    ):
        count = iter(range(100))
        command = [*FTCC, *arguments, "--out"]
        whole = median(
            lambda command=command, name=name, count=count: subprocess.run(
                [*command, str(folder / f"start-{name}{next(count)}")], capture_output=True, check=True
            )
        )
        table.add_row(f"ftcc {name} of 0.1 s, whole command", f"{whole:.2f} s", "")


def law_step(table: Table) -> None:
    """One tick of one follower's law (two sub-steps), called from Python, and as plain Python."""
    mission = resolve(load("containment", form="flight"))
    for mode in ("compiled, called from Python", "plain Python"):
        autopilots, inbox = build(mission.autopilots[:1], mission.timing)
        autopilots.own[0, 3:5] = 1000.0, 30.0
        control = tick_of("containment").control
        if mode == "plain Python":
            code = (
                "import tests.bench.__main__ as b; from rich.table import Table; t = Table('a', 'b', 'c'); "
                "b.law_step(t); print(list(t.columns[1].cells)[0])"
            )
            environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
            run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
            table.add_row(f"law of containment, {mode}", run.stdout.strip(), "")
            return
        control(autopilots, inbox, 0, 0.01)
        times = [seconds(lambda: control(autopilots, inbox, 0, 0.01)) for _ in range(2000)]
        table.add_row(f"law of containment, {mode}", f"{1e6 * np.median(times):.1f} us", "")
        if os.environ.get("NUMBA_DISABLE_JIT"):
            return


def main() -> None:
    """All benchmarks."""
    table = Table("what", "measured", "", box=None)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        law_step(table)
        in_one_process(table, folder)
        start_up(table, folder)
        with_processes(table, folder)
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
