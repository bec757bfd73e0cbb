"""What a vehicle reports: the two state messages back to flight-path variables, and measurement noise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ftcc.airside.flight_path import Own, decode_state
from ftcc.link.messages import StateMessage
from ftcc.sim.build import build_fleet
from ftcc.sim.plant import TRUTH
from ftcc.sim.plants import cycle_of
from ftcc.sim.sensors import encode_state
from tests.support.swarm import noise, vehicle

LOWEST = {
    "x": -1e4, "y": -2e3, "z": -100.0, "V": 12.0, "gamma": -0.6, "chi": -3.1, "mu": -1.3, "alpha": -0.2, "beta": -0.3,
    "p": -2.0, "q": -2.0, "r": -2.0, "theta": 0.0,
}  # fmt: skip
HIGHEST = {
    "x": 1e4, "y": 2e3, "z": 3000.0, "V": 50.0, "gamma": 0.6, "chi": 3.1, "mu": 1.3, "alpha": 0.35, "beta": 0.3,
    "p": 2.0, "q": 2.0, "r": 2.0, "theta": 0.0,
}  # fmt: skip
"""The envelope, bank and sideslip included."""

FLOAT32 = 2.0**-23


def encoded(measured: np.ndarray) -> np.ndarray:
    message = np.zeros(len(StateMessage._fields))
    encode_state(measured, message)
    return message


def decoded(message: np.ndarray, t: float = 0.0, command: tuple[float, ...] = (0.0,) * 4) -> Own:
    own = np.zeros(len(Own._fields))
    decode_state(message, t, np.array(command), own)
    return Own(*own.tolist())


def envelope(count: int, **fixed: float) -> np.ndarray:
    """States drawn evenly from the envelope, in the order of ``TRUTH``."""
    random = np.random.default_rng(1)
    low, high = ([edges[name] for name in TRUTH] for edges in (LOWEST, HIGHEST))
    states = random.uniform(low, high, (count, len(TRUTH)))
    for name, value in fixed.items():
        states[:, TRUTH.index(name)] = value
    return states


def test_flight_path_variables_come_back_to_float32_accuracy():
    """V, gamma, chi, mu, alpha, beta, position and rates: the angles from a quaternion and a velocity."""
    for state in envelope(1000):
        own = decoded(encoded(state))
        for name, value in zip(TRUTH, state.tolist(), strict=True):
            if name == "theta":
                continue
            tolerance = 4.0 * FLOAT32 * max(1.0, abs(value))
            assert getattr(own, name) == pytest.approx(value, abs=tolerance), name


def test_in_the_vertical_plane_pitch_is_flight_path_angle_plus_angle_of_attack():
    for state in envelope(300, chi=0.0, mu=0.0, beta=0.0):
        own = decoded(encoded(state))
        assert own.theta == pytest.approx(own.gamma + own.alpha, abs=4.0 * FLOAT32)
        assert (own.chi, own.mu, own.beta) == pytest.approx((0.0, 0.0, 0.0), abs=4.0 * FLOAT32)


def test_the_quaternion_is_the_rotation_from_body_to_north_east_down():
    """Against scipy: the path frame (chi, gamma, mu), turned by minus sideslip about z and by alpha about y."""
    for state in envelope(200):
        motion = dict(zip(TRUTH, state.tolist(), strict=True))
        message = encoded(state)
        turns = [motion["chi"], motion["gamma"], motion["mu"], -motion["beta"], motion["alpha"]]
        expected = Rotation.identity()
        for axis, angle in zip("ZYXZY", turns, strict=True):
            expected = expected * Rotation.from_euler(axis, angle)
        q0, q1, q2, q3 = message[:4]
        found = Rotation.from_quat([q1, q2, q3, q0])
        assert (found.inv() * expected).magnitude() < 4.0 * FLOAT32
        assert decoded(message).theta == pytest.approx(expected.as_euler("ZYX")[1], abs=8.0 * FLOAT32)
        velocity = expected.inv().apply(message[10:13])
        assert math.atan2(velocity[2], velocity[0]) == pytest.approx(motion["alpha"], abs=8.0 * FLOAT32)
        assert math.asin(velocity[1] / motion["V"]) == pytest.approx(motion["beta"], abs=8.0 * FLOAT32)


def test_a_message_holds_exactly_what_float32_holds():
    for state in envelope(50):
        message = encoded(state)
        assert np.array_equal(message, message.astype(np.float32).astype(np.float64))


def test_altitude_is_up_in_laws_and_down_in_messages():
    state = np.zeros(len(TRUTH))
    state[TRUTH.index("z")], state[TRUTH.index("V")], state[TRUTH.index("gamma")] = 1000.0, 30.0, 0.1
    message = encoded(state)
    assert message[StateMessage._fields.index("z")] == -1000.0
    assert message[StateMessage._fields.index("vz")] == pytest.approx(-30.0 * math.sin(0.1))


def test_stamp_and_command_in_force_are_handed_on():
    own = decoded(encoded(envelope(1)[0]), 12.34, (0.01, -0.2, 0.03, 21.0))
    assert own.t == 12.34
    assert (own.aileron, own.elevator, own.rudder, own.thrust) == (0.01, -0.2, 0.03, 21.0)


# Noise.


def measured(deviations: tuple[float, ...], ticks: int, seed: int = 1, uav: int = 1) -> np.ndarray:
    """Measurements of a fixed truth, shape (ticks, 13)."""
    fleet = build_fleet([vehicle(uav, noise=deviations)])
    true = np.array([100.0, -5.0, 1000.0, 30.0, 0.02, 0.1, 0.05, 0.03, 0.0, 0.05, 0.01, 0.02, 0.03])
    rows = np.zeros((ticks, len(TRUTH)))
    for tick in range(ticks):
        cycle_of("longitudinal").measure(fleet, 0, tick, seed, true, rows[tick])
    return rows - true


def test_there_is_no_noise_unless_asked_for():
    assert not measured(noise(), 50).any()


def test_every_channel_has_its_own_white_noise_of_its_own_size():
    sizes = {name: 0.01 * (n + 1) for n, name in enumerate(TRUTH) if name != "alpha"}
    n = 5000
    errors = measured(noise(**sizes), n)
    names = [name for name in TRUTH if name != "alpha"]
    columns = errors[:, [TRUTH.index(name) for name in names]]
    for column, name in zip(columns.T, names, strict=True):
        assert abs(column.mean()) < 4.0 * sizes[name] / math.sqrt(n), name
        assert column.std() == pytest.approx(sizes[name], rel=4.0 / math.sqrt(2.0 * n)), name
        assert abs(np.corrcoef(column[:-1], column[1:])[0, 1]) < 4.0 / math.sqrt(n), name
    correlations = np.corrcoef(columns.T) - np.eye(len(names))
    assert np.abs(correlations).max() < 4.5 / math.sqrt(n)


def test_noise_of_one_channel_leaves_the_others_alone():
    errors = measured(noise(z=0.1), 50)
    assert errors[:, TRUTH.index("z")].std() > 0.05
    assert not np.delete(errors, TRUTH.index("z"), axis=1)[:, : TRUTH.index("V")].any()
    others = np.delete(errors, [TRUTH.index("z"), TRUTH.index("alpha")], axis=1)
    assert not others.any()


def test_measured_angle_of_attack_is_measured_pitch_minus_measured_flight_path_angle():
    """One quaternion and one velocity cannot say otherwise: noise of theta and gamma is what alpha has."""
    errors = measured(noise(gamma=0.002, theta=0.002), 2000)
    gamma, alpha, theta = (errors[:, TRUTH.index(name)] for name in ("gamma", "alpha", "theta"))
    assert alpha == pytest.approx(theta - gamma, abs=1e-12)
    assert alpha.std() == pytest.approx(0.002 * math.sqrt(2.0), rel=0.07)


def test_an_angle_of_attack_measured_itself_leaves_the_pitch_angle_to_follow():
    errors = measured(noise(gamma=0.002, alpha=0.002), 2000)
    gamma, alpha, theta = (errors[:, TRUTH.index(name)] for name in ("gamma", "alpha", "theta"))
    assert theta == pytest.approx(gamma + alpha, abs=1e-12)
    assert alpha.std() == pytest.approx(0.002, rel=0.07)
    assert abs(np.corrcoef(gamma, alpha)[0, 1]) < 4.5 / math.sqrt(2000)


def test_noise_belongs_to_seed_uav_and_tick():
    sizes = noise(V=0.05, z=0.1, gamma=0.002, theta=0.002, q=0.005)
    assert np.array_equal(measured(sizes, 20), measured(sizes, 20))
    assert not np.isclose(measured(sizes, 20, seed=2), measured(sizes, 20))[:, TRUTH.index("z")].any()
    assert not np.isclose(measured(sizes, 20, uav=2), measured(sizes, 20))[:, TRUTH.index("z")].any()
