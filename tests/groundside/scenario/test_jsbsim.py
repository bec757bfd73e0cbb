"""Scenarios that fly an aircraft of JSBSim: what they resolve to, and what is refused with file and line."""

from __future__ import annotations

import sys
from typing import Any

import pytest

pytest.importorskip("jsbsim", reason="JSBSim is not installed")

from ftcc.groundside.scenario import Mission, ScenarioError, load, resolve
from ftcc.link.actuators import ELEVATOR, THRUST
from ftcc.sim.jsbsim.aircraft import Aircraft


def mission(name: str, variants: tuple[str, ...] = (), **settings: Any) -> Mission:
    return resolve(load(name, variants=variants, settings=settings))


def refusal(name: str, variants: tuple[str, ...] = (), **settings: Any) -> str:
    with pytest.raises(ScenarioError) as refused:
        mission(name, variants, **settings)
    return str(refused.value)


def test_every_aircraft_of_the_swarm_starts_in_level_flight() -> None:
    found = mission("jsbsim_containment")
    assert found.plant == "jsbsim"
    aircraft = [spec for spec in found.vehicles if spec.kind == "aircraft"]
    assert len(aircraft) == 6
    for spec in aircraft:
        assert spec.flown is not None
        assert spec.flown.aircraft == Aircraft("c172p")
        assert spec.command[ELEVATOR] == pytest.approx(0.0589, abs=1e-3)
        assert spec.command[THRUST] == pytest.approx(915.0, abs=3.0)
    assert all(spec.flown is None for spec in found.vehicles if spec.kind != "aircraft")


def test_another_seed_draws_other_turbulence_of_jsbsim() -> None:
    found = mission("jsbsim_attitude").with_seed(7)
    assert {spec.flown.seed for spec in found.vehicles if spec.flown is not None} == {7}


def test_a_law_of_positions_flies_it_under_the_inner_loop() -> None:
    found = mission("jsbsim_fire", ("b737",))
    assert found.plant == "jsbsim_guided"
    assert {spec.flown.aircraft.name for spec in found.vehicles if spec.flown is not None} == {"737"}


@pytest.mark.parametrize("variants", [(), ("b737",), ("loss30",), ("b737", "loss30"), ("off",)])
@pytest.mark.parametrize("name", ["jsbsim_containment", "jsbsim_attitude", "jsbsim_fire"])
def test_shipped_scenarios_can_fly(name: str, variants: tuple[str, ...]) -> None:
    assert mission(name, variants).vehicles


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"plant.aircraft": "c171"}, "plant.aircraft: JSBSim has no aircraft 'c171'"),
        ({"plant.aircraft": "none.xml"}, "there is no such file"),
        ({"plant.coefficients": {"CLa": 1.1}}, "the aircraft's own file holds its coefficients"),
        ({"plant.properties": {"fuel/on-the-moon": 1.0}}, "c172p: has no property fuel/on-the-moon"),
        ({"plant.limits.elevator": [-0.7, 0.7]}, "c172p reaches -0.4886 to 0.4013 rad"),
        ({"plant.limits.thrust": [0.0, 9000.0]}, "plant.limits.thrust"),
        ({"start.V": 20.0}, "c172p has no level flight at 20 m/s"),
        ({"disturbances": [{"at": 5.0, "d1": 0.2}]}, "disturbances.0.d1: the plant has no such disturbance"),
        ({"plant.model": "attitude"}, 'plant.aircraft: is for plant.model = "jsbsim" alone'),
    ],
)
def test_what_cannot_be_flown_is_refused(settings: dict[str, Any], message: str) -> None:
    text = refusal("jsbsim_containment", **settings)
    assert message in text
    assert "jsbsim_containment" in text


def test_without_an_aircraft_the_scenario_is_refused() -> None:
    assert "plant.aircraft: is missing" in refusal(
        "containment", **{"plant.model": "jsbsim", "plant.limits": {"aileron": [-0.1, 0.1], "rudder": [-0.1, 0.1]}}
    )


def test_a_fault_of_an_actuator_that_the_aircraft_lacks_is_refused() -> None:
    """A glider has no engine: neither a fault of it, nor a limit on it, means anything."""
    settings = {"plant.aircraft": "sgs126", "start.V": 25.0, "plant.beyond_limits": True}
    fault = {"at": 10.0, "uav": 1, "actuator": "thrust", "effectiveness": 0.5}
    text = refusal("jsbsim_attitude", **settings, faults=[fault])
    assert "faults.0.actuator = 'thrust': sgs126 has no thrust; it has aileron, elevator, rudder" in text
    assert "plant.limits.thrust: sgs126 has no thrust" in text


def test_without_the_package_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "jsbsim", None)
    text = refusal("jsbsim_containment", **{"plant.properties": {"simulation/nothing": 0.0}})
    assert "JSBSim is not installed: pip install 'ftcc-sitl[jsbsim]'" in text
