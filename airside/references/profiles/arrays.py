"""Profiles as the arrays on which compiled functions work."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from ftcc.airside.references.profiles.data import Profile
from ftcc.link.compiled import store, width

__all__ = [
    "ALTITUDE",
    "CLAMPED",
    "CLIMB",
    "CLIMB_LIMIT",
    "FIRED",
    "FROM_GROUND",
    "PROFILE_PARAMETERS",
    "PROFILE_STATES",
    "SINK_LIMIT",
    "SPEED",
    "SPEED_RATE",
    "TRIGGER_COLUMNS",
    "Matrix",
    "ProfileParameters",
    "TriggerRow",
    "X",
    "new_profile_state",
    "profile_arrays",
    "trigger_rows",
]

Matrix = tuple[float, float, float, float]
"""2 x 2, row by row."""


class ProfileParameters(NamedTuple):
    """A profile but for its start and its commands."""

    altitude_phi: Matrix
    """Transition matrix of the altitude filter over a control period: of the offset from its command, and its rate."""
    speed_phi: Matrix
    altitude_frequency: float
    """rad/s."""
    altitude_damping: float
    cosine_at: float
    """s; inf: there is none."""
    cosine_amplitude: float
    """m."""
    cosine_frequency: float
    """rad/s."""
    forward: float
    """1 where speeds are forward speeds."""
    wave_amplitude: float
    """m/s."""
    wave_frequency: float
    """rad/s; 0: there is no wave."""
    climb_limit: float
    """m/s."""
    sink_limit: float
    """m/s."""


PROFILE_PARAMETERS = width(ProfileParameters)
CLIMB_LIMIT, SINK_LIMIT = PROFILE_PARAMETERS - 2, PROFILE_PARAMETERS - 1
"""Columns of the parameters."""
assert ProfileParameters._fields[-2:] == ("climb_limit", "sink_limit")

X, ALTITUDE, CLIMB, SPEED, SPEED_RATE = range(5)
"""Columns of the state: forward position, m; altitude, m, and speed, m/s, each with its rate."""
FIRED = 5
"""Column of the state: how many of the triggers have fired."""
CLAMPED = 6
"""Column of the state: 1 while the climb rate is held at the profile's limit."""
PROFILE_STATES = 7

FROM_GROUND = 4
"""The last rows of a profile's commands: commands of the ground, in order of time, which overrule all others."""


class TriggerRow(NamedTuple):
    """A command by position."""

    edge: float
    """In-edge of the watched leader; -1: this one itself."""
    x: float
    """Its forward position, m; inf: the row is not used."""
    altitude: float
    """m."""
    speed: float
    """m/s."""


TRIGGER_COLUMNS = len(TriggerRow._fields)


def profile_arrays(profile: Profile, period: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The profile for control periods of ``period`` s: `ProfileParameters`, and commands (n, 3) with rows (at, z, V).

    The last `FROM_GROUND` rows are free.
    """
    cosine, wave = profile.cosine, profile.speed_wave
    parameters = np.zeros(PROFILE_PARAMETERS)
    values = ProfileParameters(
        altitude_phi=_transition(*profile.altitude_filter, period),
        speed_phi=_transition(*profile.speed_filter, period),
        altitude_frequency=profile.altitude_filter[0],
        altitude_damping=profile.altitude_filter[1],
        cosine_at=math.inf if cosine is None else cosine.at,
        cosine_amplitude=0.0 if cosine is None else cosine.amplitude,
        cosine_frequency=0.0 if cosine is None else cosine.frequency,
        forward=float(profile.forward),
        wave_amplitude=0.0 if wave is None else wave.amplitude,
        wave_frequency=0.0 if wave is None else wave.frequency,
        climb_limit=profile.climb_limit,
        sink_limit=profile.sink_limit,
    )
    store(values, parameters)
    rows = [(-math.inf, profile.z, profile.V)] + [(c.at, c.altitude, c.speed) for c in profile.commands]
    return parameters, np.array(rows + [(math.inf, math.inf, math.inf)] * FROM_GROUND)


def _transition(frequency: float, damping: float, period: float) -> Matrix:
    """Of y'' = -w^2 y - 2 zeta w y' over one period."""
    rates = np.array([[0.0, 1.0], [-frequency * frequency, -2.0 * damping * frequency]])
    a, b, c, d = expm(rates * period).ravel().tolist()
    return a, b, c, d


def trigger_rows(profile: Profile, uav: int, senders: Sequence[int]) -> NDArray[np.float64]:
    """The commands by position of leader ``uav``, shape (n, c), see `TriggerRow`; ``senders`` are its in-neighbours.

    Raises
    ------
    ValueError
        If a trigger watches a UAV that this leader does not hear.
    """
    rows = np.zeros((len(profile.triggers), TRIGGER_COLUMNS))
    for row, trigger in zip(rows, profile.triggers, strict=True):
        if trigger.uav != uav and trigger.uav not in senders:
            raise ValueError(
                f"the profile of leader {uav} waits for UAV {trigger.uav} to pass x = {trigger.x:g} m, "
                f"but there is no edge {trigger.uav} -> {uav} over which it would hear that"
            )
        edge = -1 if trigger.uav == uav else senders.index(trigger.uav)
        store(TriggerRow(edge, trigger.x, trigger.altitude, trigger.speed), row)
    return rows


def new_profile_state(profile: Profile) -> NDArray[np.float64]:
    """State before the first tick: x, z, z_dot, V, V_dot, number of triggers fired, climb rate clamped."""
    return np.array([profile.x, profile.z, 0.0, profile.V, 0.0, 0.0, 0.0])
