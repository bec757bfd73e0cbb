"""A start that fails: nothing is left running, nothing is waited for, and nothing is said to have flown."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import psutil

from tests.sitl.conftest import Flight

INTERRUPTED = """
import sys
from ftcc.groundside.cli import main
from ftcc.groundside.swarm.children import LocalProcesses

spawn = LocalProcesses._spawn

def interrupted(self, context, part, *rest):
    if part.kind == "autopilot":
        print("process", self.children[0].process.pid, flush=True)
        raise KeyboardInterrupt
    spawn(self, context, part, *rest)

LocalProcesses._spawn = interrupted
sys.argv = ["ftcc", "fly", "demo", "--viewer", "none", "--mavlink", "none", "--out", sys.argv[1]]
main()
"""


def test_ctrl_c_while_processes_start_ends_the_launcher_and_those_that_run(
    tmp_path: Path, environment: dict[str, str]
) -> None:
    """Ctrl-C comes when the first vehicle waits for the launcher's go."""
    ended = subprocess.run(
        [sys.executable, "-c", INTERRUPTED, str(tmp_path / "run")],
        env=environment,
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )
    assert ended.returncode != 0, ended.stdout + ended.stderr
    (process,) = [int(line.split()[1]) for line in ended.stdout.splitlines() if line.startswith("process ")]
    assert not psutil.pid_exists(process)


def test_ctrl_c_while_the_first_start_compiles_ends_it_without_a_word(
    fly: Callable[..., Flight], environment: dict[str, str], tmp_path: Path
) -> None:
    """In a terminal all its processes get it; two compile, side by side."""
    environment["FTCC_CACHE_DIR"] = str(tmp_path / "empty cache")

    def compiling() -> list[psutil.Process]:
        found = []
        for one in flight.processes():
            with contextlib.suppress(psutil.NoSuchProcess):
                found += [one] * ("forkserver" in " ".join(one.cmdline()))
        return found

    flight = fly("demo", "--mavlink", "none")
    flight.wait_until(lambda: len(compiling()) == 2)
    processes = compiling()
    os.killpg(flight.process.pid, signal.SIGINT)
    assert flight.wait(60.0) == 130
    assert "Traceback" not in flight.output
    _, alive = psutil.wait_procs(processes, timeout=20.0)
    assert not alive


def test_a_flight_whose_processes_died_before_it_has_not_flown(fly: Callable[..., Flight]) -> None:
    flight = fly("containment", "--hold", "--pack", "8", "--mavlink", "none", "--duration", "1")
    flight.wait_until(lambda: "held at t = 0" in flight.output)
    for name in ("uav1-8-vehicle", "uav1-8-autopilot"):
        flight.child(name).kill()
    assert flight.wait(30.0) == 1
    assert "process uav1-8-vehicle died (killed by signal 9)" in flight.output
    assert "nothing flew" in flight.output
    assert "flew 0.0 s" not in flight.output
