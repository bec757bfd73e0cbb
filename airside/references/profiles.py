"""A leader's profile: altitude and speed commands through second-order filters, by time or by position.

Eqs. (5.54)-(5.55), the climbs over obstacles of chapter 6 and the like. The filters are propagated exactly from tick to
tick for the command in force. Commands by position wait for a leader (this one, or one that this one hears) to
pass a forward position; they come in a fixed order, and a fired one supersedes every command by time.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from ftcc.airside.references.longitudinal import Reference
from ftcc.link.compiled import compiled, copy

__all__ = [
    "CLAMPED",
    "FIRED",
    "FROM_GROUND",
    "PROFILE_PARAMETERS",
    "PROFILE_STATES",
    "TRIGGER_COLUMNS",
    "Command",
    "Cosine",
    "Profile",
    "SpeedWave",
    "Trigger",
    "armed",
    "climb_of_step",
    "climb_range",
    "command_from_ground",
    "largest_acceleration",
    "new_profile_state",
    "profile_arrays",
    "refer",
    "release_from_ground",
    "sampled",
    "stand",
    "trigger_rows",
]


@dataclass(frozen=True)
class Command:
    """From ``at`` on (s), go to this altitude (m) and speed (m/s)."""

    at: float
    altitude: float
    speed: float


@dataclass(frozen=True)
class Trigger:
    """Once leader ``uav`` has passed the forward position ``x`` (m), go to this altitude (m) and speed (m/s)."""

    uav: int
    x: float
    altitude: float
    speed: float


@dataclass(frozen=True)
class Cosine:
    """From ``at`` on (s): amplitude (cos(frequency (t - at)) - 1), m, added to the altitude."""

    at: float
    amplitude: float
    frequency: float


@dataclass(frozen=True)
class SpeedWave:
    """amplitude sin(frequency t), m/s, added to the speed from t = 0 on."""

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
    """Speed at the start, m/s."""
    commands: tuple[Command, ...] = ()
    """In order of time."""
    altitude_filter: tuple[float, float] = (0.05, 0.9)
    """Natural frequency (rad/s) and damping of the altitude filter."""
    speed_filter: tuple[float, float] = (0.05, 0.95)
    cosine: Cosine | None = None
    triggers: tuple[Trigger, ...] = ()
    """In the order in which they fire: each is armed by the one before it."""
    forward: bool = False
    """Speeds are forward speeds x' instead of airspeeds."""
    speed_wave: SpeedWave | None = None
    climb_limit: float = math.inf
    """Largest climb rate, m/s: what the followers can fly and estimate; the altitude filter waits at it."""
    sink_limit: float = math.inf
    """Largest sink rate, m/s."""


# Columns of the parameter vector of a profile.
_Z_PHI, _V_PHI = 0, 4
_Z_FREQUENCY, _Z_DAMPING, _V_FREQUENCY, _V_DAMPING = 8, 9, 10, 11
_COSINE_AT, _COSINE_AMPLITUDE, _COSINE_FREQUENCY = 12, 13, 14
_FORWARD, _WAVE_AMPLITUDE, _WAVE_FREQUENCY, _CLIMB_LIMIT, _SINK_LIMIT = 15, 16, 17, 18, 19
PROFILE_PARAMETERS = 20

# Columns of the state of a profile.
_X, _Z, _Z_RATE, _V, _V_RATE = range(5)
FIRED = 5
"""Column of the state: how many of the triggers have fired."""
CLAMPED = 6
"""Column of the state: 1 while the climb rate is held at the profile's limit."""
PROFILE_STATES = 7

FROM_GROUND = 4
"""The last rows of a profile's commands: what the ground has asked for, in order of time; it overrules all others."""

TRIGGER_COLUMNS = 4
"""In-edge of the watched leader (-1: this one itself), forward position, altitude, speed."""

_ROUNDING = 1e-6
"""A position counts as passed from this far before it, m: rounding must not decide which leader fires a tick later."""


def profile_arrays(profile: Profile, period: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The profile as the compiled functions want it: parameters (20,) and commands (n, 3) with rows (at, z, V).

    The last `FROM_GROUND` rows are free.
    """
    parameters = np.zeros(PROFILE_PARAMETERS)
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
    parameters[_FORWARD] = float(profile.forward)
    if profile.speed_wave is not None:
        parameters[_WAVE_AMPLITUDE] = profile.speed_wave.amplitude
        parameters[_WAVE_FREQUENCY] = profile.speed_wave.frequency
    parameters[_CLIMB_LIMIT], parameters[_SINK_LIMIT] = profile.climb_limit, profile.sink_limit
    rows = [(-math.inf, profile.z, profile.V)] + [(c.at, c.altitude, c.speed) for c in profile.commands]
    return parameters, np.array(rows + [(math.inf, math.inf, math.inf)] * FROM_GROUND)


def trigger_rows(profile: Profile, uav: int, senders: Sequence[int]) -> NDArray[np.float64]:
    """The commands by position of leader ``uav``, shape (n, 4), see `TRIGGER_COLUMNS`; ``senders``: whom it hears.

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
        row[:] = (-1 if trigger.uav == uav else senders.index(trigger.uav), trigger.x, trigger.altitude, trigger.speed)
    return rows


def new_profile_state(profile: Profile) -> NDArray[np.float64]:
    """State before the first tick: x, z, z_dot, V, V_dot, number of triggers fired, climb rate clamped."""
    return np.array([profile.x, profile.z, 0.0, profile.V, 0.0, 0.0, 0.0])


@compiled
def armed(triggers, state):
    """In-edge of the leader whose position the next trigger waits for; -1: the own position, -2: none is left."""
    n = int(state[FIRED])
    return int(triggers[n, 0]) if n < triggers.shape[0] and triggers[n, 1] < math.inf else -2


@compiled
def _command(commands, triggers, state, time):
    latest = 0
    for n in range(commands.shape[0]):
        if commands[n, 0] <= time:
            latest = n
    fired = int(state[FIRED])
    if fired > 0 and latest < commands.shape[0] - FROM_GROUND:
        return triggers[fired - 1, 2], triggers[fired - 1, 3]
    return commands[latest, 1], commands[latest, 2]


@compiled
def _filtered(phi, start, value, rate, target):
    offset = value - target
    return (
        target + phi[start] * offset + phi[start + 1] * rate,
        phi[start + 2] * offset + phi[start + 3] * rate,
    )


@compiled
def _cosine(parameters, time):
    since = time - parameters[_COSINE_AT]
    if not since >= 0.0:
        return 0.0, 0.0, 0.0
    amplitude, frequency = parameters[_COSINE_AMPLITUDE], parameters[_COSINE_FREQUENCY]
    return (
        amplitude * (math.cos(frequency * since) - 1.0),
        amplitude * frequency * math.sin(frequency * since),
        amplitude * frequency * frequency * math.cos(frequency * since),
    )


@compiled
def _climb_filtered(parameters, state, altitude, falling, period):
    """Advance the altitude filter; its rate less that of the cosine (``falling``) obeys the limits."""
    before = state[_Z]
    state[_Z], state[_Z_RATE] = _filtered(parameters, _Z_PHI, state[_Z], state[_Z_RATE], altitude)
    climb = state[_Z_RATE] - falling
    allowed = min(max(climb, -parameters[_SINK_LIMIT]), parameters[_CLIMB_LIMIT])
    state[CLAMPED] = 0.0
    if climb != allowed:
        state[_Z_RATE] = falling + allowed
        state[_Z] = before + state[_Z_RATE] * period
        state[CLAMPED] = 1.0


@compiled
def _forward(V: float, z_dot: float) -> float:
    return math.sqrt(max(V * V - z_dot * z_dot, 0.0))


@compiled
def refer(parameters, commands, triggers, state, reference, seen, now_us, period_us):
    """Advance a profile to the tick at ``now_us`` and write its `Reference`; to be called once at every tick.

    ``seen`` is the present forward position of the leader that `armed` names, nan if unknown; unused for the own one.
    """
    now = now_us / 1e6
    before = (now_us - period_us) / 1e6
    cosine, falling, cosine_ddot = _cosine(parameters, now)
    if now_us > 0:
        altitude, speed = _command(commands, triggers, state, before)
        _climb_filtered(parameters, state, altitude, falling, period_us / 1e6)
        state[_V], state[_V_RATE] = _filtered(parameters, _V_PHI, state[_V], state[_V_RATE], speed)
    z, z_dot = state[_Z], state[_Z_RATE]
    z += cosine
    z_dot -= falling
    V, V_dot = state[_V], state[_V_RATE]
    frequency = parameters[_WAVE_FREQUENCY]
    if frequency > 0.0:
        V += parameters[_WAVE_AMPLITUDE] * math.sin(frequency * now)
        V_dot += parameters[_WAVE_AMPLITUDE] * frequency * math.cos(frequency * now)
    x_dot = V if parameters[_FORWARD] > 0.0 else _forward(V, z_dot)
    if now_us > 0:
        state[_X] += 0.5 * (reference[6] + x_dot) * period_us / 1e6
    edge = armed(triggers, state)
    if edge == -1:
        seen = state[_X]
    if edge >= -1 and seen >= triggers[int(state[FIRED]), 1] - _ROUNDING:
        state[FIRED] += 1.0
    altitude, speed = _command(commands, triggers, state, now)
    w, damping = parameters[_Z_FREQUENCY], parameters[_Z_DAMPING]
    z_ddot = w * w * (altitude - state[_Z]) - 2.0 * damping * w * state[_Z_RATE]
    z_ddot -= cosine_ddot
    if parameters[_FORWARD] > 0.0:
        V = math.sqrt(x_dot * x_dot + z_dot * z_dot)
        V_dot = (x_dot * V_dot + z_dot * z_ddot) / V
    reference[0] = state[_X]
    reference[1], reference[2] = V, V_dot
    reference[3], reference[4], reference[5] = z, z_dot, z_ddot
    reference[6] = x_dot


@compiled
def stand(state, reference, period_us):
    """Hold: fly on level at the present altitude and speed; to be called instead of `refer`."""
    state[_X] += reference[6] * period_us / 1e6
    reference[0] = state[_X]
    reference[2], reference[4], reference[5] = 0.0, 0.0, 0.0
    reference[6] = reference[1]


def command_from_ground(
    commands: NDArray[np.float64],
    triggers: NDArray[np.float64],
    state: NDArray[np.float64],
    now: float,
    at: float,
    altitude: float | None,
    speed: float | None,
) -> bool:
    """From ``at`` on (s, not before ``now``) go to this altitude (m) and speed (m/s); None: that in force by then.

    Overrules the profile's own commands for good. Returns False where too many are waiting.
    """
    rows = commands[-FROM_GROUND:]
    own = [row.copy() for row in rows if row[0] < math.inf]
    in_force = [row for row in own if row[0] <= now][-1:]
    waiting = [row for row in own if now < row[0] < at]
    before = (in_force + waiting)[-1][1:] if in_force + waiting else _command(commands, triggers, state, at)
    new = np.array([at, before[0] if altitude is None else altitude, before[1] if speed is None else speed])
    kept = [*in_force, *waiting, new, *(row for row in own if row[0] > max(now, at))]
    if len(kept) > FROM_GROUND:
        return False
    rows[:] = math.inf
    rows[: len(kept)] = kept
    return True


def release_from_ground(commands: NDArray[np.float64]) -> None:
    """The profile's own commands are in force again."""
    commands[-FROM_GROUND:] = math.inf


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
    """The leaders' profiles over a flight, by id: arrays (n, 7) in the order of `Reference`; all hear each other.

    The arrays cannot be written: who asks again gets the same ones.
    """
    if not profiles:
        return {}
    return dict(zip(profiles, _sampled(tuple(profiles.items()), duration, period), strict=True))


@functools.lru_cache(maxsize=8)
def _sampled(profiles: tuple[tuple[int, Profile], ...], duration: float, period: float) -> NDArray[np.float64]:
    uavs = [uav for uav, _ in profiles]
    arrays = [profile_arrays(profile, period) for _, profile in profiles]
    waits = [trigger_rows(profile, uav, uavs) for uav, profile in profiles]
    commands = np.full(
        (
            len(uavs),
            max(
                (len(rows) for _, rows in arrays),
            ),
            3,
        ),
        math.inf,
    )
    triggers = np.full((len(uavs), max((1, *map(len, waits))), TRIGGER_COLUMNS), math.inf)
    for i, ((_, given), awaited) in enumerate(zip(arrays, waits, strict=True)):
        commands[i, : len(given)] = given
        triggers[i, : len(awaited)] = awaited
    parameters = np.array([row for row, _ in arrays])
    states = np.array([new_profile_state(profile) for _, profile in profiles])
    width = len(Reference._fields)
    rows = np.zeros((len(uavs), int(duration / period) + 1, width))
    seen = np.zeros(len(uavs))
    _sample(parameters, commands, triggers, states, np.zeros((len(uavs), width)), seen, round(period * 1e6), rows)
    rows.flags.writeable = False
    return rows


@compiled
def _sample(parameters, commands, triggers, states, row, seen, period_us, rows):
    """Fly all profiles tick by tick into ``rows`` (k, n, 7); ``row`` (k, 7) and ``seen`` (k,) are scratch."""
    period = period_us / 1e6
    for n in range(rows.shape[1]):
        # What each knows of the others: their last position, carried over one period.
        for i in range(rows.shape[0]):
            seen[i] = row[i, 0] + row[i, 6] * period
        for i in range(rows.shape[0]):
            edge = armed(triggers[i], states[i])
            position = seen[edge] if edge >= 0 and n > 0 else math.nan
            refer(parameters[i], commands[i], triggers[i], states[i], row[i], position, n * period_us, period_us)
            copy(row[i], rows[i, n])


def climb_range(profiles: Mapping[int, Profile], duration: float) -> dict[int, tuple[float, float]]:
    """Largest sink rate and largest climb rate of each leader's profile, m/s, on a grid of 0.1 s."""
    return {
        uav: (float(-row[:, 4].min()), float(row[:, 4].max())) for uav, row in sampled(profiles, duration, 0.1).items()
    }


def largest_acceleration(profiles: Mapping[int, Profile], duration: float) -> float:
    """Largest acceleration of the leaders along either axis, m/s^2, on a grid of 0.1 s."""
    found = [0.0]
    for row in sampled(profiles, duration, 0.1).values():
        found += [*np.abs(row[:, 5]).tolist(), *(np.abs(np.diff(row[:, 6])) / 0.1).tolist()]
    return float(max(found))
