"""A swarm of four that other people's ground stations find on ports of their own."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.sitl.conftest import FTCC, Flight
from tests.support.ports import free_port

FAMILY = "attitude_synchronization"


class Swarm(NamedTuple):
    """A running swarm of UAVs 1 to 4 and where it tells of itself."""

    flight: Flight
    offboard: int
    """Port of an offboard program."""
    station: int
    """Port of a ground station."""

    def ports(self) -> dict[int, int]:
        """By UAV the port on which its autopilot hears whoever calls."""
        (card,) = Path(self.flight.environment["FTCC_RUNTIME_DIR"]).glob("ftcc/*.json")
        return {vehicle["uav"]: vehicle["port"] for vehicle in json.loads(card.read_text())["vehicles"]}

    def run(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run an `ftcc` command against it."""
        return subprocess.run(
            [*FTCC, *arguments], env=self.flight.environment, capture_output=True, text=True, timeout=120, check=False
        )


@pytest.fixture(scope="module")
def listeners() -> tuple[int, ...]:
    """Ports of further ground stations, where a module's tests have some."""
    return ()


@pytest.fixture(scope="module")
def swarm(tmp_path_factory: pytest.TempPathFactory, listeners: tuple[int, ...]) -> Iterator[Swarm]:
    """Level flight without faults, slowly: a machine that is busy for a moment must not lose an aircraft."""
    folder: Path = tmp_path_factory.mktemp("swarm")
    offboard, station = free_port(), free_port()
    environment = {**os.environ, "FTCC_RUNTIME_DIR": str(folder / "runtime")}
    level = "attitude.commands=[{at=0.0, bank=0.0, alpha=0.034906585, sideslip=0.0}]"
    addresses = [f"--mavlink=127.0.0.1:{port}" for port in (offboard, station, *listeners)]
    arguments = [FAMILY, "--speed", "0.25", "--pack", "auto", "--duration", "60", "--set", "faults=[]", "--set", level]
    flight = Flight([*arguments, *addresses], folder / "run", environment)
    try:
        # A first start compiles the law.
        flight.wait_until(lambda: "commanded to bank" in flight.output, 280.0)
        yield Swarm(flight, offboard, station)
    finally:
        leftovers = flight.processes() if flight.process.poll() is None else []
        flight.process.kill()
        for process in leftovers:
            if process.is_running():
                process.kill()
