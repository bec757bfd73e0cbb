"""Obstacles: clearance over them, and the first entry into each."""

from __future__ import annotations

import numpy as np
import pytest

from ftcc.link.events import CAPACITY, drain_events, new_events, note
from ftcc.sim.build import build_fleet
from ftcc.sim.obstacles import ENTERED, Obstacle, clearance, watch, zones_of
from ftcc.sim.plants import cycle_of
from tests.support.swarm import vehicle

HILLS = (Obstacle(2500.0, 4500.0, 430.0), Obstacle(4000.0, 6000.0, 450.0))
ZONES = zones_of(HILLS)


@pytest.mark.parametrize(
    ("x", "z", "height"),
    [(2500.0, 480.0, 480.0), (2500.1, 480.0, 50.0), (4200.0, 480.0, 30.0), (5000.0, 440.0, -10.0), (6000.0, 1.0, 1.0)],
)
def test_clearance_is_the_height_above_the_highest_obstacle_below(x: float, z: float, height: float) -> None:
    assert clearance(ZONES, x, z) == pytest.approx(height)


def test_without_obstacles_clearance_is_the_altitude() -> None:
    assert clearance(zones_of(()), 3000.0, 12.0) == 12.0


def test_only_the_first_entry_into_a_zone_is_told() -> None:
    entered, events = np.zeros((2, 2), np.int64), new_events()
    for now, x, z in (
        (0, 2400.0, 400.0),
        (1, 2600.0, 431.0),
        (2, 2700.0, 429.0),
        (3, 2800.0, 431.0),
        (4, 4100.0, 429.0),
    ):
        watch(ZONES, entered, events, 1, now, x, z)
    assert drain_events(events) == [(2, 1, ENTERED, 1), (4, 1, ENTERED, 2)]
    assert drain_events(events) == []


def test_a_list_that_nobody_empties_keeps_what_came_first() -> None:
    events = new_events()
    for now in range(2 * CAPACITY):
        note(events, now, 0, ENTERED, 1)
    rows = drain_events(events)
    assert [row[0] for row in rows] == list(range(len(rows)))
    assert len(rows) == CAPACITY


def test_a_vehicle_in_a_zone_is_noted_in_its_tick() -> None:
    low = (30.0, 3000.0, 400.0, 0.0, 0.0322, 0.0)
    fleet = build_fleet([vehicle(1, obstacles=HILLS), vehicle(2, obstacles=HILLS, initial=low)])
    for i in range(2):
        cycle_of("longitudinal").sense(fleet, i, 7, 70_000, 1, np.zeros(13), np.zeros(13), np.zeros(13), np.zeros(4))
    assert drain_events(fleet.events) == [(70_000, 1, ENTERED, 1)]
