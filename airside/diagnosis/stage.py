"""The stage `diagnose` of a tick: motion, residuals, estimate, decision, health of one UAV."""

from __future__ import annotations

import math

from ftcc.airside.diagnosis.arrays import Memory, Trial
from ftcc.airside.diagnosis.beliefs import (
    FAULTY,
    HEALTHY,
    NO_KIND,
    SLOW,
    SUSPECTED,
    UNDETERMINED,
    Belief,
)
from ftcc.airside.diagnosis.decision import SLUGGISH, agreeing, forget, gather, kind_of, lags, sum_up
from ftcc.airside.diagnosis.estimator import RHO, B, C, Y, correct, predict, widen
from ftcc.airside.diagnosis.gains import DiagnosisGains
from ftcc.airside.diagnosis.health import set_health
from ftcc.airside.diagnosis.motion import Motion, aircraft_motion, kinematic_slips, point_motion
from ftcc.airside.flight_path import Own
from ftcc.airside.model import Model
from ftcc.link.actuators import ACTUATORS, AILERON
from ftcc.link.compiled import compiled, copy, fields, store

__all__ = ["diagnose"]

_COMMAND = Own._fields.index("aileron")
"""Index of the first command in `Own`."""
_ACTUATORS = len(ACTUATORS)
_POSITION, _RATE, _SLOW_POSITION = (Trial._fields.index(name) for name in ("position", "rate", "slow_position"))
_EXCUSED = Memory._fields.index("excused_until")
_DRIFT, _LIMIT, _SPREAD = (DiagnosisGains._fields.index(f"{word}_thrust") for word in ("drift", "limit", "spread"))
"""Indices of the first of each kind of threshold; their order is thrust, elevator, aileron, rudder, load, bank."""
_OF_SURFACES = (2, 1, 3, 0)
"""By slot: which of these belongs to an aircraft with surfaces,"""
_OF_POINT = (5, 4, 3, 0)
"""and to a point mass."""

_SLIP_BANDWIDTH = 10.0
"""Of the observers of the kinematics, rad/s."""
_OUTLIER = 8.5
"""A step beyond this many standard deviations of noise, and what full travel gives, is none of an aircraft."""
_FASTEST_TURN = 1.0
"""Unexplained turn of the flight path that no air makes, rad/s."""
_SETTLING = 2.0
"""Time after the first tick without alarms, s."""
_LEARNS_AT_LEAST = 0.3
"""Shortest time constant of what the observers learn to expect, s."""
_APART = 0.3
"""Time after which a disturbance of the flight path is learned, s."""
_STEADY = 0.15
"""Time for which data must speak for the same kind, s."""
_WATCHED = 1.0
"""Time after an alarm from which on an actuator may count as slow, s."""
_DRIFTS = 5.0
"""Time constant with which a known fault may change, s."""


@compiled
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
        set_health(autopilots, i, gains)
    copy(row, before)
    _show(autopilots, i)


@compiled
def _begin(d, i, row, now):
    store(Memory(now, 0.0, 0.0, 0.0, -math.inf), d.memory[i])
    for slot in range(_ACTUATORS):
        d.trial[i, slot, _POSITION] = row[_COMMAND + slot]
        d.trial[i, slot, _SLOW_POSITION] = row[_COMMAND + slot]


@compiled
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
        trial[_SLOW_POSITION] += dt / SLUGGISH * (position - trial[_SLOW_POSITION])


@compiled
def _contradicts_itself(d, i, own, past, memory, gains, turn, dt, now):
    """Watch the navigation solution; whether this tick's step is worth nothing.

    A solution that is held repeats itself to the last bit; one that fails jumps as no actuator makes an aircraft jump,
    or its parts contradict each other.
    """
    held = own.q == past.q and own.theta == past.theta and own.p == past.p and own.r == past.r
    held = held or (own.V == past.V and own.gamma == past.gamma and own.chi == past.chi)
    jumped = abs(turn) > _OUTLIER * gains.sd_angle + _FASTEST_TURN * dt
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
    store(Memory(memory.begun_at, bank, alpha, beta, until), d.memory[i])
    return jumped or held


@compiled
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
    worthless = _contradicts_itself(d, i, own, past, memory, gains, turn, dt, now)
    excused = now <= d.memory[i, _EXCUSED] or now < memory.begun_at + _SETTLING
    for slot in range(_ACTUATORS):
        if d.has[i, slot] == 1:
            first = _OF_POINT[slot] if d.point[i] == 1 else _OF_SURFACES[slot]
            thresholds = (d.gains[i, _DRIFT + first], d.gains[i, _LIMIT + first], d.gains[i, _SPREAD + first])
            _try(d, i, slot, gains, thresholds, turn, worthless, excused, now, now - memory.begun_at, dt)


@compiled
def _try(d, i, slot, gains, thresholds, turn, worthless, excused, now, elapsed, dt):
    """One actuator: residuals, estimate, decision."""
    drift, limit, spread = thresholds
    trial, motion = fields(Trial, d.trial[i, slot]), fields(Motion, d.motion[i, slot])
    belief = fields(Belief, d.belief[i, slot])
    position, travel = d.positions[i, slot], d.travel[i, slot]
    x, P, sums = trial.x, trial.P, trial.sums
    alarmed = belief.state >= UNDETERMINED

    # Residuals of what is believed.
    by_itself = motion.drift + x[C] * motion.regressor + x[RHO] * position
    step, calm_step = motion.step, motion.step - motion.air * turn
    expected = by_itself + trial.direct_base + x[B] - trial.kept_bias
    if worthless:
        step, calm_step = dt * expected, dt * (by_itself + x[B])
    kept = 1.0 - min(gains.bandwidth * dt, 1.0)
    direct = kept * trial.direct + step - dt * expected
    calm = kept * trial.calm + calm_step - dt * (by_itself + x[B])
    residual, calm_residual = gains.bandwidth * direct, gains.bandwidth * calm

    # Estimate.
    predict(x, P, dt, calm_step, motion.drift, motion.regressor, position, spread)
    noise = math.sqrt(motion.noise * motion.noise + motion.air * gains.sd_angle * motion.air * gains.sd_angle)
    if worthless:
        widen(P, Y, 2.0 * noise)
    correct(x, P, noise, alarmed)
    if alarmed:
        widen(P, RHO, 0.05 * math.sqrt(dt / _DRIFTS))
        widen(P, B, drift * math.sqrt(dt / _DRIFTS))
    else:
        widen(P, B, drift * math.sqrt(dt / gains.memory))
    base, kept_effectiveness, kept_bias = trial.direct_base, trial.kept_effectiveness, trial.kept_bias
    if not alarmed:
        kept_effectiveness, kept_bias = x[RHO], x[B]
        base += dt / min(gains.memory, elapsed + _LEARNS_AT_LEAST) * residual

    # Test.
    tested = agreeing(residual, calm_residual)
    up = sum_up(trial.up, tested, drift, travel, dt)
    down = sum_up(trial.down, -tested, drift, travel, dt)
    if excused:
        up, down = 0.0, 0.0
    evidence = max(up, down) / limit
    quiet_at = now if evidence == 0.0 else trial.quiet_at
    apart = trial.apart + dt if abs(calm_residual) > drift and abs(tested) < 0.5 * drift else 0.0
    if apart > _APART and not alarmed:
        widen(P, B, calm_residual)
        apart = 0.0

    # Decide.
    state, kind = belief.state, belief.kind
    suspected_at, detected_at, isolated_at = belief.suspected_at, belief.detected_at, belief.isolated_at
    candidate, candidate_since = trial.candidate, trial.candidate_since
    loss, bias = x[RHO] - kept_effectiveness, x[B] - kept_bias
    if evidence >= 1.0:
        if not alarmed:
            detected_at, suspected_at = now, quiet_at
        state, kind, isolated_at = UNDETERMINED, NO_KIND, math.nan
        candidate, candidate_since = NO_KIND, now
        up, down, quiet_at = 0.0, 0.0, now
        widen(P, RHO, gains.sd_effectiveness)
        widen(P, B, 0.5 * travel)
        forget(sums)
    elif not alarmed:
        state = SUSPECTED if evidence > 0.5 else HEALTHY
    else:
        gather(sums, calm_residual + loss * position + bias, position, position - trial.slow_position, dt)
        found = kind_of(loss, bias, P[RHO, RHO], P[B, B], x[RHO], 0.5 * drift)
        if now - detected_at > _WATCHED and lags(sums, 0.2 * drift):
            found = SLOW
        if found != candidate:
            candidate, candidate_since = found, now
        elif found != NO_KIND and now - candidate_since >= _STEADY:
            state, kind = FAULTY, found
            isolated_at = now if math.isnan(isolated_at) else isolated_at
        nothing = found == NO_KIND and abs(loss * position + bias) < 0.5 * drift and abs(loss) < 0.1
        if nothing and now - max(detected_at, candidate_since) > gains.patience:
            state, kind = HEALTHY, NO_KIND
            detected_at, suspected_at, isolated_at = math.nan, math.nan, math.nan
            _forget_effectiveness(x, P, gains)
    store(
        Belief(
            state=state,
            kind=kind,
            effectiveness=x[RHO],
            effectiveness_sd=math.sqrt(max(P[RHO, RHO], 0.0)),
            bias=bias,
            bias_sd=math.sqrt(max(P[B, B], 0.0)),
            evidence=evidence,
            suspected_at=suspected_at,
            detected_at=detected_at,
            isolated_at=isolated_at,
        ),
        d.belief[i, slot],
    )
    store(
        Trial(
            position=trial.position,
            rate=trial.rate,
            direct=direct,
            calm=calm,
            direct_base=base,
            up=up,
            down=down,
            quiet_at=quiet_at,
            apart=apart,
            kept_effectiveness=kept_effectiveness,
            kept_bias=kept_bias,
            candidate=candidate,
            candidate_since=candidate_since,
            slow_position=trial.slow_position,
            sums=sums,
            x=x,
            P=P,
        ),
        d.trial[i, slot],
    )


@compiled
def _forget_effectiveness(x, P, gains):
    """Take the effectiveness for that of a healthy actuator again."""
    x[RHO] = 1.0
    for n in range(P.shape[0]):
        P[RHO, n], P[n, RHO] = 0.0, 0.0
    P[RHO, RHO] = gains.sd_coefficient * gains.sd_coefficient


_SHOWN = 7
"""Entries of a `Belief` that are recorded: the first ones."""


@compiled
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
