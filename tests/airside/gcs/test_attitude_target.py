"""Attitude targets from the ground: read by the flight path of the aircraft, and taken only within the envelope."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from ftcc.airside.flight_path import Own
from ftcc.airside.model import level_deflections
from ftcc.airside.references.attitude import command_from_ground
from ftcc.link.mavlink import dialect
from ftcc.link.rotation import body_attitude
from ftcc.sim.plant import ALPHA, BETA, CHI, GAMMA, MU, TRUTH, V
from ftcc.sim.sensors import encode_state
from tests.support.swarm import AIRFRAME, autopilot

NOBODY = Own(*(0.0,) * len(Own._fields))


def target(q: tuple[float, ...], mask: int = 0b111) -> Any:
    return dialect.MAVLink_set_attitude_target_message(0, 1, 1, mask, q, math.nan, math.nan, math.nan, math.nan)


def flying(gamma: float, chi: float) -> np.ndarray:
    return np.array(NOBODY._replace(V=30.0, gamma=gamma, chi=chi))


def test_the_attitude_on_the_wire_is_that_of_the_vehicles_messages():
    measured, message = np.zeros(len(TRUTH)), np.zeros(13)
    measured[[V, GAMMA, CHI, MU, ALPHA, BETA]] = 30.0, 0.1, -2.0, 0.3, 0.08, -0.05
    encode_state(measured, message)
    assert body_attitude(-2.0, 0.1, 0.3, 0.08, -0.05) == pytest.approx(message[:4].tolist(), abs=1e-6)


def test_a_target_is_read_with_respect_to_the_present_flight_path():
    random = np.random.default_rng(1)
    for gamma, chi, mu, alpha, beta in random.uniform(
        [-0.5, -3.1, -1.0, -0.1, -0.2], [0.5, 3.1, 1.0, 0.25, 0.2], (50, 5)
    ):
        row, why = command_from_ground(
            target(body_attitude(chi, gamma, mu, alpha, beta)), flying(gamma, chi), 4_000_000
        )
        assert why == ""
        assert row == pytest.approx((4.0, mu, alpha, beta), abs=1e-6)


@pytest.mark.parametrize("mu_alpha_beta", [(1.2, 0.0, 0.0), (0.0, 0.3, 0.0), (0.0, -0.2, 0.0), (0.0, 0.0, 0.3)])
def test_beyond_the_envelope_a_target_is_refused(mu_alpha_beta):
    row, why = command_from_ground(target(body_attitude(0.0, 0.0, *mu_alpha_beta)), flying(0.0, 0.0), 0)
    assert row is None
    assert "outside the envelope" in why


@pytest.mark.parametrize("q", [(0.0,) * 4, (1.1, 0.0, 0.0, 0.0), (math.nan,) * 4, (math.inf, 0.0, 0.0, 0.0)])
def test_what_is_no_unit_quaternion_is_refused(q):
    assert command_from_ground(target(q), flying(0.0, 0.0), 0) == (None, "attitude target: no unit quaternion")


def test_a_target_without_attitude_is_refused():
    mask = dialect.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE
    assert command_from_ground(target((1.0, 0.0, 0.0, 0.0), mask), flying(0.0, 0.0), 0)[0] is None


def test_what_level_flight_needs_by_the_nominal_model_is_what_the_airframe_needs():
    """Within what it leaves out: the thrust's share of the lift."""
    from ftcc.sim.trim import trim

    for speed in (25.0, 30.0, 35.0):
        needed, true = level_deflections(speed, autopilot().model), trim(AIRFRAME, speed)
        assert needed["thrust"] == pytest.approx(true.thrust, rel=0.03)
        assert needed["elevator"] == pytest.approx(true.elevator, abs=0.01)
