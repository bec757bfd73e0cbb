"""Altitudes that count from a datum on the link between vehicle and autopilot, where they are float32."""

from __future__ import annotations

import numpy as np
import pytest

from ftcc.airside.compiled_stages import stages_of
from ftcc.groundside.scenario.loading import load
from ftcc.groundside.scenario.mission import resolve
from ftcc.groundside.simulation import Flight, fly_in_memory
from ftcc.groundside.simulation.flight_arrays import new_world
from ftcc.groundside.simulation.one_process import loop_of


def flown(datum: float) -> Flight:
    settings = [f"home.datum={datum}"]
    return fly_in_memory(resolve(load("containment", form="flight", variants=["P"], duration=110.0, settings=settings)))


def ripple(flight: Flight) -> float:
    """Largest rms change of an elevator command per 10 ms after 100 s, rad."""
    late = flight.column("t", 1) >= 100.0
    return max(float(np.diff(flight.column("elevator_command", uav)[late]).std()) for uav in range(1, 7))


def test_near_its_datum_an_altitude_moves_the_elevator_less() -> None:
    """In steps of 6e-5 m at 1000 m, of 8e-6 m at 100 m."""
    far, near = flown(0.0), flown(1000.0)
    assert ripple(far) > 5e-4
    assert ripple(near) < 0.15 * ripple(far)
    for uav in range(1, 7):
        assert near.column("z", uav) == pytest.approx(far.column("z", uav), abs=5e-3)


def test_everybody_but_the_link_counts_from_the_origin() -> None:
    """What the autopilot makes of its vehicle's messages is what it tells the ground."""
    mission = resolve(load("containment", settings=["home.datum=1000.0"]))
    loop = loop_of("containment", "longitudinal")
    world = new_world(mission.vehicles, mission.autopilots, mission.timing, 40)
    loop.cycle.sense(world.fleet, 0, 0, 0, 1, world.true[0], world.measured, world.state, world.controls)
    altitude = mission.vehicles[0].initial[2]
    assert world.state[9] == np.float32(-(altitude - 1000.0))
    stages_of("containment").sense(world.autopilots, 0, world.state, world.controls, 0)
    assert -world.state[9] == pytest.approx(altitude, abs=1e-5)
    assert world.autopilots.own[0, 3] == -world.state[9]
