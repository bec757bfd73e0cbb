"""The sensors behind a door: units, noise by seed, and that they belong to the flight that is flown."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ftcc.link.home import Home
from ftcc.link.rotation import body_axes
from ftcc.sim.doors.sensors import Motion, Sensors, Sizes, height_of, pressure_at, temperature_at
from ftcc.sim.doors.vehicle import LAUNCH_US
from tests.sim.doors.bench import EXACT, a_vehicle

HOME = Home(47.3977, 8.5456, 400.0)
STILL = Motion((1.0, 0.0, 0.0, 0.0), (0.0,) * 3, (0.0, 0.0, -9.8), (0.0, 0.0, 100.0), (0.0,) * 3, 0.0, 1.205)
TRIM = np.array([0.0, -0.14, 0.0, 0.2])
"""Fractions of travel near level flight at 30 m/s."""


def test_the_atmosphere_is_the_standard_one():
    """International standard atmosphere, ISO 2533: pressure and temperature at 0, 1000 and 5000 m."""
    for height, pressure, temperature in ((0.0, 101325.0, 15.0), (1000.0, 89874.6, 8.5), (5000.0, 54019.9, -17.5)):
        assert pressure_at(height) == pytest.approx(pressure, rel=2e-4)
        assert temperature_at(height) == pytest.approx(temperature, abs=0.01)
        assert height_of(pressure_at(height)) == pytest.approx(height, abs=1e-6)


def test_exact_sensors_show_a_vehicle_at_rest():
    readings = Sensors(1, 1, HOME, EXACT._replace(field=(0.2, 0.0, 0.4))).read(0, 0, STILL)
    assert readings.force == (0.0, 0.0, -9.8)
    assert readings.field == (0.2, 0.0, 0.4)
    assert (readings.differential, readings.pressure) == (0.0, pressure_at(500.0))
    assert readings.fix is not None
    assert (readings.fix.latitude, readings.fix.longitude, readings.fix.altitude) == (473977000, 85456000, 500.0)


def test_noise_and_biases_have_their_sizes():
    sizes, samples = Sizes(), 4000
    sensors = Sensors(1, 7, HOME, sizes)
    seen = [sensors.read(n, 0, STILL) for n in range(samples)]
    columns = {
        sizes.accelerometer: [r.force[0] for r in seen],
        sizes.gyroscope: [r.rates[2] for r in seen],
        sizes.magnetometer: [r.field[1] for r in seen],
        sizes.barometer: [r.pressure for r in seen],
        sizes.pitot: [r.differential for r in seen],
        sizes.height: [r.fix.altitude for r in seen if r.fix],
        sizes.velocity: [r.fix.velocity[2] for r in seen if r.fix],
    }
    for size, column in columns.items():
        # The deviation of a deviation of n samples is 1/sqrt(2 n) of it: four of these.
        assert np.std(column) == pytest.approx(size, rel=4.0 / math.sqrt(2.0 * samples))
    offsets = [
        np.mean([Sensors(uav, 7, HOME, sizes).read(n, 1, STILL).force[0] for n in range(50)]) for uav in range(200)
    ]
    assert np.std(offsets) == pytest.approx(math.hypot(sizes.accelerometer_bias, 0.05 / math.sqrt(50)), rel=0.2)


def test_the_same_seed_gives_the_same_readings_in_any_order():
    one, other = Sensors(1, 7, HOME, Sizes()), Sensors(1, 7, HOME, Sizes())
    first = [one.read(n, 0, STILL) for n in range(5)]
    assert [other.read(n, 0, STILL) for n in reversed(range(5))] == first[::-1]
    assert Sensors(1, 8, HOME, Sizes()).read(0, 0, STILL) != first[0]
    assert Sensors(2, 7, HOME, Sizes()).read(0, 0, STILL) != first[0]


def test_fixes_come_in_their_period():
    sensors = Sensors(1, 1, HOME, Sizes())
    due = [now for now in range(0, 1_000_000, 4000) if sensors.read(0, now, STILL).fix]
    assert due == list(range(0, 1_000_000, 100_000))


def test_on_the_launcher_the_specific_force_is_one_g_and_then_that_of_the_launch():
    vehicle = a_vehicle("start.uav.1.mu=0", "start.uav.1.alpha=0.05", "start.uav.1.beta=0")
    vehicle.set_period(4000, exactly=True)
    vehicle.advance(np.zeros(4))
    forward, right, down = vehicle.motion.force
    assert (forward, right, down) == pytest.approx((9.8 * math.sin(0.05), 0.0, -9.8 * math.cos(0.05)), abs=1e-12)
    assert (vehicle.motion.airspeed, vehicle.motion.rates) == (0.0, (0.0, 0.0, 0.0))
    vehicle.launch()
    for _ in range(10):
        vehicle.advance(np.zeros(4))
    # 30 m/s in 2 s along a level path, under which the nose is 0.05 rad up.
    assert vehicle.motion.force[0] == pytest.approx(15.0 * math.cos(0.05) + 9.8 * math.sin(0.05), rel=1e-9)
    while not vehicle.flying:
        vehicle.advance(np.zeros(4))
    assert vehicle.true[:9] == pytest.approx([0.0, -45.0, 1000.0, 30.0, 0.0, 0.0, 0.0, 0.05, 0.0])
    assert vehicle.flown_us == 0
    assert LAUNCH_US % vehicle.period_us == 0


def test_dead_reckoning_by_exact_sensors_finds_the_true_flight():
    """Gyroscopes and accelerometers alone, integrated as an estimator does, in a turning and pitching flight."""
    vehicle = a_vehicle()
    vehicle.set_period(4000, exactly=True)
    vehicle.launch()
    while not vehicle.flying:
        vehicle.advance(TRIM)
    h, g = 0.004, 9.8
    attitude = np.array(vehicle.motion.quaternion)
    velocity, place = np.array(vehicle.motion.velocity), np.array(vehicle.motion.position)
    turned_most = 0.0
    for n in range(1250):
        swing = 0.06 * math.sin(0.01 * n)
        vehicle.advance(TRIM + np.array([0.02 + swing, 0.5 * swing, -swing, 0.0]))
        readings = vehicle.read_sensors()
        middle = turned(attitude, 0.5 * h * np.array(readings.rates))
        attitude = turned(attitude, h * np.array(readings.rates))
        turned_most = max(turned_most, float(np.abs(vehicle.true[6:9]).max()))
        before = velocity.copy()
        velocity += h * (np.array(body_axes(*middle)).T @ readings.force + [0.0, 0.0, g])
        place += 0.5 * h * (before + velocity) * [1.0, 1.0, -1.0]
    assert turned_most > 0.1
    assert velocity == pytest.approx(np.array(vehicle.motion.velocity), abs=0.02)
    assert place == pytest.approx(np.array(vehicle.motion.position), abs=0.1)
    assert abs(attitude @ vehicle.motion.quaternion) == pytest.approx(1.0, abs=1e-6)


def turned(quaternion: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """The attitude turned by a small rotation vector in body axes, rad."""
    size = float(np.linalg.norm(angle))
    w, v = math.cos(0.5 * size), angle * (0.5 if size == 0.0 else math.sin(0.5 * size) / size)
    q, u = quaternion[0], quaternion[1:]
    return np.array([q * w - u @ v, *(q * v + w * u + np.cross(u, v))])


def test_the_pitot_feels_the_air_and_not_the_ground():
    """Heading north in a wind of (9.33) that blows north: 0.215 V_m log10(1000) + 0.285 V_m for V_m = 5 m/s."""
    vehicle = a_vehicle("wind.mean=5", "start.uav.1.mu=0", "start.uav.1.beta=0")
    vehicle.set_period(4000, exactly=True)
    vehicle.launch()
    for _ in range(LAUNCH_US // 4000 + 1):
        vehicle.advance(TRIM)
    assert vehicle.motion.airspeed == pytest.approx(vehicle.true[3] - 4.65, abs=0.01)
    assert vehicle.read_sensors().differential == pytest.approx(0.5 * 1.205 * vehicle.motion.airspeed**2)
