"""Thrust, load factor and bank survive the way as an attitude target."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ftcc.link.attitude_target import AttitudeCode, decode_target, encode_target, path_of

CODE = AttitudeCode(2.0 * 25.0 * 9.8 / (1.205 * 1.463), 0.2153, 4.6333)
TRAVEL = np.array([1.2, 2.0, 0.0, 120.0])


def test_there_and_back_over_the_envelope():
    """Bank, load factor and thrust to float32 of the quaternion: 1e-6 rad of bank, 1e-5 of load factor."""
    random = np.random.default_rng(1)
    target, back = np.zeros(5), np.zeros(4)
    for _ in range(2000):
        command = random.uniform([-1.2, 0.1, 0.0, 0.0], [1.2, 2.0, 0.0, 120.0])
        V, gamma, chi = random.uniform([22.0, -0.5, -math.pi], [60.0, 0.5, math.pi])
        encode_target(command, V, gamma, chi, TRAVEL, np.array(CODE), target)
        decode_target(target, V, gamma, chi, TRAVEL, np.array(CODE), back)
        assert back == pytest.approx(command, abs=2e-5, rel=1e-6)
        assert np.linalg.norm(target[:4]) == pytest.approx(1.0, abs=1e-6)


def test_the_quaternion_is_path_bank_and_angle_of_attack():
    """R = Rz(chi) Ry(gamma) Rx(mu) Ry(alpha); 1.3 g at 35 m/s are 3.1 deg."""
    target = np.zeros(5)
    encode_target(np.array([0.4, 1.3, 0.0, 30.0]), 35.0, 0.1, 2.0, TRAVEL, np.array(CODE), target)
    alpha = (1.3 * CODE.loading / 35.0**2 - 0.2153) / 4.6333
    expected = Rotation.from_euler("ZYX", [2.0, 0.1, 0.4]) * Rotation.from_euler("Y", alpha)
    shown = Rotation.from_quat(target[:4], scalar_first=True)
    assert (shown.inv() * expected).magnitude() < 1e-6
    assert target[4] == pytest.approx(0.25)


def test_path_of_a_velocity():
    assert path_of(3.0, -4.0, -1.0) == pytest.approx((math.sqrt(26.0), math.atan2(1.0, 5.0), math.atan2(-4.0, 3.0)))
