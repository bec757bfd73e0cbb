"""The view of attitudes: true bank in every slot whatever the course, and the reference beside it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ftcc.groundside.dashboard.attitudes import Attitudes
from ftcc.groundside.dashboard.detail import Detail
from ftcc.groundside.dashboard.snapshot import Snapshot
from tests.groundside.dashboard.synthetic_swarm import SUBJECT, snapshot

BANK, WANTED = 0.5, 0.2
VIEW = Attitudes(replace(SUBJECT, family="attitude"), Detail(SUBJECT))


def banked(course: float, **signals: float) -> Snapshot:
    """Level flight in a right bank."""
    flown = snapshot(1.0)
    lying = {"gamma": 0.0, "alpha": 0.0, "mu": BANK, "chi": course}
    uavs = {
        uav: replace(state, truth=state.truth | lying, signals=state.signals | signals)
        for uav, state in flown.uavs.items()
    }
    return replace(flown, uavs=uavs)


def on_the_screen(uav: int, transform: Any, axis: int) -> tuple[float, float]:
    """Where the eye sees one of the axes forward, right, down of an aircraft point: to the right and up."""
    x, y, z, w = transform.quaternion.as_arrow_array().to_pylist()[0]
    seen = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )[:, axis]
    ahead = -VIEW._eye / np.linalg.norm(VIEW._eye)
    right = np.array([1.0, 0.0, 0.0])
    axes = np.array([right, np.cross(right, ahead), ahead])
    place, seen = axes @ (np.array(VIEW._slots[uav]) - VIEW._eye), axes @ seen
    across, up = (seen - place / place[2] * seen[2])[:2].tolist()
    return across, up


def slope_on_the_screen(uav: int, transform: Any) -> float:
    """By how much the right wing hangs, rad."""
    across, up = on_the_screen(uav, transform, 1)
    return math.atan2(-up, across)


@pytest.mark.parametrize("course", [0.0, 1.0, -2.5])
def test_every_aircraft_is_seen_in_its_bank_from_behind(course: float) -> None:
    drawn = {entry.path: entry.what for entry in VIEW.draw(banked(course))}
    for uav in SUBJECT.graph.uavs:
        assert slope_on_the_screen(uav, drawn[f"/attitudes/uav/{uav}"]) == pytest.approx(BANK, rel=0.3)
    assert not any(path.startswith("/attitudes/reference") for path in drawn), "there is none"


def test_an_outline_has_the_reference_attitude() -> None:
    drawn = {entry.path: entry.what for entry in VIEW.draw(banked(0.3, mu_d=WANTED, alpha_d=0.0, beta_d=0.0))}
    for uav in SUBJECT.graph.uavs:
        assert slope_on_the_screen(uav, drawn[f"/attitudes/reference/{uav}"]) == pytest.approx(WANTED, rel=0.3)


def test_no_two_aircraft_share_a_slot() -> None:
    drawn = [entry.what for entry in VIEW.draw(banked(0.0)) if entry.path.startswith("/attitudes/uav")]
    places = {tuple(transform.translation.as_arrow_array().to_pylist()[0]) for transform in drawn}
    assert len(places) == len(SUBJECT.graph.uavs)


def test_aircraft_that_fly_level_stand_upright_wherever_their_slot_is() -> None:
    level = banked(0.0)
    uavs = {uav: replace(state, truth=state.truth | {"mu": 0.0}) for uav, state in level.uavs.items()}
    drawn = {entry.path: entry.what for entry in VIEW.draw(replace(level, uavs=uavs))}
    for uav in SUBJECT.graph.uavs:
        across, down = on_the_screen(uav, drawn[f"/attitudes/uav/{uav}"], 2)
        assert down < 0.0
        assert abs(across / down) < 0.05
