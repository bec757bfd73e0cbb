"""Control periods that are no whole ms, and turbulence: processes equal the simulation, bit for bit."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ftcc.groundside.scenario.loading import load
from ftcc.groundside.scenario.mission import resolve
from ftcc.groundside.simulation import simulate
from tests.sitl.conftest import Flight, same_flight

EIGHTY = ["rates.control_rate=80", "rates.plant_step=0.0005", "record_rate=80"]
FOUR_HUNDRED = ["rates.control_rate=400", "rates.plant_step=0.0005"]
MOVING_AIR = [
    "home.datum=1000.0",
    "turbulence={sigma=[0.5, 0.5, 0.5], length=[300.0, 300.0, 100.0]}",
    "gusts=[{at=3.0, until=6.0, up=1.0, length=30.0}]",
    "disturbances=[{at=2.0, until=8.0, d2=0.05, frequency=4.0}]",
    "faults=[{at=4.0, until=7.0, uav=1, actuator='elevator', effectiveness=0.8}]",
]


@pytest.mark.parametrize(
    ("scenario", "settings"),
    [
        ("prescribed_performance", EIGHTY),
        ("containment", FOUR_HUNDRED),
        ("fire_monitoring_sixdof", EIGHTY),
        ("containment", MOVING_AIR),
    ],
    ids=["80 Hz", "400 Hz", "80 Hz by attitude targets", "turbulence"],
)
def test_processes_equal_the_simulation(
    scenario: str, settings: list[str], fly: Callable[..., Flight], tmp_path: Path
) -> None:
    mission = resolve(load(scenario, form="flight", duration=10.0, settings=settings))
    simulated = simulate(mission, tmp_path / "simulated")
    assert simulated.lost == {}
    assert np.diff(simulated.column("t", 1)) == pytest.approx(
        1.0 / (100.0 if "record_rate=80" not in settings else 80.0)
    )
    assert bool(simulated.column("wind_up", 1).any()) == (settings is MOVING_AIR)
    set_each = [argument for setting in settings for argument in ("--set", setting)]
    flight = fly(scenario, *set_each, "--speed", "max", "--duration", "10", "--pack", "3")
    assert flight.wait(240) == 0, flight.output
    assert same_flight(flight.folder, tmp_path / "simulated")
