"""What profiles ask of a swarm, before it flies: their motion over a flight, climb rates, accelerations."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.references.longitudinal import Reference
from ftcc.airside.references.profiles.arrays import TRIGGER_COLUMNS, new_profile_state, profile_arrays, trigger_rows
from ftcc.airside.references.profiles.data import Profile
from ftcc.airside.references.profiles.motion import armed, refer
from ftcc.link.compiled import compiled, copy

__all__ = ["climb_of_step", "climb_range", "largest_acceleration", "sampled"]

_X, _Z_DOT, _Z_DDOT, _X_DOT = (Reference._fields.index(name) for name in ("x", "z_dot", "z_ddot", "x_dot"))


def climb_of_step(altitude_filter: tuple[float, float], step: float) -> float:
    """Largest climb rate (m/s) of the altitude filter (rad/s, damping) at a step of the commanded altitude (m)."""
    frequency, damping = altitude_filter
    if damping < 1.0:
        root = math.sqrt(1.0 - damping * damping)
        return abs(step) * frequency * math.exp(-damping * math.acos(damping) / root)
    if damping == 1.0:
        return abs(step) * frequency / math.e
    root = math.sqrt(damping * damping - 1.0)
    return abs(step) * frequency * math.exp(-damping * math.acosh(damping) / root)


def sampled(profiles: Mapping[int, Profile], duration: float, period: float) -> dict[int, Any]:
    """The leaders' profiles over a flight, by id: arrays (n, c) in the order of `Reference`; all hear each other.

    The arrays are read-only: the next call with the same arguments returns the same ones.
    """
    if not profiles:
        return {}
    return dict(zip(profiles, _sampled(tuple(profiles.items()), duration, period), strict=True))


@functools.lru_cache(maxsize=8)
def _sampled(profiles: tuple[tuple[int, Profile], ...], duration: float, period: float) -> NDArray[np.float64]:
    uavs = [uav for uav, _ in profiles]
    arrays = [profile_arrays(profile, period) for _, profile in profiles]
    waits = [trigger_rows(profile, uav, uavs) for uav, profile in profiles]
    commands = np.full((len(uavs), max(len(rows) for _, rows in arrays), 3), math.inf)
    triggers = np.full((len(uavs), max((1, *map(len, waits))), TRIGGER_COLUMNS), math.inf)
    for i, ((_, given), awaited) in enumerate(zip(arrays, waits, strict=True)):
        commands[i, : len(given)] = given
        triggers[i, : len(awaited)] = awaited
    parameters = np.array([row for row, _ in arrays])
    states = np.array([new_profile_state(profile) for _, profile in profiles])
    width = len(Reference._fields)
    rows = np.zeros((len(uavs), int(duration / period) + 1, width))
    watched = np.zeros(len(uavs))
    _sample(parameters, commands, triggers, states, np.zeros((len(uavs), width)), watched, round(period * 1e6), rows)
    rows.flags.writeable = False
    return rows


@compiled
def _sample(parameters, commands, triggers, states, row, watched, period_us, rows):
    """Fly all profiles tick by tick into ``rows`` (k, n, c); ``row`` (k, c) and ``watched`` (k,) are scratch."""
    period = period_us / 1e6
    for n in range(rows.shape[1]):
        # Of the others each leader has the last position, carried over one period.
        for i in range(rows.shape[0]):
            watched[i] = row[i, _X] + row[i, _X_DOT] * period
        for i in range(rows.shape[0]):
            edge = armed(triggers[i], states[i])
            position = watched[edge] if edge >= 0 and n > 0 else math.nan
            refer(parameters[i], commands[i], triggers[i], states[i], row[i], position, n * period_us, period_us)
            copy(row[i], rows[i, n])


def climb_range(profiles: Mapping[int, Profile], duration: float) -> dict[int, tuple[float, float]]:
    """Largest sink rate and largest climb rate of each leader's profile, m/s, on a grid of 0.1 s."""
    return {
        uav: (float(-row[:, _Z_DOT].min()), float(row[:, _Z_DOT].max()))
        for uav, row in sampled(profiles, duration, 0.1).items()
    }


def largest_acceleration(profiles: Mapping[int, Profile], duration: float) -> float:
    """Largest acceleration of the leaders along either axis, m/s^2, on a grid of 0.1 s."""
    found = [0.0]
    for row in sampled(profiles, duration, 0.1).values():
        found += [*np.abs(row[:, _Z_DDOT]).tolist(), *(np.abs(np.diff(row[:, _X_DOT])) / 0.1).tolist()]
    return float(max(found))
