"""The stage `diagnose` of a tick: what all actuators of a UAV have in common, and the trial of each."""

from __future__ import annotations

import math

from ftcc.airside.diagnosis.arrays import Memory, Trial
from ftcc.airside.diagnosis.beliefs import UNDETERMINED, Belief
from ftcc.airside.diagnosis.gains import DiagnosisGains
from ftcc.airside.diagnosis.health import set_health
from ftcc.airside.diagnosis.motion import Motion, aircraft_motion, kinematic_slips, point_motion
from ftcc.airside.diagnosis.trial import RECENTLY, bent_by_fault, try_actuator
from ftcc.airside.flight_path import Own
from ftcc.airside.model import Model
from ftcc.link.actuators import ACTUATORS, AILERON, ELEVATOR
from ftcc.link.compiled import compiled_apart, compiled_within, copy, fields, store
from ftcc.link.rotation import wrapped

__all__ = ["diagnose"]

_COMMAND = Own._fields.index("aileron")
"""Index of the first command in `Own`."""
_ACTUATORS = len(ACTUATORS)
_STATE = Belief._fields.index("state")
_POSITION, _RATE, _FILTERED = (Trial._fields.index(name) for name in ("position", "rate", "filtered"))
_DRIFT, _LIMIT, _SPREAD = (DiagnosisGains._fields.index(f"{word}_thrust") for word in ("drift", "limit", "spread"))
"""Indices of the first of each kind of threshold; their order is thrust, elevator, aileron, rudder, load, bank."""
_OF_SURFACES = (2, 1, 3, 0)
"""By slot: which of these belongs to an aircraft with surfaces,"""
_OF_POINT = (5, 4, 3, 0)
"""and to a point mass."""

_SLIP_BANDWIDTH = 4.0
"""Of the observers of the kinematics, rad/s."""
_OUTLIER = 8.5
"""A step beyond this many standard deviations of noise, and what full travel gives, is none of an aircraft."""
_FASTEST_BEND = 1.0
"""Unexplained turn of the flight path that no air makes, rad/s."""
_FASTEST_TURN = 2.0
"""Turn of the flight path that no aircraft makes, rad/s."""
_UPSET = 3.0
"""By how much more is put down to the model while another actuator fails: the aircraft leaves its flight regime."""
_SETTLING = 2.0
"""Time after the first tick without alarms, s."""


@compiled_apart
def diagnose(autopilots, i, now_us, dt):
    """Bring beliefs and health of UAV ``i`` to this tick; ``dt`` is the control period, s."""
    d = autopilots.diagnosis
    if d.on[i] == 0:
        return
    now = now_us / 1e6
    gains = fields(DiagnosisGains, d.gains[i])
    memory = fields(Memory, d.memory[i])
    row, before = autopilots.own[i], d.before[i]
    if math.isnan(memory.begun_at):
        _begin(d, i, row, now)
    else:
        _compare(autopilots, i, gains, memory, now, dt)
        d.recent_at[i] += 1
        set_health(autopilots, i, gains)
    copy(row, before)
    _show(autopilots, i)


@compiled_within
def _begin(d, i, row, now):
    store(Memory(now, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -math.inf), d.memory[i])
    for slot in range(_ACTUATORS):
        d.trial[i, slot, _POSITION] = row[_COMMAND + slot]
        d.trial[i, slot, _FILTERED] = row[_COMMAND + slot]


@compiled_within
def _positions(d, i, past, dt, mean):
    """Move the nominal actuators by a tick under the command in force; their mean positions go into ``mean`` (4,)."""
    for slot in range(_ACTUATORS):
        target = past[_COMMAND + slot]
        lag, damping = d.lag[i, slot], d.damping[i, slot]
        trial = d.trial[i, slot]
        position, rate = trial[_POSITION], trial[_RATE]
        if lag == 0.0 or (d.point[i] == 1 and slot == AILERON):
            middle, position, rate = target, target, 0.0
        elif damping > 0.0:
            rate += dt * (lag * lag * (target - position) - 2.0 * damping * lag * rate)
            middle = position + 0.5 * dt * rate
            position += dt * rate
        else:
            decay = math.exp(-lag * dt)
            middle = target + (position - target) * (1.0 - decay) / (lag * dt)
            position = target + (position - target) * decay
        mean[slot] = middle
        trial[_POSITION], trial[_RATE] = position, rate


@compiled_within
def _contradicts_itself(d, i, own, past, memory, gains, turn, dt, now):
    """Watch the navigation solution: whether this tick's step is worth nothing, and the observers of the kinematics.

    A solution that is held repeats itself to the last bit; one that fails jumps as no actuator makes an aircraft jump,
    or its parts contradict each other.

    Returns
    -------
    worthless : bool
    bank, alpha, beta, until : float
        See `Memory`.
    """
    held = own.q == past.q and own.theta == past.theta and own.p == past.p and own.r == past.r
    held = held or (own.V == past.V and own.gamma == past.gamma and own.chi == past.chi)
    jumped = abs(turn) > _OUTLIER * gains.sd_angle + _FASTEST_BEND * dt
    furthest = _OUTLIER * gains.sd_angle + _FASTEST_TURN * dt
    jumped = jumped or abs(own.gamma - past.gamma) > furthest
    jumped = jumped or abs(wrapped(own.chi - past.chi)) * math.cos(own.gamma) > furthest
    bank, alpha, beta = 0.0, 0.0, 0.0
    if d.point[i] == 0:
        kept = 1.0 - min(_SLIP_BANDWIDTH * dt, 1.0)
        slips = kinematic_slips(own, past, dt)
        bank = kept * memory.bank_slip + slips[0]
        alpha = kept * memory.alpha_slip + slips[1]
        beta = kept * memory.beta_slip + slips[2]
    for slot in range(_ACTUATORS):
        if d.has[i, slot] == 1:
            step = fields(Motion, d.motion[i, slot])
            jumped = jumped or abs(step.step) > _OUTLIER * step.noise + 2.0 * dt * d.travel[i, slot]
    slipped = _SLIP_BANDWIDTH * max(abs(bank), abs(alpha), abs(beta)) > gains.slip
    until = memory.excused_until
    if jumped or slipped:
        until = now + gains.lasting
    elif held:
        until = max(until, now + 0.2 * gains.lasting)
    return jumped or held, bank, alpha, beta, until


@compiled_apart
def _compare(autopilots, i, gains, memory, now, dt):
    """Compare what the aircraft did with what it should have done, actuator by actuator."""
    d = autopilots.diagnosis
    own, past = fields(Own, autopilots.own[i]), fields(Own, d.before[i])
    model = fields(Model, autopilots.model[i])
    positions = d.positions[i]
    _positions(d, i, d.before[i], dt, positions)
    if d.point[i] == 1:
        turn = point_motion(own, past, positions, model, gains, dt, d.lag[i, AILERON], d.motion[i])
    else:
        turn = aircraft_motion(own, past, positions, model, gains, dt, d.has[i, AILERON], d.motion[i])
    worthless, bank, alpha, beta, until = _contradicts_itself(d, i, own, past, memory, gains, turn, dt, now)
    elapsed = now - memory.begun_at
    # The flight path, that air and disturbances move.
    by_faults = 0.0
    for slot in range(_ACTUATORS):
        if d.has[i, slot] == 1:
            by_faults += bent_by_fault(d, i, slot)
    unexplained = 0.0 if worthless else turn - dt * (memory.path_base + by_faults)
    path = (1.0 - min(gains.bandwidth * dt, 1.0)) * memory.path + unexplained
    path_residual = gains.bandwidth * path
    base = memory.path_base
    mean = memory.path_mean + dt / RECENTLY * (path_residual - memory.path_mean)
    excused = now <= until or elapsed < _SETTLING
    for slot in range(_ACTUATORS):
        if d.has[i, slot] == 1:
            first = _OF_POINT[slot] if d.point[i] == 1 else _OF_SURFACES[slot]
            drift = d.gains[i, _DRIFT + first] * (_UPSET if _only_others_fail(d, i, slot) else 1.0)
            thresholds = (drift, d.gains[i, _LIMIT + first], d.gains[i, _SPREAD + first])
            moved = (unexplained, path_residual, path_residual - mean)
            bent = try_actuator(d, i, slot, gains, thresholds, moved, worthless, excused, now, elapsed, dt)
            if slot == ELEVATOR:
                base, mean, path = base + bent, mean - bent, path - bent / gains.bandwidth
    store(Memory(memory.begun_at, path, base, mean, bank, alpha, beta, until), d.memory[i])


@compiled_within
def _only_others_fail(d, i, slot):
    """Whether something is wrong with another actuator of UAV ``i``, and not with this one."""
    others = False
    for other in range(_ACTUATORS):
        if d.has[i, other] == 1 and d.belief[i, other, _STATE] >= UNDETERMINED:
            if other == slot:
                return False
            others = True
    return others


_SHOWN = 7
"""Entries of a `Belief` that are recorded: the first ones."""


@compiled_within
def _show(autopilots, i):
    """Write beliefs and health behind the scheme's signals, see `belief_signals`."""
    d = autopilots.diagnosis
    row = autopilots.signals[i]
    at = d.columns[0]
    for slot in range(_ACTUATORS):
        if d.has[i, slot] == 1:
            for n in range(_SHOWN):
                row[at + n] = d.belief[i, slot, n]
            at += _SHOWN
    copy(d.health[i], row[at:])
