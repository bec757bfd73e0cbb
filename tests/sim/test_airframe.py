"""The longitudinal equations of motion."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ftcc.sim.airframe import longitudinal_rates
from tests.support.swarm import AIRFRAME

NONE = (0.0, 0.0, 0.0)


def forces_in_path_axes(V, gamma, theta, q, thrust, elevator, disturbances):
    """Newton's and Euler's equations from force vectors in inertial axes (north, up), independent of (2.8)-(2.12)."""
    a = AIRFRAME
    alpha = theta - gamma
    pressure = 0.5 * a.rho * V**2
    drag = pressure * a.S * (a.CD0 + a.CDa * alpha + a.CDa2 * alpha**2)
    lift = pressure * a.S * (a.CL0 + a.CLa * alpha + a.CLde * elevator)
    moment = pressure * a.S * a.c * (a.Cm0 + a.Cma * alpha + a.Cmde * elevator + a.Cmq * (q * a.c / (2.0 * V)))
    along, normal = np.array([math.cos(gamma), math.sin(gamma)]), np.array([-math.sin(gamma), math.cos(gamma)])
    body = np.array([math.cos(theta), math.sin(theta)])
    acceleration = (thrust * body - drag * along + lift * normal) / a.m - np.array([0.0, a.g])
    velocity = V * along
    return (
        float(acceleration @ along) + disturbances[0],
        velocity[0],
        velocity[1],
        float(acceleration @ normal) / V + disturbances[1],
        q,
        moment / a.Iy + disturbances[2],
    )


def test_rates_are_those_of_the_force_vectors():
    random = np.random.default_rng(1)
    for _ in range(300):
        state = random.uniform([12.0, -1.2, -1.2, -1.5], [50.0, 1.2, 1.2, 1.5])
        state[2] = state[1] + random.uniform(-0.4, 0.4)
        inputs = random.uniform([0.0, -0.7], [40.0, 0.7])
        disturbances = random.uniform(-0.5, 0.5, 3)
        arguments = [float(value) for value in (*state, *inputs)]
        d = tuple(float(value) for value in disturbances)
        rates = longitudinal_rates(*arguments, *d, AIRFRAME)
        assert rates == pytest.approx(forces_in_path_axes(*arguments, d), rel=1e-12, abs=1e-12)


def test_energy_grows_by_the_work_of_thrust_and_falls_by_that_of_drag():
    """d/dt (m V^2/2 + m g z) = V (T cos(alpha) - D): lift and gravity do no work on the sum."""
    a = AIRFRAME
    random = np.random.default_rng(2)
    for _ in range(100):
        V, gamma, alpha = (float(v) for v in random.uniform([15.0, -1.0, -0.3], [45.0, 1.0, 0.3]))
        thrust, elevator = (float(v) for v in random.uniform([0.0, -0.7], [40.0, 0.7]))
        V_dot, _, z_dot, *_ = longitudinal_rates(V, gamma, gamma + alpha, 0.2, thrust, elevator, *NONE, a)
        drag = 0.5 * a.rho * V**2 * a.S * (a.CD0 + a.CDa * alpha + a.CDa2 * alpha**2)
        assert a.m * (V * V_dot + a.g * z_dot) == pytest.approx(V * (thrust * math.cos(alpha) - drag), abs=1e-9)


def test_signs_are_those_of_the_field():
    level = (30.0, 0.0, 0.0322, 0.0, 21.3, -0.19688)
    base = longitudinal_rates(*level, *NONE, AIRFRAME)
    nose_down = longitudinal_rates(*level[:5], -0.09688, *NONE, AIRFRAME)
    assert nose_down[5] < base[5], "a positive elevator pitches down"
    assert nose_down[3] > base[3], "and lifts"
    assert longitudinal_rates(*level[:4], 25.0, level[5], *NONE, AIRFRAME)[0] > base[0]
    assert longitudinal_rates(30.0, 0.0, 0.1, *level[3:], *NONE, AIRFRAME)[3] > base[3], "alpha lifts"
    assert longitudinal_rates(30.0, 0.0, 0.1, *level[3:], *NONE, AIRFRAME)[5] < base[5], "and is stable"
    assert longitudinal_rates(30.0, 0.0, 0.0322, 0.5, *level[4:], *NONE, AIRFRAME)[5] < base[5], "pitch is damped"
