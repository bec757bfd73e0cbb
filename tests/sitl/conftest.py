"""Flights with real processes, driven from the command line as a user drives them."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import psutil
import pyarrow.parquet as pq
import pytest

from ftcc.groundside import Run

FTCC = [sys.executable, "-m", "ftcc.groundside.cli"]


class Flight:
    """A running `ftcc fly`."""

    def __init__(self, arguments: list[str], folder: Path, environment: dict[str, str]) -> None:
        self.folder = folder
        self.environment = environment
        self._output = folder.with_suffix(".txt")
        self._output.parent.mkdir(parents=True, exist_ok=True)
        with self._output.open("w") as output:
            self.process = subprocess.Popen(
                [*FTCC, "fly", *arguments, "--viewer", "none", "--out", str(folder)],
                stdout=output,
                stderr=subprocess.STDOUT,
                env={**environment, "COLUMNS": "200"},
                start_new_session=True,
            )

    @property
    def output(self) -> str:
        return self._output.read_text()

    def wait(self, seconds: float = 240.0) -> int:
        """Exit code."""
        return self.process.wait(seconds)

    def interrupt(self) -> None:
        """Ctrl-C in the launcher's terminal."""
        os.kill(self.process.pid, signal.SIGINT)

    def processes(self) -> list[psutil.Process]:
        """All processes that the launcher has started, however deep."""
        return psutil.Process(self.process.pid).children(recursive=True)

    def child(self, name: str) -> psutil.Process:
        """The process that writes the log of that name, e.g. "uav3-autopilot"."""
        log = str((self.folder / "logs" / f"{name}.log").resolve())
        for process in self.processes():
            try:
                if os.readlink(f"/proc/{process.pid}/fd/1") == log:
                    return process
            except OSError:
                continue
        raise AssertionError(f"no process writes {log}; output so far:\n{self.output}")

    def wait_until(self, condition: Callable[[], bool], seconds: float = 240.0) -> None:
        """Wait for a condition while the flight goes on."""
        until = time.monotonic() + seconds
        while not condition():
            assert self.process.poll() is None, f"ended with {self.process.returncode}:\n{self.output}"
            assert time.monotonic() < until, f"waited in vain:\n{self.output}"
            time.sleep(0.02)

    def wait_until_flying(self) -> None:
        """Wait until every process has recorded something."""
        self.wait_until(lambda: all(part.stat().st_size > 8_000 for part in self._parts()) and len(self._parts()) > 8)

    def _parts(self) -> list[Path]:
        found = (self.folder / "parts").glob("*.arrows")
        return [part for part in found if not part.stem.endswith("-links")]


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """The environment of a user of this test alone: running swarms are listed apart from everybody else's."""
    return {**os.environ, "FTCC_RUNTIME_DIR": str(tmp_path / "runtime")}


@pytest.fixture
def fly(tmp_path: Path, environment: dict[str, str]) -> Iterator[Callable[..., Flight]]:
    """Start `ftcc fly` with arguments; whatever still runs at the end of the test is killed."""
    flights: list[Flight] = []

    def start(*arguments: str, name: str = "run") -> Flight:
        flight = Flight(list(arguments), tmp_path / name, environment)
        flights.append(flight)
        return flight

    yield start
    for flight in flights:
        if flight.process.poll() is None:
            leftovers = flight.processes()
            flight.process.kill()
            for process in leftovers:
                if process.is_running():
                    process.kill()


def burn() -> None:
    while True:
        sum(range(1000))


@pytest.fixture
def busy_machine() -> Iterator[None]:
    """Two processes that take what they can get of both cores."""
    workers = [multiprocessing.get_context("spawn").Process(target=burn, daemon=True) for _ in range(2)]
    for worker in workers:
        worker.start()
    yield
    for worker in workers:
        worker.kill()
        worker.join()


@pytest.fixture
def ftcc(environment: dict[str, str]) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run an `ftcc` command to its end."""

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [*FTCC, *arguments],
            env={**environment, "COLUMNS": "200"},
            capture_output=True,
            text=True,
            timeout=240,
            check=False,
        )

    return run


def events(folder: Path) -> list[dict[str, object]]:
    """The events of a run by time, then by UAV: of what several report of one instant, any may be heard first."""
    lines = (folder / "events.jsonl").read_text().splitlines()
    return sorted(map(json.loads, lines), key=lambda event: (event["t"], event["uav"] or 0))


def same_flight(one: Path, other: Path) -> bool:
    """Whether two runs recorded the same, bit for bit (nan equals nan)."""
    a, b = (pq.read_table(folder / "signals.parquet") for folder in (one, other))
    links = [Run(folder).links for folder in (one, other)]
    return a.schema.equals(b.schema, check_metadata=True) and all(
        np.array_equal(ours, theirs, equal_nan=True)
        for ours, theirs in [
            *((a[name].to_numpy(), b[name].to_numpy()) for name in a.column_names),
            *((links[0][name], links[1][name]) for name in links[0]),
        ]
    )
