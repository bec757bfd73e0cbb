"""The shipped scenario of active fault tolerance does what its title says."""

from __future__ import annotations

import numpy as np
import pytest

from ftcc.groundside.scenario.loading import load
from ftcc.groundside.scenario.mission import resolve
from ftcc.groundside.simulation import fly_in_memory


@pytest.fixture(scope="module")
def flights():
    return {variant: fly_in_memory(resolve(load("active", variants=variant))) for variant in ((), ("passive",))}


def test_the_law_alone_loses_the_aircraft_that_has_half_its_thrust(flights):
    assert [*flights["passive",].lost] == [1]


def test_with_diagnosis_nobody_is_lost_and_the_leader_climbs_slower(flights):
    flight = flights[()]
    assert not flight.lost
    climbed, would = (one.column("z", 7)[-1] - 1000.0 for one in (flight, flights["passive",]))
    assert 0.0 < climbed < 0.5 * would
    assert np.nanmin(flight.column("V", 1)) > 28.0
    assert np.nanmax(abs(flight.column("S1", 2))) < 2.0, "the others track as they would"


def test_the_aircraft_says_so_within_a_second_and_the_leaders_answer(flights):
    events = [(t, uav, text) for t, uav, _, text in flights[()].events]
    noticed = [t for t, uav, text in events if uav == 1 and text.startswith("thrust: something is wrong")]
    makes_room = [(t, uav) for t, uav, text in events if "makes room" in text]
    assert 20.0 < noticed[0] < 21.0
    assert {uav for _, uav in makes_room} == {7, 8}
    assert all(noticed[0] < t < noticed[0] + 0.5 for t, _ in makes_room)
    assert not [text for t, uav, text in events if uav in (2, 3, 4, 5, 6)], "nobody else believes in a fault"
