"""The view of attitudes: true bank in every slot whatever the course, and the reference beside it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from ftcc.groundside.dashboard.attitudes import Attitudes
from ftcc.groundside.snapshot import Snapshot
from tests.groundside.synthetic_swarm import SUBJECT, snapshot

BANK, WANTED = 0.5, 0.2
VIEW = Attitudes(replace(SUBJECT, family="attitude"))


def banked(course: float, **signals: float) -> Snapshot:
    """Level flight in a right bank."""
    flown = snapshot(1.0)
    lying = {"gamma": 0.0, "alpha": 0.0, "mu": BANK, "chi": course}
    uavs = {
        uav: replace(state, truth=state.truth | lying, signals=state.signals | signals)
        for uav, state in flown.uavs.items()
    }
    return replace(flown, uavs=uavs)


def right_wing(transform: Any) -> tuple[float, float, float]:
    """East, north, up of a unit vector to the right wing tip."""
    x, y, z, w = transform.quaternion.as_arrow_array().to_pylist()[0]
    return 2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)


@pytest.mark.parametrize("course", [0.0, 1.0, -2.5])
def test_every_aircraft_is_seen_in_its_bank_from_behind(course: float) -> None:
    drawn = {entry.path: entry.what for entry in VIEW.draw(banked(course))}
    for uav in SUBJECT.graph.uavs:
        east, north, up = right_wing(drawn[f"/attitudes/uav/{uav}"])
        assert (east, north, up) == pytest.approx((math.cos(BANK), 0.0, -math.sin(BANK)), abs=1e-6)
    assert not any(path.startswith("/attitudes/reference") for path in drawn), "there is none"


def test_its_reference_lies_as_the_law_wants_it() -> None:
    drawn = {entry.path: entry.what for entry in VIEW.draw(banked(0.3, mu_d=WANTED, alpha_d=0.0, beta_d=0.0))}
    for uav in SUBJECT.graph.uavs:
        assert right_wing(drawn[f"/attitudes/reference/{uav}"])[2] == pytest.approx(-math.sin(WANTED), abs=1e-6)


def test_no_two_aircraft_share_a_slot() -> None:
    drawn = [entry.what for entry in VIEW.draw(banked(0.0)) if entry.path.startswith("/attitudes/uav")]
    places = {tuple(transform.translation.as_arrow_array().to_pylist()[0]) for transform in drawn}
    assert len(places) == len(SUBJECT.graph.uavs)
