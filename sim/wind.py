"""Moving air: the mean wind of chapter 9, discrete gusts, Dryden turbulence, and motion relative to the air.

Gusts and turbulence have three components: along the track (tail wind > 0), to its right, and up, m/s. The air moves
as a whole; gradients of turbulence over span and length are in `ftcc.sim.turning_air`, where a scenario wants them.
Distances become times by the speed that the scenario gives: the field is frozen and flown through steadily.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.link.compiled import compiled, compiled_within, fields
from ftcc.link.philox import TURBULENCE, gaussian_pair, philox
from ftcc.link.rotation import body_axes
from ftcc.sim.turning_air import NOT_TURNING, TurningAir, turn

__all__ = [
    "AIR",
    "AIR_CHANNELS",
    "NO_TURBULENCE",
    "DiscreteGust",
    "Turbulence",
    "acceleration",
    "against",
    "blow",
    "dryden",
    "moving_air",
    "settled",
    "wind_speed",
]

AIR = ("wind_along", "wind_right", "wind_up")
"""The last of a plant's ``DISTURBANCES``: velocity of the air by gusts and turbulence."""

AIR_CHANNELS = (("wind", "m/s"), ("gust", "m/s"), *((name, "m/s") for name in AIR))
"""Mean wind V_m and gust A of (9.33), then `AIR`."""


class DiscreteGust(NamedTuple):
    """Columns of ``Fleet.gusts``: (1 - cos(pi x / d_m)) / 2 of each component, in time (MIL-F-8785C, 3.7.1.3)."""

    time: float
    """s."""
    rise: float
    """Time in which the length d_m is flown, s."""
    along: float
    """m/s."""
    right: float
    up: float
    until: float = math.inf
    """From this time on it falls as it rose, s; time + rise: the full 1-cosine of CS-25.341."""


class Turbulence(NamedTuple):
    """Dryden turbulence on a vehicle (MIL-F-8785C, 3.7.1.2), by component: along, right, up."""

    deviation: tuple[float, float, float] = (0.0,) * 3
    """sigma, m/s."""
    bandwidth: tuple[float, float, float] = (1.0,) * 3
    """V / L, rad/s."""
    step_us: int = 1000
    """Integration step of the plant, us, for which a value is held."""
    seed: int = 0
    turning: TurningAir = NOT_TURNING


NO_TURBULENCE = Turbulence()


class DrydenFilter(NamedTuple):
    """Columns of ``Fleet.dryden``: the exact discrete form of the filters of one component, see `dryden`."""

    deviation: float
    """sigma, m/s."""
    decay: float
    feed: float
    l11: float
    l21: float
    l22: float


_ALONG, _DEVIATION = DiscreteGust._fields.index("along"), DrydenFilter._fields.index("deviation")


def dryden(turbulence: Turbulence) -> NDArray[np.float64]:
    """The exact discrete form of the filters, (3, 6): a `DrydenFilter` per component.

    With a = V/L and white noise n: z' = -a z + sqrt(2 a) n, r' = a (z - r), both with a stationary z of variance 1. The
    air moves by sigma z along the track, spectrum 1/(1 + (L w/V)^2), and by sigma (sqrt(3) z + (1 - sqrt(3)) r)/sqrt(2)
    across, spectrum (1 + 3 (L w/V)^2)/(1 + (L w/V)^2)^2. Over a step z and r get noise of the covariance l l^T.
    """
    rows = np.zeros((len(AIR), len(DrydenFilter._fields)))
    for n, (deviation, bandwidth) in enumerate(zip(turbulence.deviation, turbulence.bandwidth, strict=True)):
        turn = bandwidth * turbulence.step_us / 1e6
        # Integrals of 2 exp(-2 t) times 1, t and t^2 up to `turn`, without the cancellation of their closed forms.
        first, mixed, second = _tail(1, 2.0 * turn), 0.5 * _tail(2, 2.0 * turn), 0.5 * _tail(3, 2.0 * turn)
        l11 = math.sqrt(first)
        l21 = mixed / l11
        decay = math.exp(-turn)
        l22 = math.sqrt(max(second - l21 * l21, 0.0))
        rows[n] = DrydenFilter(deviation, decay, turn * decay, l11, l21, l22)
    return rows


def _tail(terms: int, y: float) -> float:
    """exp(-y) times the exponential series without its first ``terms``, y >= 0."""
    term, total, n = y**terms / math.factorial(terms), 0.0, terms
    while total + term != total:
        total, n = total + term, n + 1
        term *= y / n
    return math.exp(-y) * total


def settled(turbulence: Turbulence, uav: int) -> NDArray[np.float64]:
    """States (3, 2) at the start, drawn from their stationary distribution: var z = 1, var r = cov(z, r) = 1/2."""
    draws = np.array(_normal(turbulence.seed, 0, uav)).reshape(len(AIR), 2)
    return np.array([(z, 0.5 * z + 0.5 * r) for z, r in draws.tolist()])


@compiled
def _normal(seed, draw, uav):
    """Six independent standard normal numbers of a vehicle, for this draw."""
    a, b, c, d = philox(seed, draw & 0xFFFFFFFF, uav, TURBULENCE, 0)
    e, f, _, _ = philox(seed, draw & 0xFFFFFFFF, uav, TURBULENCE, 1)
    n0, n1 = gaussian_pair(a, b)
    n2, n3 = gaussian_pair(c, d)
    n4, n5 = gaussian_pair(e, f)
    return n0, n1, n2, n3, n4, n5


@compiled_within
def _drive(state, row, first, second):
    """Move the states z and r of a filter on by a step, driven by two standard normal numbers."""
    z, step = state[0], fields(DrydenFilter, row)
    state[0] = step.decay * z + step.l11 * first
    state[1] = step.decay * state[1] + step.feed * z + step.l21 * first + step.l22 * second


@compiled
def blow(fleet, i, step):
    """Bring the turbulence of vehicle ``i`` to the beginning of this step, counted from 1, of its plant."""
    rows = fleet.dryden[i]
    n0, n1, n2, n3, n4, n5 = _normal(fleet.turbulence_seed[i], step, fleet.uav[i])
    if fleet.turns[i] == 1:
        turn(fleet, i, step, n4, n5, n2, n3)
    _drive(fleet.turbulence[i, 0], rows[0], n0, n1)
    _drive(fleet.turbulence[i, 1], rows[1], n2, n3)
    _drive(fleet.turbulence[i, 2], rows[2], n4, n5)


@compiled_within
def _cosine(since, rise):
    return 0.5 * (1.0 - math.cos(math.pi * since / rise)) if since < rise else 1.0


@compiled
def moving_air(fleet, i, component, time):
    """Velocity component of the air, see `AIR`, at vehicle ``i`` and ``time`` (s), m/s."""
    speed = 0.0
    for n in range(fleet.gusts.shape[1]):
        gust = fields(DiscreteGust, fleet.gusts[i, n])
        if time >= gust.time:
            grown = _cosine(time - gust.time, gust.rise)
            if time >= gust.until:
                grown = 1.0 - _cosine(time - gust.until, gust.rise)
            speed += fleet.gusts[i, n, _ALONG + component] * grown
    deviation = fleet.dryden[i, component, _DEVIATION]
    z, r = fleet.turbulence[i, component, 0], fleet.turbulence[i, component, 1]
    if deviation > 0.0:
        if component > 0:
            z = (math.sqrt(3.0) * z + (1.0 - math.sqrt(3.0)) * r) / math.sqrt(2.0)
        speed += deviation * z
    return speed


@compiled
def wind_speed(z, mean, gust):
    """Wind (m/s) at the altitude ``z`` (m), eq. (9.33)."""
    if mean == 0.0:
        return gust
    return 0.215 * mean * math.log10(max(z, 1.0)) + 0.285 * mean + gust


@compiled
def against(q0, q1, q2, q3, vx, vy, vz):
    """Speed, path angle, course, bank, angle of attack and sideslip of an attitude against a velocity (z up)."""
    ground = math.sqrt(vx * vx + vy * vy)
    speed = math.sqrt(ground * ground + vz * vz)
    gamma, chi = math.atan2(vz, ground), math.atan2(vy, vx)
    nose, wing, belly = body_axes(q0, q1, q2, q3)
    u = nose[0] * vx + nose[1] * vy - nose[2] * vz
    v = wing[0] * vx + wing[1] * vy - wing[2] * vz
    w = belly[0] * vx + belly[1] * vy - belly[2] * vz
    alpha, beta = math.atan2(w, u), math.atan2(v, math.sqrt(u * u + w * w))
    sideways = wing[1] * math.cos(chi) - wing[0] * math.sin(chi)
    downwards = wing[2] * math.cos(gamma) + math.sin(gamma) * (wing[0] * math.cos(chi) + wing[1] * math.sin(chi))
    return speed, gamma, chi, math.atan2(downwards, sideways), alpha, beta


@compiled
def acceleration(speed, gamma, chi, speed_rate, gamma_rate, chi_rate):
    """North, east and up, of a velocity whose speed, path angle and course change at these rates."""
    right, up = speed * math.cos(gamma) * chi_rate, speed * gamma_rate
    cg, sg, cc, sc = math.cos(gamma), math.sin(gamma), math.cos(chi), math.sin(chi)
    return (
        speed_rate * cg * cc - right * sc - up * sg * cc,
        speed_rate * cg * sc + right * cc - up * sg * sc,
        speed_rate * sg + up * cg,
    )
