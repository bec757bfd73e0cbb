"""Swarms of the schemes as processes equal the simulation, bit for bit."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from ftcc.groundside.cases import load_case
from ftcc.groundside.mission import resolve
from ftcc.groundside.simulate import simulate
from tests.sitl.conftest import Flight, same_flight


@pytest.mark.parametrize(
    ("scenario", "variants"),
    [
        ("prescribed_performance", ("loss_30",)),
        ("nearest_neighbour", ("lag", "loss_30")),
        ("attitude_synchronization", ("loss_30", "delay_10")),
        ("directed_attitude", ("loss_30", "delay_20")),
        ("fire_monitoring", ("loss30",)),
        ("fire_monitoring_sixdof", ("loss30",)),
    ],
    ids=["chapter 3", "chapter 4", "chapter 7", "chapter 8", "chapter 9", "chapter 9 by attitude targets"],
)
def test_processes_equal_the_simulation(
    scenario: str, variants: tuple[str, ...], fly: Callable[..., Flight], tmp_path: Path
) -> None:
    simulated = simulate(
        resolve(load_case(scenario, "+".join(("flight", *variants)), duration=15.0)), tmp_path / "simulated"
    )
    assert simulated.lost == {}
    flight = fly(scenario, "--variant", ",".join(variants), "--speed", "max", "--duration", "15")
    assert flight.wait(240) == 0, flight.output
    assert same_flight(flight.folder, tmp_path / "simulated")
