"""The sensors of an aircraft behind a door: white noise and constant biases, drawn by seed, UAV and sample.

Beyond these two errors nothing of real sensors is modelled: no drift, scale factor, misalignment, lever arm, vibration,
or delay of the receiver.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.link.compiled import compiled
from ftcc.link.home import Home
from ftcc.link.philox import DOOR, gaussian_pair, philox
from ftcc.link.rotation import body_axes

__all__ = ["Fix", "Motion", "Readings", "Sensors", "Sizes", "height_of", "pressure_at", "temperature_at"]

_PAIRS = 9
"""Pairs of random numbers in a sample: 11 of the fast sensors, 6 of the receiver."""
_BIASES = 1000
"""Where the pairs of the biases are counted from."""
_SEA_LEVEL, _LAPSE, _WARMTH, _EXPONENT = 101_325.0, 0.0065, 288.15, 5.25588
"""International standard atmosphere up to 11 km: Pa, K/m, K, g/(R lapse)."""
_THIN = 0.3
"""Least temperature ratio: far above what the atmosphere of 11 km describes, the pressure stays positive."""


class Sizes(NamedTuple):
    """Standard deviations: of the white noise of each sample, and of the constant bias of each axis (``..._bias``).

    The defaults are of the order of a small aircraft's sensors; they are no particular product's.
    """

    accelerometer: float = 0.05
    """m/s^2."""
    accelerometer_bias: float = 0.05
    """m/s^2."""
    gyroscope: float = 0.003
    """rad/s."""
    gyroscope_bias: float = 0.002
    """rad/s."""
    magnetometer: float = 0.003
    """gauss."""
    magnetometer_bias: float = 0.003
    """gauss."""
    barometer: float = 3.0
    """Pa; near sea level 0.25 m."""
    barometer_bias: float = 6.0
    """Pa."""
    pitot: float = 2.0
    """Pa, of the differential pressure."""
    pitot_bias: float = 1.0
    """Pa."""
    position: float = 0.4
    """m, north and east each, of the receiver."""
    height: float = 0.6
    """m, of the receiver."""
    velocity: float = 0.08
    """m/s, each axis, of the receiver."""
    position_bias: float = 0.5
    """m, each axis, of the receiver."""
    fix_us: int = 100_000
    """Time between two fixes of the receiver, us."""
    field: tuple[float, float, float] = (0.2175, 0.0133, 0.4333)
    """The earth's magnetic field, gauss, north, east, down: everywhere that of the default home."""


class Motion(NamedTuple):
    """What the sensors feel."""

    quaternion: tuple[float, float, float, float]
    """Body axes to north-east-down."""
    rates: tuple[float, float, float]
    """Body rates, rad/s, mean of the last period."""
    force: tuple[float, float, float]
    """Specific force forward, right, down, m/s^2, mean of the last period."""
    position: tuple[float, float, float]
    """North, east, altitude above z = 0, m."""
    velocity: tuple[float, float, float]
    """North, east, down, over the ground, m/s."""
    airspeed: float
    """Through the air, m/s."""
    density: float
    """Of the air that carries the aircraft, kg/m^3."""


class Fix(NamedTuple):
    """A fix of the receiver."""

    latitude: int
    """1e-7 deg."""
    longitude: int
    """1e-7 deg."""
    altitude: float
    """m above mean sea level."""
    velocity: tuple[float, float, float]
    """North, east, down, m/s."""


class Readings(NamedTuple):
    """A sample of the fast sensors."""

    force: tuple[float, float, float]
    """m/s^2, forward, right, down."""
    rates: tuple[float, float, float]
    """rad/s."""
    field: tuple[float, float, float]
    """gauss, body axes."""
    pressure: float
    """Pa."""
    differential: float
    """Pa."""
    temperature: float
    """deg C."""
    fix: Fix | None
    """A new one, where it is due."""


@compiled
def _draw(seed, sample, uav, first, out):
    """Fill ``out`` with independent standard normal numbers of this sample; ``first`` is the number of its pairs."""
    for pair in range(out.shape[0] // 2):
        u, v, _, _ = philox(seed, sample & 0xFFFFFFFF, uav, DOOR, first + pair)
        out[2 * pair], out[2 * pair + 1] = gaussian_pair(u, v)


def pressure_at(height: float) -> float:
    """Pressure (Pa) of the standard atmosphere at a height above mean sea level (m)."""
    return float(_SEA_LEVEL * max(1.0 - _LAPSE * height / _WARMTH, _THIN) ** _EXPONENT)


def height_of(pressure: float) -> float:
    """The inverse of `pressure_at`."""
    return float((1.0 - (pressure / _SEA_LEVEL) ** (1.0 / _EXPONENT)) * _WARMTH / _LAPSE)


def temperature_at(height: float) -> float:
    """Temperature (deg C) of the standard atmosphere at a height above mean sea level (m)."""
    return _WARMTH - _LAPSE * height - 273.15


class Sensors:
    """The sensors of one aircraft.

    Parameters
    ----------
    uav, seed : choose the random numbers.
    home : the origin of the local frame on earth.
    sizes : of noise and biases.
    """

    def __init__(self, uav: int, seed: int, home: Home, sizes: Sizes) -> None:
        self.uav, self.seed, self.home, self.sizes = uav, seed, home, sizes
        self._noise = np.zeros(2 * _PAIRS)
        biases: NDArray[np.float64] = np.zeros(2 * _PAIRS)
        _draw(seed, 0, uav, _BIASES, biases)
        self._biases: list[float] = biases.tolist()

    def read(self, sample: int, now_us: int, motion: Motion) -> Readings:
        """Return what the sensors show at this sample, at simulated time ``now_us``."""
        sizes, bias = self.sizes, self._biases
        _draw(self.seed, sample, self.uav, 0, self._noise)
        noise: list[float] = self._noise.tolist()

        def seen(n: int, true: float, deviation: float, offset: float) -> float:
            return true + deviation * noise[n] + offset * bias[n]

        height = self.home.altitude + motion.position[2]
        axes = body_axes(*motion.quaternion)
        field = [sum(a * b for a, b in zip(axis, sizes.field, strict=True)) for axis in axes]
        dynamic = 0.5 * motion.density * motion.airspeed * motion.airspeed
        return Readings(
            force=_three(seen(n, motion.force[n], sizes.accelerometer, sizes.accelerometer_bias) for n in range(3)),
            rates=_three(seen(3 + n, motion.rates[n], sizes.gyroscope, sizes.gyroscope_bias) for n in range(3)),
            field=_three(seen(6 + n, field[n], sizes.magnetometer, sizes.magnetometer_bias) for n in range(3)),
            pressure=seen(9, pressure_at(height), sizes.barometer, sizes.barometer_bias),
            differential=seen(10, dynamic, sizes.pitot, sizes.pitot_bias),
            temperature=temperature_at(height),
            fix=self._fix(noise, motion) if now_us % sizes.fix_us == 0 else None,
        )

    def _fix(self, noise: list[float], motion: Motion) -> Fix:
        sizes, bias = self.sizes, self._biases
        deviations = (sizes.position, sizes.position, sizes.height)
        north, east, up = (
            motion.position[n] + deviations[n] * noise[11 + n] + sizes.position_bias * bias[11 + n] for n in range(3)
        )
        velocity = _three(motion.velocity[n] + sizes.velocity * noise[14 + n] for n in range(3))
        return Fix(*self.home.place(north, east), self.home.altitude + up, velocity)


def _three(values: Iterable[float]) -> tuple[float, float, float]:
    first, second, third = values
    return first, second, third
