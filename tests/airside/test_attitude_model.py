"""The laws' attitude model against the equations of motion of the true aircraft."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ftcc.airside.attitude_model import (
    attitude_drift,
    body_rate_model,
    deflections_for,
    kinematics,
    kinematics_inverse,
)
from ftcc.airside.elements.vectors import added, applied
from ftcc.sim.airframe import attitude_rates
from tests.support.swarm import AIRFRAME, nominal

MODEL = nominal(thrust=120.0, elevator=1.0, sideways=1.0)
NO_LIFT = AIRFRAME._replace(CLde=0.0)
STATES = [
    # V, gamma, mu, alpha, beta, p, q, r
    (27.0, -0.05, 0.2, 0.06, 0.03, 0.1, -0.08, 0.05),
    (12.0, 0.6, -1.2, 0.25, -0.4, -1.0, 0.5, 0.7),
    (35.0, -0.9, 2.5, -0.1, 0.9, 2.0, -1.5, -0.3),
]


def true_rates(state, deflections, thrust):
    """Rates of X1 and X2 of the aircraft whose elevator gives no lift."""
    rates = attitude_rates(*state, *deflections, thrust, 0.0, 0.0, 0.0, NO_LIFT)
    return np.array(rates[3:6]), np.array(rates[6:9])


@pytest.mark.parametrize("state", STATES)
def test_attitude_turns_as_the_true_aircraft_does(state):
    """X1' = F1 + G1 X2 of (7.1)."""
    V, gamma, mu, alpha, beta, rates = *state[:5], state[5:]
    turning = applied(kinematics(alpha, beta), rates)
    drift = attitude_drift(V, gamma, (mu, alpha, beta), 25.0, V, MODEL)
    assert added(drift, turning) == pytest.approx(true_rates(state, (0.0, 0.0, 0.0), 25.0)[0], rel=1e-12)


@pytest.mark.parametrize("state", STATES)
def test_body_rates_change_as_those_of_the_true_aircraft(state):
    """X2' = F2 + G2 U of (7.2)."""
    V, alpha, beta, rates = state[0], state[3], state[4], state[5:]
    deflections = (0.02, -0.15, -0.3)
    drift, effect = body_rate_model(V, alpha, beta, rates, V, MODEL)
    assert added(drift, applied(effect, deflections)) == pytest.approx(
        true_rates(state, deflections, 25.0)[1], rel=1e-12
    )
    assert deflections_for(effect, applied(effect, deflections)) == pytest.approx(deflections, rel=1e-12)


def test_effect_of_the_surfaces_at_30_metres_per_second():
    """Reference airframe: G2 at 30 m/s; it grows with V^2."""
    _, effect = body_rate_model(30.0, 0.0, 0.0, (0.0, 0.0, 0.0), 30.0, MODEL)
    expected = np.array([[-68.703, 0.0, 1.850], [0.0, -50.005, 0.0], [-1.597, 0.0, -15.934]])
    assert np.array(effect) == pytest.approx(expected, abs=5e-4)
    _, at_15 = body_rate_model(15.0, 0.0, 0.0, (0.0, 0.0, 0.0), 15.0, MODEL)
    assert np.array(at_15) == pytest.approx(expected / 4.0, abs=5e-4)


@pytest.mark.parametrize(("alpha", "beta"), [(0.1, 0.05), (-0.4, 1.2), (1.0, -0.9)])
def test_the_kinematics_and_their_inverse(alpha, beta):
    """det G1 = -1/cos(beta)."""
    G1, inverse = np.array(kinematics(alpha, beta)), np.array(kinematics_inverse(alpha, beta))
    assert G1 @ inverse == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(G1) == pytest.approx(-1.0 / math.cos(beta))
