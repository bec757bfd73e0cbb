"""A leader's motion along its profile, from tick to tick."""

from __future__ import annotations

import math

from ftcc.airside.references.longitudinal import Reference
from ftcc.airside.references.profiles.arrays import (
    ALTITUDE,
    CLAMPED,
    CLIMB,
    FIRED,
    FROM_GROUND,
    SPEED,
    SPEED_RATE,
    ProfileParameters,
    TriggerRow,
    X,
)
from ftcc.link.compiled import compiled, fields, store

__all__ = ["armed", "command_in_force", "refer", "stand"]

_X, _V, _V_DOT, _Z_DOT, _Z_DDOT, _X_DOT = (
    Reference._fields.index(name) for name in ("x", "V", "V_dot", "z_dot", "z_ddot", "x_dot")
)

_ROUNDING = 1e-6
"""A position counts as passed from this far before it, m: rounding must not decide which leader fires a tick later."""


@compiled
def armed(triggers, state):
    """In-edge of the leader whose position the next trigger waits for; -1: the own position, -2: none is left."""
    n = int(state[FIRED])
    if n >= triggers.shape[0]:
        return -2
    trigger = fields(TriggerRow, triggers[n])
    return int(trigger.edge) if trigger.x < math.inf else -2


@compiled
def command_in_force(commands, triggers, state, time):
    """Altitude (m) and speed (m/s) that the profile goes to at ``time`` (s)."""
    latest = 0
    for n in range(commands.shape[0]):
        if commands[n, 0] <= time:
            latest = n
    fired = int(state[FIRED])
    if fired > 0 and latest < commands.shape[0] - FROM_GROUND:
        trigger = fields(TriggerRow, triggers[fired - 1])
        return trigger.altitude, trigger.speed
    return commands[latest, 1], commands[latest, 2]


@compiled
def _filtered(phi, value, rate, target):
    a, b, c, d = phi
    offset = value - target
    return target + a * offset + b * rate, c * offset + d * rate


@compiled
def _cosine(profile, time):
    """Altitude, sink rate and sink acceleration of the cosine."""
    since = time - profile.cosine_at
    if not since >= 0.0:
        return 0.0, 0.0, 0.0
    amplitude, frequency = profile.cosine_amplitude, profile.cosine_frequency
    return (
        amplitude * (math.cos(frequency * since) - 1.0),
        amplitude * frequency * math.sin(frequency * since),
        amplitude * frequency * frequency * math.cos(frequency * since),
    )


@compiled
def _climb_filtered(profile, state, altitude, falling, period):
    """Advance the altitude filter; its rate less that of the cosine (``falling``) obeys the limits."""
    before = state[ALTITUDE]
    state[ALTITUDE], state[CLIMB] = _filtered(profile.altitude_phi, state[ALTITUDE], state[CLIMB], altitude)
    climb = state[CLIMB] - falling
    allowed = min(max(climb, -profile.sink_limit), profile.climb_limit)
    state[CLAMPED] = 0.0
    if climb != allowed:
        state[CLIMB] = falling + allowed
        state[ALTITUDE] = before + state[CLIMB] * period
        state[CLAMPED] = 1.0


@compiled
def _forward(V: float, z_dot: float) -> float:
    return math.sqrt(max(V * V - z_dot * z_dot, 0.0))


@compiled
def refer(parameters, commands, triggers, state, reference, watched, now_us, period_us):
    """Advance a profile to the tick at ``now_us`` and write its `Reference`; to be called once at every tick.

    ``watched`` is the present forward position of the leader that `armed` names, nan if unknown; not used for its own.
    """
    profile = fields(ProfileParameters, parameters)
    now = now_us / 1e6
    before = (now_us - period_us) / 1e6
    cosine, falling, cosine_ddot = _cosine(profile, now)
    if now_us > 0:
        altitude, speed = command_in_force(commands, triggers, state, before)
        _climb_filtered(profile, state, altitude, falling, period_us / 1e6)
        state[SPEED], state[SPEED_RATE] = _filtered(profile.speed_phi, state[SPEED], state[SPEED_RATE], speed)
    z, z_dot = state[ALTITUDE], state[CLIMB]
    z += cosine
    z_dot -= falling
    V, V_dot = state[SPEED], state[SPEED_RATE]
    frequency = profile.wave_frequency
    if frequency > 0.0:
        V += profile.wave_amplitude * math.sin(frequency * now)
        V_dot += profile.wave_amplitude * frequency * math.cos(frequency * now)
    x_dot = V if profile.forward > 0.0 else _forward(V, z_dot)
    if now_us > 0:
        state[X] += 0.5 * (reference[_X_DOT] + x_dot) * period_us / 1e6
    edge = armed(triggers, state)
    if edge == -1:
        watched = state[X]
    if edge >= -1 and watched >= fields(TriggerRow, triggers[int(state[FIRED])]).x - _ROUNDING:
        state[FIRED] += 1.0
    altitude, speed = command_in_force(commands, triggers, state, now)
    w, damping = profile.altitude_frequency, profile.altitude_damping
    z_ddot = w * w * (altitude - state[ALTITUDE]) - 2.0 * damping * w * state[CLIMB]
    z_ddot -= cosine_ddot
    if profile.forward > 0.0:
        V = math.sqrt(x_dot * x_dot + z_dot * z_dot)
        V_dot = (x_dot * V_dot + z_dot * z_ddot) / V
    store(Reference(x=state[X], V=V, V_dot=V_dot, z=z, z_dot=z_dot, z_ddot=z_ddot, x_dot=x_dot), reference)


@compiled
def stand(state, reference, period_us):
    """Hold: fly on level at the present altitude and speed; to be called instead of `refer`."""
    state[X] += reference[_X_DOT] * period_us / 1e6
    reference[_X] = state[X]
    reference[_V_DOT], reference[_Z_DOT], reference[_Z_DDOT] = 0.0, 0.0, 0.0
    reference[_X_DOT] = reference[_V]
