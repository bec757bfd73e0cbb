"""Swarms of the schemes as processes equal the simulation, bit for bit."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from pathlib import Path

import pytest

from ftcc.groundside.scenario.mission import resolve
from ftcc.groundside.simulation import simulate
from ftcc.groundside.simulation.cases import load_case
from ftcc.groundside.verdict import VERDICT_FILE
from tests.sitl.conftest import Flight, events, same_flight

needs_jsbsim = pytest.mark.skipif(importlib.util.find_spec("jsbsim") is None, reason="JSBSim is not installed")


@pytest.mark.parametrize(
    ("scenario", "variants", "duration"),
    [
        ("prescribed_performance", ("loss_30",), 60.0),
        ("nearest_neighbour", ("lag", "loss_30"), 60.0),
        ("finite_time_containment", ("loss30",), 60.0),
        ("attitude_synchronization", ("loss_30", "delay_10"), 15.0),
        ("directed_attitude", ("loss_30", "delay_20"), 15.0),
        ("fire_monitoring", ("loss30",), 15.0),
        ("fire_monitoring_sixdof", ("loss30",), 15.0),
        pytest.param("jsbsim_containment", ("loss30",), 12.0, marks=needs_jsbsim),
    ],
    ids=[
        *(
            "chapter 3",
            "chapter 4",
            "chapter 6",
            "chapter 7",
            "chapter 8",
            "chapter 9",
            "chapter 9 by attitude targets",
        ),
        "chapter 5 on an aircraft of JSBSim",
    ],
)
def test_processes_equal_the_simulation(
    scenario: str, variants: tuple[str, ...], duration: float, fly: Callable[..., Flight], tmp_path: Path
) -> None:
    mission = resolve(load_case(scenario, "+".join(("flight", *variants)), duration=duration))
    simulated = simulate(mission, tmp_path / "simulated")
    assert simulated.lost == {}
    flight = fly(scenario, "--variant", ",".join(variants), "--speed", "max", "--duration", f"{duration:g}")
    assert flight.wait(240) == 0, flight.output
    assert same_flight(flight.folder, tmp_path / "simulated")
    assert (flight.folder / VERDICT_FILE).read_text() == (tmp_path / "simulated" / VERDICT_FILE).read_text()
    assert f"verdict: {simulated.verdict.word}" in flight.output
    assert simulated.verdict.text in [event["text"] for event in events(flight.folder)]
