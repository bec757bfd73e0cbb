"""Attitude laws fly with processes as they do in one: bit for bit, amid loss and with commands that come late."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from ftcc.groundside.mission import resolve
from ftcc.groundside.scenario import load
from ftcc.groundside.simulate import simulate
from tests.sitl.conftest import Flight, same_flight

SECONDS = 11.0
"""Beyond the first fault."""


@pytest.mark.parametrize("scenario", ["attitude_synchronization", "directed_attitude"])
def test_eight_processes_equal_the_simulation(scenario: str, fly: Callable[..., Flight], tmp_path: Path) -> None:
    options = ("--variant", "loss_30", "--set", "plant.delay=1", "--duration", str(SECONDS))
    flight = fly(scenario, "--speed", "max", *options)
    assert flight.wait(240) == 0, flight.output
    late = load(scenario, variants=("loss_30",), settings=("plant.delay=1",), duration=SECONDS)
    simulate(resolve(late), tmp_path / "simulated")
    assert same_flight(flight.folder, tmp_path / "simulated")
