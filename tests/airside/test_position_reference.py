"""The fire-spread model of chapter 9 and the posts around it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ftcc.airside.references.position import (
    Command,
    Fire,
    Reference,
    border,
    change_from_ground,
    moved,
    newest,
    refer,
    start,
)

FIRE = Fire(1.2, 0.8, 1800.0, 0.0327, 0.0, 0.5, 0.5, 100.0, 4.0, 0.2)
"""UAV 1 of the published scenario."""
THERE = Command(0.0, 3.0 + 0.3 * 1800.0, 4.0, 0.3, 0.0)
PERIOD = 0.02


def flown(commands: tuple[Command, ...], seconds: float, fire: Fire = FIRE) -> np.ndarray:
    """References at every tick, shape (ticks, 15)."""
    row = np.array(start(fire, commands))
    rows = []
    for k in range(round(seconds / PERIOD) + 1):
        refer(np.array(fire), np.array(commands), row, k * 20_000, 20_000)
        rows.append(row.copy())
    return np.array(rows)


@pytest.mark.parametrize(
    ("phase", "safe", "place"),
    [
        (0.0, (0.5, 0.5, 100.0), (2703.5, 4.5, 100.0)),
        (0.5 * math.pi, (1.0, 1.0, 105.0), (544.0, 1445.0, 105.0)),
        (math.pi, (1.5, 1.5, 110.0), (-1615.5, 5.5, 110.0)),
        (1.5 * math.pi, (2.0, 2.0, 115.0), (545.0, -1434.0, 115.0)),
    ],
)
def test_posts_begin_at_the_published_initial_positions(phase, safe, place):
    """Section 9.4."""
    fire = FIRE._replace(phase=phase, safe_north=safe[0], safe_east=safe[1], altitude=safe[2])
    assert start(fire, (THERE,))[:3] == pytest.approx(place)


def test_velocity_and_acceleration_are_the_derivatives_of_the_position():
    rows = flown((THERE,), 20.0)
    x, v, a = rows[:, 0:3], rows[:, 3:6], rows[:, 6:9]
    assert np.gradient(x, PERIOD, axis=0)[1:-1] == pytest.approx(v[1:-1], abs=1e-4)
    assert np.gradient(v, PERIOD, axis=0)[1:-1] == pytest.approx(a[1:-1], abs=1e-4)


def test_a_post_is_on_the_border_but_for_its_safe_distance():
    row = flown((THERE,), 30.0)[-1]
    on_border = border(FIRE, (THERE,), 30.0, 100_000)
    away = np.linalg.norm(on_border - (row[:2] - [FIRE.safe_north, FIRE.safe_east]), axis=1)
    assert away.min() < 0.1
    half = 0.5 * np.ptp(on_border, axis=0)
    assert half == pytest.approx([1.2 * 1830.0, 0.8 * 1830.0], rel=1e-6)
    assert on_border[0] == pytest.approx(on_border[-1])


def test_a_moved_fire_is_there_at_once_and_the_formation_follows_within_its_limits():
    move = moved(THERE, 10.0, (700.0, -100.0), (0.3, -0.5))
    rows = flown((THERE, move), 250.0)
    t = np.arange(len(rows)) * PERIOD
    before = flown((THERE,), 10.0)
    assert np.array_equal(rows[t < 10.0], before[:-1])
    fields = {name: rows[:, n] for n, name in enumerate(Reference._fields)}
    assert np.abs(rows[:, 11:13]).max() < 4.0 + 1e-9
    assert np.abs(rows[:, 13:15]).max() < 0.2 + 1e-9
    assert fields["north"][-1] == pytest.approx(700.0 + 0.3 * 240.0, abs=0.1)
    assert fields["east"][-1] == pytest.approx(-100.0 - 0.5 * 240.0, abs=0.1)
    # No overshoot over the fire's own place.
    assert (fields["north"] - (700.0 + 0.3 * (t - 10.0)))[t > 10.0].max() < 0.5
    assert np.gradient(fields["x_dot"], PERIOD)[1:-1] == pytest.approx(fields["x_ddot"][1:-1], abs=0.02)


def test_another_wind_leaves_the_fire_where_it_is():
    windier = moved(THERE, 50.0, drift=(0.6, 0.2))
    assert windier[1:] == pytest.approx((543.0 + 0.3 * 50.0, 4.0, 0.6, 0.2))
    assert border(FIRE, (THERE, windier), 50.0) == pytest.approx(border(FIRE, (THERE,), 50.0))


def test_the_ground_moves_the_fire_at_one_time_and_again_later():
    """Changes for one time belong together; the same rows as those of a scenario, hence the same flight."""
    commands = np.full((3, 5), math.inf)
    commands[0] = THERE
    assert change_from_ground(commands, 5.0, 10.0, "north", 700.0)
    assert change_from_ground(commands, 5.0, 10.0, "drift_east", -0.5)
    first = Command(10.0, 700.0, 4.0, 0.3, -0.5)
    assert newest(commands) == first
    assert not change_from_ground(commands, 6.0, 12.0, "north", 0.0), "the first one is still waiting"
    told = np.array(start(FIRE, (THERE,)))
    planned = told.copy()
    for k in range(1, 1501):
        if k == 1000:
            assert change_from_ground(commands, 20.0, 25.0, "east", 50.0)
            assert newest(commands) == moved(first, 25.0, (first.north + 0.3 * 15.0, 50.0))
        refer(np.array(FIRE), commands, told, k * 20_000, 20_000)
        both = np.array((THERE, first, moved(first, 25.0, (704.5, 50.0))))
        refer(np.array(FIRE), both, planned, k * 20_000, 20_000)
    assert np.array_equal(told, planned)
