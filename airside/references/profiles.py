"""A leader's profile: altitude and speed commands through a second-order filter, plus a cosine in altitude.

Eqs. (5.54)-(5.55); the filter is propagated exactly from tick to tick for the command in force.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from ftcc.airside.scheme import Reference
from ftcc.link.compiled import compiled

__all__ = ["Command", "Cosine", "Profile", "largest_climb", "new_profile_state", "profile_arrays", "refer"]


@dataclass(frozen=True)
class Command:
    """From ``at`` on (s), go to this altitude (m) and airspeed (m/s)."""

    at: float
    altitude: float
    speed: float


@dataclass(frozen=True)
class Cosine:
    """From ``at`` on (s): amplitude (cos(frequency (t - at)) - 1), m, added to the altitude."""

    at: float
    amplitude: float
    frequency: float


@dataclass(frozen=True)
class Profile:
    """A leader's commanded motion."""

    x: float
    """Forward position at the start, m."""
    z: float
    """Altitude at the start, m."""
    V: float
    """Airspeed at the start, m/s."""
    commands: tuple[Command, ...] = ()
    """In order of time."""
    altitude_filter: tuple[float, float] = (0.05, 0.9)
    """Natural frequency (rad/s) and damping of the altitude filter."""
    speed_filter: tuple[float, float] = (0.05, 0.95)
    cosine: Cosine | None = None


# Columns of the parameter vector of a profile.
_Z_PHI, _V_PHI = 0, 4
_Z_FREQUENCY, _Z_DAMPING, _V_FREQUENCY, _V_DAMPING = 8, 9, 10, 11
_COSINE_AT, _COSINE_AMPLITUDE, _COSINE_FREQUENCY = 12, 13, 14
_PARAMETERS = 15


def profile_arrays(profile: Profile, period: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The profile as the compiled functions want it: parameters (15,) and commands (n, 3) with rows (at, z, V)."""
    parameters = np.zeros(_PARAMETERS)
    for start, (frequency, damping) in (
        (_Z_PHI, profile.altitude_filter),
        (_V_PHI, profile.speed_filter),
    ):
        rates = np.array([[0.0, 1.0], [-frequency * frequency, -2.0 * damping * frequency]])
        parameters[start : start + 4] = expm(rates * period).ravel()
    parameters[_Z_FREQUENCY], parameters[_Z_DAMPING] = profile.altitude_filter
    parameters[_V_FREQUENCY], parameters[_V_DAMPING] = profile.speed_filter
    parameters[_COSINE_AT] = math.inf
    if profile.cosine is not None:
        parameters[_COSINE_AT] = profile.cosine.at
        parameters[_COSINE_AMPLITUDE] = profile.cosine.amplitude
        parameters[_COSINE_FREQUENCY] = profile.cosine.frequency
    rows = [(-math.inf, profile.z, profile.V)] + [(c.at, c.altitude, c.speed) for c in profile.commands]
    return parameters, np.array(rows)


def new_profile_state(profile: Profile) -> NDArray[np.float64]:
    """Filter state before the first tick: x, z, z_dot, V, V_dot."""
    return np.array([profile.x, profile.z, 0.0, profile.V, 0.0])


@compiled
def _command(commands, time):  # type: ignore[no-untyped-def]
    latest = 0
    for n in range(commands.shape[0]):
        if commands[n, 0] <= time:
            latest = n
    return commands[latest, 1], commands[latest, 2]


@compiled
def _filtered(phi, start, value, rate, target):  # type: ignore[no-untyped-def]
    offset = value - target
    return (
        target + phi[start] * offset + phi[start + 1] * rate,
        phi[start + 2] * offset + phi[start + 3] * rate,
    )


@compiled
def _forward(V: float, z_dot: float) -> float:
    return math.sqrt(max(V * V - z_dot * z_dot, 0.0))


@compiled
def refer(parameters, commands, state, reference, now_us, period_us):  # type: ignore[no-untyped-def]
    """Advance a profile to the tick at ``now_us`` and write its `Reference`; to be called once at every tick."""
    now = now_us / 1e6
    before = (now_us - period_us) / 1e6
    if now_us > 0:
        old_forward = _forward(state[3], reference[4])
        altitude, speed = _command(commands, before)
        state[1], state[2] = _filtered(parameters, _Z_PHI, state[1], state[2], altitude)
        state[3], state[4] = _filtered(parameters, _V_PHI, state[3], state[4], speed)
    altitude, speed = _command(commands, now)
    z, z_dot = state[1], state[2]
    w, damping = parameters[_Z_FREQUENCY], parameters[_Z_DAMPING]
    z_ddot = w * w * (altitude - z) - 2.0 * damping * w * z_dot
    since = now - parameters[_COSINE_AT]
    if since >= 0.0:
        amplitude, frequency = parameters[_COSINE_AMPLITUDE], parameters[_COSINE_FREQUENCY]
        z += amplitude * (math.cos(frequency * since) - 1.0)
        z_dot -= amplitude * frequency * math.sin(frequency * since)
        z_ddot -= amplitude * frequency * frequency * math.cos(frequency * since)
    if now_us > 0:
        state[0] += 0.5 * (old_forward + _forward(state[3], z_dot)) * period_us / 1e6
    reference[0] = state[0]
    reference[1], reference[2] = state[3], state[4]
    reference[3], reference[4], reference[5] = z, z_dot, z_ddot


def sampled(profile: Profile, duration: float, period: float) -> Any:
    """The profile over a flight: array (n, 6) in the order of `Reference`."""
    parameters, commands = profile_arrays(profile, period)
    state = new_profile_state(profile)
    period_us = round(period * 1e6)
    rows = np.zeros((int(duration / period) + 1, len(Reference._fields)))
    row = np.zeros(len(Reference._fields))
    for k in range(len(rows)):
        refer(parameters, commands, state, row, k * period_us, period_us)
        rows[k] = row
    return rows


def largest_climb(profile: Profile, duration: float) -> float:
    """Largest abs(climb rate) of the profile, m/s, on a grid of 0.1 s."""
    return float(np.abs(sampled(profile, duration, 0.1)[:, 4]).max())
