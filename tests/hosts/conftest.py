"""A swarm of twelve UAVs on three hosts: four on each, those of the leading computer with both leaders."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from ftcc.groundside.scenario import load, resolve
from ftcc.groundside.swarm.preloading import ACTIVE_VARIABLE, PLANT_VARIABLE, SCHEME_VARIABLE
from tests.hosts.network import Host, Network, why_not

FTCC = [sys.executable, "-m", "ftcc.groundside.cli"]
PORT = 7447
PLAN = """
listen = "{address}:{port}"
timeout = {timeout}
[[nodes]]
name = "b"
uavs = "3-6"
[[nodes]]
name = "c"
uavs = "7-10"
"""


@pytest.fixture(scope="session", autouse=True)
def hosts_are_possible() -> None:
    """Skip, with the reason, where this machine lets nobody have namespaces."""
    reason = why_not()
    if reason:
        pytest.skip(reason)


@pytest.fixture(scope="package")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten followers on a ring and two leaders, with the plant and the law of chapter 5; records get lost."""
    path = tmp_path_factory.mktemp("scenario") / "twelve.toml"
    made = ["--followers", "10", "--loss", "0.2", "--seed", "7", "--duration", "40"]
    subprocess.run([*FTCC, "new", str(path), *made], check=True, stdout=subprocess.DEVNULL)
    # Compiled here once, not by three hosts at the same time.
    mission = resolve(load(path))
    what = {SCHEME_VARIABLE: mission.scheme.name, PLANT_VARIABLE: mission.plant, ACTIVE_VARIABLE: "0"}
    preload = [sys.executable, "-c", "import ftcc.groundside.swarm.preload"]
    subprocess.run(preload, env={**os.environ, **what}, check=True)
    return path


@pytest.fixture(scope="package")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Keys of all, for an encrypted mesh."""
    folder = tmp_path_factory.mktemp("keys") / "mesh"
    made = ["--swarm", "twelve", "--uavs", "1-12", "--node", "b", "--node", "c"]
    subprocess.run([*FTCC, "keys", "mesh", str(folder), *made], check=True, stdout=subprocess.DEVNULL)
    return folder


class HostedFlight:
    """A flight that host a leads, with the nodes b and c on the hosts of these names.

    Parameters
    ----------
    hosts : the network.
    folder : where all is recorded.
    timeout : of the plan, s.
    keys : folder of keys; None: nothing is encrypted.

    Attributes
    ----------
    run : folder of the run on the leading computer.
    """

    def __init__(self, hosts: list[Host], folder: Path, timeout: float = 30.0, keys: Path | None = None) -> None:
        self.hosts = {host.name: host for host in hosts}
        self.run = folder / "run"
        self._folder = folder
        self._secrecy = ["--insecure"] if keys is None else ["--tls", str(keys)]
        self._plan = folder / "nodes.toml"
        self._plan.write_text(PLAN.format(address=hosts[0].address, port=PORT, timeout=timeout))
        self._processes: dict[str, subprocess.Popen[str]] = {}

    def start(self, scenario: Path, *arguments: str) -> None:
        """Start all three."""
        options = [
            "--nodes",
            str(self._plan),
            *self._secrecy,
            "--pack",
            "4",
            "--viewer",
            "none",
            "--out",
            str(self.run),
        ]
        self.start_on("a", "fly", str(scenario), *options, *arguments)
        for name in "bc":
            self.start_node(name)

    def start_node(self, name: str) -> None:
        """Start `ftcc node` on a host."""
        join = f"{self.hosts['a'].address}:{PORT}"
        options = ["--join", join, "--name", name, *self._secrecy, "--out", str(self.part_of(name))]
        self.start_on(name, "node", *options)

    def part_of(self, name: str) -> Path:
        """Folder of what a node records."""
        return self._folder / f"run-{name}"

    def start_on(self, name: str, *arguments: str) -> None:
        """Start an `ftcc` command on a host."""
        with self._log(name).open("w") as log:
            self._processes[name] = self.hosts[name].run(
                [*FTCC, *arguments], self._environment(name), stdin=subprocess.DEVNULL, stdout=log, stderr=log
            )

    def command(self, name: str, *arguments: str) -> str:
        """Run an `ftcc` command on a host to its end, and return what it prints."""
        pipe = subprocess.PIPE
        process = self.hosts[name].run([*FTCC, *arguments], self._environment(name), stdout=pipe, stderr=pipe)
        output, error = process.communicate(timeout=60.0)
        assert process.returncode == 0, output + error
        return output

    def _environment(self, name: str) -> dict[str, str]:
        return {**os.environ, "FTCC_RUNTIME_DIR": str(self._folder / f"runtime-{name}"), "COLUMNS": "200"}

    def _log(self, name: str) -> Path:
        return self._folder / f"{name}.txt"

    def output(self, name: str = "a") -> str:
        """What the command on a host has printed."""
        return self._log(name).read_text()

    def everything(self) -> str:
        """What all have printed, for the message of an assertion."""
        return "\n".join(f"--- {name}\n{self.output(name)}" for name in self._processes)

    def wait_until(self, condition: Callable[[], bool], seconds: float = 60.0) -> float:
        """Wait for a condition; return for how long, wall s."""
        begun = time.monotonic()
        while not condition():
            assert time.monotonic() < begun + seconds, f"waited in vain:\n{self.everything()}"
            time.sleep(0.01)
        return time.monotonic() - begun

    def network(self) -> list[dict[str, float]]:
        """What the autopilots on the leading computer and the nodes have reported of the network so far."""
        path = self.run / "network.jsonl"
        text = path.read_text() if path.exists() else ""
        return [json.loads(line) for line in text[: text.rfind("\n") + 1].splitlines()]

    def wait_until_flown(self, t: float) -> None:
        """Wait until simulated time is past ``t``, s."""
        self.wait_until(lambda: any(report["t"] >= t for report in self.network()))

    def wait(self, name: str = "a", seconds: float = 60.0) -> int:
        """Exit code of the command on a host."""
        try:
            return self._processes[name].wait(seconds)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"{name} still runs:\n{self.everything()}") from None

    def interrupt(self, name: str = "a") -> None:
        """Ctrl-C on a host."""
        self.hosts[name].send_signal(self._processes[name], signal.SIGINT)


@pytest.fixture
def hosts() -> Iterator[list[Host]]:
    """Four hosts, a to d; the cables of b and c can be cut at once."""
    with Network(4) as four:
        for host in four[1:3]:
            host.lay_wire()
        yield four


@pytest.fixture
def hosted(hosts: list[Host], tmp_path: Path) -> Callable[..., HostedFlight]:
    """Make a flight on the hosts."""
    return lambda **settings: HostedFlight(hosts, tmp_path, **settings)


def clock_offsets(output: str) -> list[float]:
    """Offsets that the leading computer has printed, ms."""
    return [float(offset) for offset in re.findall(r"clock ([+-][\d.]+) ms", output)]
