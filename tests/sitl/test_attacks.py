"""Lies in a flight with processes: those of the scenario equal the simulation, and one may be asked for in flight."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ftcc.groundside import Run
from tests.sitl.conftest import Flight, events, same_flight

Ftcc = Callable[..., subprocess.CompletedProcess[str]]

ATTACKS = (
    "attacks=["
    "{at=0.5, until=4.0, kind='drift', uav=1, rate=1.0, size=2.0},"
    "{at=1.0, kind='noise', edge=[2, 3], size=0.5},"
    "{at=1.5, kind='sybil', uav=4, as=5},"
    "{at=2.0, kind='replay', uav=7, delay=1.0},"
    "{at=2.5, kind='collude', uavs=[2, 6], size=1010.0, rate=0.5, onset=1.0}]"
)
DURATION = "6"


def test_lies_between_processes_equal_those_of_the_simulation(fly: Callable[..., Flight], tmp_path: Path) -> None:
    """Three UAVs in a process: some lies stay within it, others go over the mesh."""
    from ftcc.groundside.scenario.loading import load
    from ftcc.groundside.scenario.mission import resolve
    from ftcc.groundside.simulation import simulate

    given = ("--variant", "loss30", "--duration", DURATION, "--set", ATTACKS)
    flight = fly("containment", "--speed", "max", "--pack", "3", *given)
    assert flight.wait() == 0, flight.output
    scenario = load("containment", variants=("loss30",), settings=[ATTACKS], duration=float(DURATION))
    simulated = simulate(resolve(scenario), tmp_path / "simulated")
    assert same_flight(flight.folder, tmp_path / "simulated")
    ours, theirs = Run(flight.folder).lies, simulated.lies
    assert list(ours) == list(theirs)
    assert all(np.array_equal(ours[name], theirs[name], equal_nan=True) for name in ours)
    assert {(int(uav), int(to)) for uav, to in zip(ours["uav"], ours["receiver"], strict=True)} == {
        (1, 0), (2, 0), (6, 0), (7, 0), (2, 3), (5, 3),
    }  # fmt: skip
    said = [(event["t"], event["uav"], event["text"]) for event in events(flight.folder)]
    assert (0.5, 1, "lies: drift: size 2, rate 1") in said
    assert (4.0, 1, "tells the truth again") in said


def test_a_uav_lies_on_command(fly: Callable[..., Flight], ftcc: Ftcc) -> None:
    """Held, so that the command comes before the time at which it acts."""
    flight = fly("containment", "--speed", "max", "--pack", "auto", "--duration", "4", "--hold")
    flight.wait_until(lambda: "held" in flight.output)
    answer = ftcc("attack", "3", "offset", "--size", "-4", "--at", "1", "--for", "2")
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout.strip() == "UAV 3: offset from t = 1 s to 3 s"
    wrong = ftcc("attack", "3", "offset", "--size", "4", "--to", "1")
    assert wrong.returncode == 2
    assert "UAV 1 does not hear UAV 3; UAVs 2, 4, 5 do" in wrong.stderr.replace("\n", " ")
    unknown = ftcc("attack", "3", "freeze", "--signals", "altitude")
    assert unknown.returncode == 2
    assert "it shares zhat, v" in unknown.stderr.replace("\n", " ")
    assert ftcc("resume").returncode == 0
    assert flight.wait() == 0, flight.output
    lies = Run(flight.folder).lies
    assert set(lies["uav"]) == {3}
    assert (lies["t"][0], lies["t"][-1]) == (1.0, 2.95)
    assert np.array_equal(lies["told_zhat"], lies["true_zhat"] - 4.0)
    acted = [(e["t"], e["text"]) for e in events(flight.folder) if e["uav"] == 3 and e.get("outcome") == "acts"]
    assert acted == [(1.0, "lies: offset: size -4"), (3.0, "tells the truth again")]
