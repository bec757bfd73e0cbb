"""Turning air: what Dryden turbulence is not as a whole over an aircraft's span and length (MIL-F-8785C, 3.7.5).

The air at the aircraft turns like a rigid body, by p_g about the horizontal track, by q_g about the axis to its right
and by r_g about the vertical, rad/s. Aerodynamic damping follows the aircraft's rates less these. Field and aircraft
are frozen and steady, as in `ftcc.sim.wind`: a gradient along the track is a rate over the airspeed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.link.compiled import compiled, fields
from ftcc.link.philox import TURBULENCE, gaussian_pair, philox
from ftcc.link.rotation import body_axes

__all__ = ["NOT_TURNING", "ROTATION", "TurningAir", "about_body_axes", "begin", "filters", "rotation", "turn", "turns"]

ROTATION = ("p_g", "q_g", "r_g")
"""The last of the fields of a plant's ``Disturbances``, where its air can turn; they are not recorded."""


class TurningAir(NamedTuple):
    """How the air of a ``wind.Turbulence`` turns."""

    deviation: float = 0.0
    """sigma of p_g, rad/s."""
    bandwidth: tuple[float, float, float] = (1.0,) * 3
    """Of p_g, q_g and r_g, rad/s."""
    airspeed: float = math.inf
    """m/s, by which a rate of the air's velocity becomes a gradient; inf: the air does not turn."""


NOT_TURNING = TurningAir()


class TurnFilter(NamedTuple):
    """Columns of ``Fleet.turning``: the exact discrete form of the filter of p_g, q_g or r_g, see `filters`."""

    gain: float
    """rad/s."""
    decay: float
    z: float
    """By which the states z and r of the gust's own filter move m in a step."""
    r: float
    first: float
    """By which normal numbers do: the two of the gust's own filter, and its own."""
    second: float
    own: float


Triple = tuple[float, float, float]

_Z, _R = math.sqrt(1.5), (1.0 - math.sqrt(3.0)) / math.sqrt(2.0)
"""A component across is sigma (_Z z + _R r), see ``wind.dryden``."""
_TERMS = 20
"""Of exponential series up to 1/2."""


def turns(air: TurningAir) -> bool:
    """Whether it turns at all."""
    return air.airspeed < math.inf


def filters(air: TurningAir, deviation: Triple, bandwidth: Triple, step_us: int) -> NDArray[np.float64]:
    """The exact discrete form of the filters, (3, 7): a `TurnFilter` each of p_g, q_g and r_g; zeros if it stands.

    MIL-F-8785C, 3.7.5, with V the airspeed and b the span: rolling gusts are noise by itself,
    Phi_p = sigma_w^2/L_w 0.8 (pi L_w/(4 b))^(1/3) / (1 + (4 b W/pi)^2) over the spatial frequency W. The others follow
    the gusts across, Phi_q = W^2 / (1 + (4 b W/pi)^2) Phi_w and Phi_r = W^2 / (1 + (3 b W/pi)^2) Phi_v: that is
    q_g = s/V / (1 + 4 b/(pi V) s) w and r_g = s/V / (1 + 3 b/(pi V) s) v, with w upwards and v to the right. Spectra
    have no signs; these are those of a body that turns: air that rises faster ahead turns nose up.

    With k the bandwidth (pi V/(4 b), for r_g pi V/(3 b)), p_g = gain m with m' = -k m + sqrt(2 k) n; the others are
    gain (x - m) with x the gust over its sigma, m' = k (x - m) and gain = sigma k/V. In a step, m gets noise that is
    correlated with that of the gust.

    Parameters
    ----------
    air : TurningAir
    deviation, bandwidth, step_us
        Of the gusts, see ``wind.Turbulence``.
    """
    h = step_us / 1e6
    rows = np.zeros((len(ROTATION), len(TurnFilter._fields)))
    if not turns(air):
        return rows
    rows[0] = TurnFilter(
        air.deviation,
        math.exp(-air.bandwidth[0] * h),
        0.0,
        0.0,
        0.0,
        0.0,
        math.sqrt(-math.expm1(-2.0 * air.bandwidth[0] * h)),
    )
    for n, component in ((1, 2), (2, 1)):
        a, k = bandwidth[component], air.bandwidth[n]
        phi, noise = _exact_step(a, k, h)
        l11 = math.sqrt(noise[0, 0])
        l21, l31 = noise[1, 0] / l11, noise[2, 0] / l11
        l22 = math.sqrt(max(noise[1, 1] - l21 * l21, 0.0))
        l32 = (noise[2, 1] - l31 * l21) / l22 if l22 > 0.0 else 0.0
        l33 = math.sqrt(max(noise[2, 2] - l31 * l31 - l32 * l32, 0.0))
        gain = deviation[component] * k / air.airspeed
        rows[n] = TurnFilter(gain, phi[2, 2], phi[2, 0], phi[2, 1], l31, l32, l33)
    return rows


def _exact_step(a: float, k: float, h: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Transition (3, 3) of z, r and m over a step of ``h`` (s), and covariance (3, 3) of the noise they get in it.

    Both by series over a short step that is doubled: their closed forms cancel, and have 0/0 where a = k.
    """
    system = np.array([[-a, 0.0, 0.0], [a, -a, 0.0], [k * _Z, k * _R, -k]])
    doublings = max(0, math.ceil(math.log2(4.0 * (a + k) * h)))
    short = h / 2.0**doublings
    terms = [np.eye(3)]
    for n in range(1, _TERMS):
        terms.append(system @ terms[-1] * (short / n))
    phi = np.sum(terms[::-1], axis=0)
    noise = np.zeros((3, 3))
    for i, one in enumerate(terms):
        for j, other in enumerate(terms):
            noise += np.outer(one[:, 0], other[:, 0]) * (2.0 * a * short / (i + j + 1))
    for _ in range(doublings):
        noise = phi @ noise @ phi.T + noise
        phi = phi @ phi
    return phi, noise


def begin(air: TurningAir, bandwidth: Triple, seed: int, uav: int, gusts: NDArray[np.float64]) -> NDArray[np.float64]:
    """States m (3,) of p_g, q_g and r_g at the start, drawn from their stationary distribution; zeros if it stands.

    Parameters
    ----------
    air : TurningAir
    bandwidth, seed
        Of the gusts, see ``wind.Turbulence``.
    uav : int
    gusts : array
        (3, 2): the states of the gusts, see ``wind.settled``.
    """
    if not turns(air):
        return np.zeros(len(ROTATION))
    own = _normal(seed, 0, uav)
    found = np.array([own[0], 0.0, 0.0])
    for n, component in ((1, 2), (2, 1)):
        a, k = bandwidth[component], air.bandwidth[n]
        # Stationary covariances of m with z and r, whose own are var z = 1, var r = cov(z, r) = 1/2; its variance.
        with_z = k * (_Z + 0.5 * _R) / (a + k)
        with_r = (a * with_z + 0.5 * k * (_Z + _R)) / (a + k)
        variance = _Z * with_z + _R * with_r
        z, r = gusts[component].tolist()
        by_r = 2.0 * (2.0 * with_r - with_z)
        by_z = with_z - 0.5 * by_r
        left = variance - by_z * with_z - by_r * with_r
        found[n] = by_z * z + by_r * r + math.sqrt(max(left, 0.0)) * own[n]
    return found


@compiled
def _normal(seed, draw, uav):
    """Three independent standard normal numbers of a vehicle, for this draw; none is one of its gusts."""
    a, b, c, d = philox(seed, draw & 0xFFFFFFFF, uav, TURBULENCE, 2)
    n0, n1 = gaussian_pair(a, b)
    n2, _ = gaussian_pair(c, d)
    return n0, n1, n2


@compiled
def turn(fleet, i, step, w0, w1, v0, v1):
    """Bring the rotation of the air of vehicle ``i`` to the beginning of this step, counted from 1, of its plant.

    Call it before the gusts move on, with the normal numbers that will drive those upwards (``w0``, ``w1``) and to the
    right (``v0``, ``v1``).
    """
    state = fleet.turned[i]
    own_p, own_q, own_r = _normal(fleet.turbulence_seed[i], step, fleet.uav[i])
    p, q, r = (
        fields(TurnFilter, fleet.turning[i, 0]),
        fields(TurnFilter, fleet.turning[i, 1]),
        fields(TurnFilter, fleet.turning[i, 2]),
    )
    w, v = fleet.turbulence[i, 2], fleet.turbulence[i, 1]
    state[0] = p.decay * state[0] + p.own * own_p
    state[1] = q.decay * state[1] + q.z * w[0] + q.r * w[1] + q.first * w0 + q.second * w1 + q.own * own_q
    state[2] = r.decay * state[2] + r.z * v[0] + r.r * v[1] + r.first * v0 + r.second * v1 + r.own * own_r


@compiled
def rotation(fleet, i, out):
    """Write p_g, q_g and r_g at vehicle ``i`` into ``out`` (3,), rad/s; about the track, to its right, downwards."""
    w, v, m = fleet.turbulence[i, 2], fleet.turbulence[i, 1], fleet.turned[i]
    out[0] = fleet.turning[i, 0, 0] * m[0]
    out[1] = fleet.turning[i, 1, 0] * (_Z * w[0] + _R * w[1] - m[1])
    out[2] = fleet.turning[i, 2, 0] * (_Z * v[0] + _R * v[1] - m[2])


@compiled
def about_body_axes(q0, q1, q2, q3, cos_chi, sin_chi, p_g, q_g, r_g):
    """Rotation of the air about the axes of a body with this attitude, for that of a course, rad/s."""
    north, east = p_g * cos_chi - q_g * sin_chi, p_g * sin_chi + q_g * cos_chi
    nose, wing, belly = body_axes(q0, q1, q2, q3)
    return (
        nose[0] * north + nose[1] * east + nose[2] * r_g,
        wing[0] * north + wing[1] * east + wing[2] * r_g,
        belly[0] * north + belly[1] * east + belly[2] * r_g,
    )
