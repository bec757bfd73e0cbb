"""The plants that JSBSim flies, in the compiled cycle: actuators and faults in front, truth behind."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("jsbsim", reason="JSBSim is not installed")

from ftcc.groundside.scenario import load, resolve
from ftcc.link.actuators import AILERON, ELEVATOR, THRUST
from ftcc.link.callbacks import NOBODY
from ftcc.sim.build import build_fleet
from ftcc.sim.faults import Fault
from ftcc.sim.fleet import Fleet
from ftcc.sim.jsbsim.flight import ModelState, trouble_of
from ftcc.sim.plant import LOST, MODEL, TRUTH
from ftcc.sim.plants import cycle_of, find
from ftcc.sim.spec import VehicleSpec

PERIOD_US, STEP_US = 20_000, 5000


def aircraft(name: str) -> list[VehicleSpec]:
    """Two aircraft of a shipped scenario, without faults and noise, in the same level flight."""
    (first, *_) = resolve(load(name, settings={"faults": []})).vehicles
    return [first, replace(first, uav=2)]


def fly(fleet: Fleet, plant: str, seconds: float) -> list[int]:
    """Fly all vehicles; returns why each was lost, 0 if it was not."""
    advance = cycle_of(plant).advance
    why = [0] * len(fleet.state)
    for n in range(int(seconds * 1e6) // PERIOD_US):
        for i, reason in enumerate(why):
            if not reason:
                why[i] = int(advance(fleet, i, n * PERIOD_US, PERIOD_US, STEP_US))
    return why


def truth(fleet: Fleet, plant: str, i: int) -> dict[str, float]:
    out = np.zeros(len(TRUTH))
    cycle_of(plant).truth(fleet, i, 0.0, out)
    return dict(zip(TRUTH, out.tolist(), strict=True))


def test_level_flight_stays_level_and_a_fault_turns_one_aircraft_alone() -> None:
    healthy = resolve(load("jsbsim_containment", settings={"faults": []})).vehicles[0]
    faulty = replace(healthy, uav=2, faults=(Fault(2.0, float(AILERON), 1.0, 0.03, 0.0, 0.0),))
    fleet = build_fleet([healthy, faulty])
    assert fly(fleet, "jsbsim", 5.0) == [0, 0]
    calm, rolled = (truth(fleet, "jsbsim", i) for i in (0, 1))
    assert abs(calm["mu"]) < math.radians(2.0)
    assert calm["z"] == pytest.approx(1000.0, abs=0.5)
    assert calm["V"] == pytest.approx(50.0, abs=0.3)
    # A positive aileron rolls left.
    assert rolled["mu"] < -math.radians(15.0)


def test_the_inner_loop_holds_bank_and_load_factor() -> None:
    first, second = aircraft("jsbsim_fire")
    fleet = build_fleet([first, second])
    fleet.command[0, AILERON] = 0.3
    fleet.command[0, ELEVATOR] = 1.0 / math.cos(0.3)
    assert fly(fleet, "jsbsim_guided", 10.0) == [0, 0]
    turned, straight = (truth(fleet, "jsbsim_guided", i) for i in (0, 1))
    assert turned["mu"] == pytest.approx(0.3, abs=0.03)
    assert abs(turned["gamma"]) < math.radians(3.0)
    turn = (turned["chi"] - straight["chi"]) % (2.0 * math.pi)
    assert turn == pytest.approx(9.81 * math.tan(0.3) / 52.5 * 10.0, rel=0.25)


def test_a_model_that_fails_is_lost_with_its_reason_and_the_other_flies_on() -> None:
    first, second = aircraft("jsbsim_fire")
    fleet = build_fleet([first, second])
    fleet.command[0, THRUST] = math.nan
    why = fly(fleet, "jsbsim_guided", 1.0)
    assert why == [MODEL, 0]
    assert LOST[MODEL] == "JSBSim can fly it no further"
    assert trouble_of(fleet.model, 1) == ""


def test_models_end_with_their_fleet() -> None:
    from ftcc.sim.jsbsim import flight

    before = len(flight._flown)
    fleet = build_fleet(aircraft("jsbsim_fire"))
    assert fleet.model[0] != NOBODY
    assert len(flight._flown) == before + 1
    del fleet
    assert len(flight._flown) == before


@pytest.mark.parametrize("plant", ["jsbsim", "jsbsim_guided"])
def test_a_state_begins_with_what_the_model_says(plant: str) -> None:
    assert find(plant).State._fields[: len(ModelState._fields)] == ModelState._fields
