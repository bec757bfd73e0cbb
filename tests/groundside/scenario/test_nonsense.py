"""Scenarios that cannot work are refused, or warned of, with the number that is wrong and what would be right."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import psutil
import pytest

from ftcc.groundside import ScenarioError, load, resolve
from ftcc.groundside.scenario.mission import Mission
from ftcc.groundside.simulation import TooLargeError, fly_in_memory, simulate

MISSION_AT_500 = ["start.z=500", "leaders.7.z=500", "leaders.8.z=500", "leaders.7.commands.0.altitude=600"]
GUARDED = (
    "start of UAV 1: flight-path angle outside the model's valid range: "
    "gamma = 1.5 rad, plant.guards.flight_path_angle = 1 rad"
)


def mission(name: str, *settings: str, form: str = "flight", duration: float | None = None) -> Mission:
    return resolve(load(name, form=form, settings=settings, duration=duration))


def refusal(name: str, *settings: str, form: str = "flight") -> str:
    with pytest.raises(ScenarioError) as error:
        mission(name, *settings, form=form)
    return str(error.value)


@pytest.mark.slow
@pytest.mark.parametrize("duration", ["0.05", "1e-4"])
@pytest.mark.parametrize("name", ["nearest_neighbour", "containment", "finite_time_containment", "fire_monitoring"])
def test_flights_shorter_than_the_grid_of_the_checks_are_flown(name: str, duration: str) -> None:
    assert not fly_in_memory(mission(name, f"duration={duration}")).lost


@pytest.mark.parametrize(
    ("name", "settings", "said"),
    [
        (
            "containment",
            ["plant.limits.elevator=[-0.1,0.1]", "faults=[]"],
            "UAV 1, 2, 3, 4, 5, 6: no level trim at 30 m/s and t = 0 s: elevator would need -0.197 rad; "
            "plant.limits.elevator is -0.1 to 0.1 rad",
        ),
        (
            "containment",
            ["plant.limits.thrust=[0,5]", "faults=[]"],
            "plant.limits.thrust is 0 to 5 N",
        ),
        ("fire_monitoring_sixdof", ["start.uav.1.V=5"], "start of UAV 1: the airframe has no level trim at 5 m/s"),
        (
            "containment",
            ["plant.initial_actuators={elevator=2.0, thrust=20.0}"],
            "plant.initial_actuators.elevator = 2: plant.limits.elevator is -0.7 to 0.7 rad",
        ),
        ("nearest_neighbour", ["start.uav.1.gamma=1.499", "plant.guards.flight_path_angle=1.0"], GUARDED),
        ("fire_monitoring", ["gains.n_max=0.5"], "of load_factor at t = "),
        ("fire_monitoring", ["gains.bank_max=0.1"], "the law allows -0.1 to 0.1 rad"),
        ("containment", ["graph.edges.0={between=[1,1],weight=1}"], "a UAV cannot be its own neighbour"),
        (
            "containment",
            ["start.z=500"],
            "500 m below where its estimate starts (gain z_start): at most 100 m can be flown",
        ),
        (
            "containment",
            [*MISSION_AT_500, "gains.z_start=1000"],
            "500 m below where its estimate starts (gain z_start)",
        ),
        ("prescribed_performance", ["start.z=500"], "outside of the performance tube"),
        (
            "containment",
            ["gains.beta2=30"],
            "times 1.8, the largest sum of weights with which a UAV hears: its rate 554 1/s is unstable in Euler steps "
            "of 5 ms: needs more than 277 steps a second",
        ),
    ],
)
def test_it_is_refused(name: str, settings: list[str], said: str) -> None:
    assert said in refusal(name, *settings)


CHAIN = "graph.edges=[{from=1,to=2,weight=1},{from=2,to=3,weight=1},{from=3,to=4,weight=1}]"


@pytest.mark.parametrize(
    ("name", "settings", "said"),
    [
        ("containment", ["plant.limits.elevator=[-0.1,0.1]", "faults=[]", "plant.beyond_limits=true"], "no level trim"),
        ("containment", ["graph.edges.0={from=1,to=7,weight=1}", "graph.edges.1={between=[1,2],weight=0.4}"], "1 -> 7"),
        ("directed_attitude", [CHAIN], "nothing that UAV 2 sends reaches UAV 1; sound all the same"),
        ("directed_attitude", ["graph.edges.0.weight=1e-12"], "negligible beside the others"),
        ("attitude_synchronization", ["gains.eps_inf=0.01"], "phi / (k eps_inf) = 290.9 1/rad"),
        (
            "attitude_synchronization",
            ["start.uav.3.alpha=1.4"],
            "UAV 3 starts with a synchronization error of 4.35 rad",
        ),
    ],
)
def test_it_is_warned_of(name: str, settings: list[str], said: str) -> None:
    assert any(said in warning for warning in mission(name, *settings).warnings)


def test_a_mission_at_another_altitude_is_the_same_flight() -> None:
    """The estimates start where the leaders do: what the law makes of a mission does not hang on its altitude."""
    usual, lower = mission("containment", duration=60.0), mission("containment", *MISSION_AT_500, duration=60.0)
    one, other = fly_in_memory(usual), fly_in_memory(lower)
    for uav in usual.uavs:
        climbed = [flight.column("z", uav) - flight.column("z", uav)[0] for flight in (one, other)]
        assert np.abs(climbed[0] - climbed[1]).max() < 1e-3
    assert "z_start = 500.0" in lower.toml


def test_a_recording_that_does_not_fit_into_memory_is_refused() -> None:
    endless = mission("demo", "rates.control_rate=1000", "record_rate=1000", duration=1e5)
    with pytest.raises(TooLargeError, match=r"100000001 rows of 8 UAVs take \d+\.\d GB of memory"):
        fly_in_memory(endless)


def test_a_recording_that_does_not_fit_on_the_disk_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    endless = mission("demo", "rates.control_rate=1000", "record_rate=1000", duration=1e5)
    room = shutil.disk_usage(tmp_path)._replace(free=10_000_000_000)
    monkeypatch.setattr(psutil, "disk_usage", lambda _: room)
    with pytest.raises(TooLargeError, match=r"rows of 8 UAVs take \d+\.\d GB of disk at least, 10\.0 GB are free"):
        simulate(endless, tmp_path / "run")
    assert not list((tmp_path / "run").iterdir())
