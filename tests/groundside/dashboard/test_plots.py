"""Plots: motion, errors with their bounds, estimates, commands, over simulated time."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ftcc.airside.scheme import Quantity
from ftcc.groundside.dashboard.detail import Detail
from ftcc.groundside.dashboard.plots import Plots
from ftcc.sim.obstacles import Obstacle
from tests.groundside.dashboard.recorded import DURATION, at, rows
from tests.groundside.dashboard.synthetic_swarm import (
    FAULT_AT,
    FOLLOWERS,
    GRAPH,
    LEADERS,
    LIMITS,
    SIGNALS,
    SUBJECT,
    leaders_at,
    snapshot,
)


def test_simulated_time_is_a_timeline_in_seconds(recording: Path) -> None:
    times, _ = rows(recording, "/plots/motion/z/uavs", "Scalars:scalars")
    np.testing.assert_allclose(times, np.arange(round(10 * DURATION) + 1) / 10.0, atol=1e-6)


def test_altitudes_of_all_uavs_and_the_leaders_hull(recording: Path) -> None:
    t = 17.3
    altitudes = at(recording, "/plots/motion/z/uavs", "Scalars:scalars", t)
    expected = snapshot(t).uavs
    true = [expected[uav].truth["z"] for uav in sorted(expected)]
    np.testing.assert_allclose(altitudes, [*true, *(expected[uav].signals["zhat"] for uav in FOLLOWERS)])
    middle = at(recording, "/plots/motion/z/hull", "Measurements:values", t)[0]
    half = at(recording, "/plots/motion/z/hull", "Measurements:variances", t)[0] ** 0.5
    np.testing.assert_allclose([middle - half, middle + half], sorted(leaders_at(t)))


def test_series_are_named_and_coloured_by_uav(recording: Path) -> None:
    _, names = rows(recording, "/plots/motion/z/uavs", "SeriesLines:names")
    assert names[0][: len(GRAPH.uavs)] == [f"UAV {uav}" for uav in (*FOLLOWERS, *LEADERS)]
    _, tints = rows(recording, "/plots/motion/z/uavs", "SeriesLines:colors")
    _, shape = rows(recording, "/world/uav/3/airframe", "Mesh3D:albedo_factor")
    assert shape[0][0] == tints[0][2]


def test_an_obstacle_is_drawn_below_the_altitudes_of_uavs_above_it() -> None:
    subject = dataclasses.replace(SUBJECT, obstacles=(Obstacle(250.0, 350.0, 870.0),))
    plots = Plots(subject, Detail(subject))
    before, above = ({entry.path: entry.what for entry in plots.draw(snapshot(t))} for t in (5.0, 10.0))
    assert np.isnan(before["/plots/motion/z/uavs"].scalars.as_arrow_array().to_pylist()[-1])
    assert above["/plots/motion/z/uavs"].scalars.as_arrow_array().to_pylist()[-1] == 870.0


def test_a_bank_that_passes_half_a_turn_is_drawn_on_its_reference_beside_it() -> None:
    subject = replace(SUBJECT, family="attitude", signals=(Quantity("mu_d", "rad", "reference, bank"), *SIGNALS))
    plots = Plots(subject, Detail(subject))
    drawn = []
    for bank, reference in ((179.0, 181.0), (-179.0, 182.0), (-177.0, -178.0), (178.0, 177.0)):
        flown = snapshot(1.0)
        uavs = {
            uav: replace(
                state,
                truth=state.truth | {"mu": math.radians(bank)},
                signals=state.signals | {"mu_d": math.radians(reference)},
            )
            for uav, state in flown.uavs.items()
        }
        (curve,) = [e.what for e in plots.draw(replace(flown, uavs=uavs)) if e.path == "/plots/motion/mu"]
        values = curve.scalars.as_arrow_array().to_pylist()
        drawn.append((values[0], values[len(subject.graph.uavs)]))
    assert drawn == [pytest.approx(two) for two in ((179.0, 181.0), (181.0, 182.0), (183.0, 182.0), (178.0, 177.0))]


def test_tracking_errors_with_their_bounds(recording: Path) -> None:
    uavs = snapshot(21.0).uavs
    values = at(recording, "/plots/errors/S1", "Scalars:scalars", 21.0)
    np.testing.assert_allclose(values, [*(uavs[i].signals["S1"] for i in FOLLOWERS), 1.0, -1.0])
    assert len(at(recording, "/plots/errors/S5", "Scalars:scalars", 21.0)) == len(FOLLOWERS)
    assert rows(recording, "/plots/errors/zhat", "Scalars:scalars")[1] == []


def test_an_estimate_is_drawn_beside_the_true_value(recording: Path) -> None:
    values = at(recording, "/plots/estimates/d1_hat", "Scalars:scalars", 25.0)
    np.testing.assert_allclose(values, [0.19] * len(FOLLOWERS) + [0.2] * len(FOLLOWERS))


def test_the_true_effectiveness_falls_with_the_fault(recording: Path) -> None:
    for t, left in ((FAULT_AT - 0.1, 1.0), (FAULT_AT, 0.7)):
        assert at(recording, "/plots/effectiveness/elevator", "Scalars:scalars", t)[0] == left


def test_elevator_and_thrust_acting_and_commanded_between_their_limits(recording: Path) -> None:
    uavs = snapshot(25.0).uavs
    for actuator in ("elevator", "thrust"):
        values = at(recording, f"/plots/actuators/{actuator}", "Scalars:scalars", 25.0)
        acting = [uavs[i].acting[actuator] for i in FOLLOWERS]
        commanded = [uavs[i].command[actuator] for i in FOLLOWERS]
        np.testing.assert_allclose(values, [*acting, *commanded, *LIMITS[actuator]])
