"""A launcher that is ended while its processes start leaves none of them, and does not wait for them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import psutil

INTERRUPTED = """
import sys
from ftcc.groundside.cli import main
from ftcc.groundside.launcher import Swarm

spawn = Swarm._spawn

def interrupted(self, context, kind, *rest):
    if kind == "autopilot":
        print("process", self.children[0].process.pid, flush=True)
        raise KeyboardInterrupt
    spawn(self, context, kind, *rest)

Swarm._spawn = interrupted
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
