"""The trial of one actuator at a tick: residuals of what is believed, estimate, test, decision."""

from __future__ import annotations

import math

from ftcc.airside.diagnosis.arrays import RECENT, Seen, Trial
from ftcc.airside.diagnosis.beliefs import FAULTY, HEALTHY, NO_KIND, SUSPECTED, UNDETERMINED, Belief
from ftcc.airside.diagnosis.decision import agreeing, follow, gather, kind_of, sum_up
from ftcc.airside.diagnosis.estimator import RHO, B, C, Y, correct, given_kind, predict, surprises_of, widen
from ftcc.airside.diagnosis.motion import Motion
from ftcc.link.actuators import THRUST
from ftcc.link.compiled import compiled, compiled_apart, fields, fill, store

__all__ = ["RECENTLY", "bent_by_fault", "try_actuator"]

_LEARNS_AT_LEAST = 0.3
"""Shortest time constant of what the observers learn to expect, s."""
_APART = 0.2
"""Time constant of the mean that shows a disturbance of the flight path, s."""
_GUSTY = 2.0
"""How many standard deviations the air may move an aircraft."""
_FAR_APART = 1.2
"""Size of one that is learned at once, in drifts."""
_BENDS = 3.0
"""Time constant with which others are learned, s."""
_AT_MOST = 6.0
"""Drifts that a residual counts at most, so that a jump of a sensor alone raises no alarm."""
_UNSURE = 1.0
"""How many standard deviations a coefficient may be off without an alarm."""
RECENTLY = 1.5
"""Time constant of recent means, s."""
_CLEAR = 4.0
"""Beyond this many of its mean size a residual is not learned from."""
_PRIOR = 0.3
"""Weight of the nominal share of the air, in drifts."""
_LEAST_SHARE, _MOST_SHARE = 0.4, 1.8
_LEAST_KEPT = 0.3
"""Guard of the effectiveness of a healthy actuator."""
_LEAST_ALONE = 0.3
"""Guard of the share of an actuator's motion that the flight path does not follow."""
_STEADY = 0.15
"""Time for which data must speak for the same kind, s."""
_SURE = 0.2
"""What is left of an additive effect that a kind of fault has not, in drifts."""
_ROUGHLY = 0.08
"""Error of the model, as a share of the position;"""
_DRAG = 0.25
"""of the thrust, which is known as well as the drag at speeds that were not flown."""
_UNMODELLED = 0.02
"""Standard deviation of what errors of the coefficients leave in an effectiveness."""
_LOOKS_BACK = 1.0
"""Longest time from the presumed onset to the alarm, s."""
_DRIFTS = 5.0
"""Time constant with which a known fault may change, s."""


@compiled
def bent_by_fault(d, i, slot):
    """How fast what is believed of a fault of this actuator turns the flight path, rad/s."""
    belief = fields(Belief, d.belief[i, slot])
    if belief.state < UNDETERMINED:
        return 0.0
    trial, motion = fields(Trial, d.trial[i, slot]), fields(Motion, d.motion[i, slot])
    loss, bias = trial.x[RHO] - trial.kept_effectiveness, trial.x[B] - trial.kept_bias
    return motion.lift * (loss * d.positions[i, slot] + bias)


@compiled
def _share_of_air(trial, residual, path_residual, noise, drift, memory, learns, dt):
    """How much of what the flight path says of the air is in the motion, how strong that is, and the sums of both.

    An adaptive noise canceller of one weight (Widrow and others, Proc. IEEE 63, 1975), by recursive least squares from
    the nominal 1 on: the nominal coefficients of moment and lift need not fit each other. ``noise`` is the standard
    deviation of ``path_residual`` in still air.
    """
    square, product = trial.air_square, trial.air_product
    if learns and abs(path_residual) < _CLEAR * math.sqrt(square + drift * drift):
        square += dt / memory * (path_residual * path_residual - square)
        product += dt / memory * (path_residual * residual - product)
    prior = (_PRIOR * drift) * (_PRIOR * drift)
    share = (product + prior) / (max(square - noise * noise, 0.0) + prior)
    return min(max(share, _LEAST_SHARE), _MOST_SHARE), math.sqrt(max(square - noise * noise, 0.0)), square, product


@compiled_apart
def try_actuator(d, i, slot, gains, thresholds, moved, worthless, excused, now, elapsed, dt):
    """One actuator: residuals, estimate, decision; the turn of the path that neither air nor actuator made, rad/s.

    ``moved`` is what of the flight path's motion is unexplained in this tick, rad, its residual, and that less its
    recent mean, rad/s.
    """
    drift, limit, spread = thresholds
    trial, motion = fields(Trial, d.trial[i, slot]), fields(Motion, d.motion[i, slot])
    belief = fields(Belief, d.belief[i, slot])
    position, travel = d.positions[i, slot], d.travel[i, slot]
    x, P, sums = trial.x, trial.P, trial.sums
    alarmed = belief.state >= UNDETERMINED

    # Residuals of what is believed.
    expected = motion.drift + x[C] * motion.regressor + x[RHO] * position + trial.direct_base + x[B] - trial.kept_bias
    kept = 1.0 - min(gains.bandwidth * dt, 1.0)
    direct = kept * trial.direct + (0.0 if worthless else motion.step - dt * expected)
    residual = gains.bandwidth * direct
    direct_mean = trial.direct_mean + dt / RECENTLY * (residual - trial.direct_mean)
    noisy = motion.air * gains.sd_angle
    share, gusts, square, product = _share_of_air(
        trial, residual - direct_mean, motion.air * moved[2],
        noisy * gains.bandwidth * math.sqrt(0.5 * gains.bandwidth * dt),
        drift, gains.memory, not alarmed and not excused, dt,
    )  # fmt: skip
    alone = 1.0 / max(1.0 - share * motion.air * motion.lift, _LEAST_ALONE)
    calm_residual = alone * (residual - share * motion.air * moved[1])

    filtered = trial.filtered + min(gains.bandwidth * dt, 1.0) * (position - trial.filtered)

    # Estimate.
    calm_step = modelled = dt * (motion.drift + x[C] * motion.regressor + x[RHO] * position + x[B])
    if not worthless:
        by_air = share * motion.air * moved[0]
        calm_step = modelled + alone * (motion.step - by_air - modelled)
    seen = Seen(calm_step, motion.drift, motion.regressor, position)
    store(seen, d.recent[i, slot, d.recent_at[i] % RECENT])
    predict(x, P, dt, calm_step, motion.drift, motion.regressor, position, spread)
    noise = alone * math.sqrt(motion.noise * motion.noise + share * noisy * share * noisy)
    if worthless:
        widen(P, Y, 2.0 * noise)
    correct(x, P, noise, alarmed or slot != THRUST)
    if alarmed:
        widen(P, RHO, 0.02 * math.sqrt(dt / _DRIFTS))
        widen(P, B, 0.5 * drift * math.sqrt(dt / _DRIFTS))
    else:
        widen(P, B, drift * math.sqrt(dt / gains.memory))
    base, kept_effectiveness, kept_bias = trial.direct_base, trial.kept_effectiveness, trial.kept_bias
    kept_sd = trial.kept_sd
    learning = dt / min(gains.memory, elapsed + _LEARNS_AT_LEAST)
    regressor_mean = trial.regressor_mean + learning * (motion.regressor - trial.regressor_mean)
    if not alarmed:
        base += learning * residual

    # Test. What a wrong coefficient may do is not tested.
    tolerated = drift + _UNSURE * gains.sd_coefficient * abs(motion.regressor - regressor_mean)
    tested = agreeing(calm_residual, residual, _GUSTY * gusts)
    most = min(travel, _AT_MOST * tolerated)
    up = sum_up(trial.up, tested, tolerated, most, dt)
    down = sum_up(trial.down, -tested, tolerated, most, dt)
    if excused:
        up, down = 0.0, 0.0
    evidence = max(up, down) / limit
    quiet_at = now if evidence == 0.0 else trial.quiet_at
    if not alarmed and evidence == 0.0:
        kept_effectiveness, kept_bias = x[RHO], x[B]
        kept_sd = math.sqrt(max(P[RHO, RHO], 0.0))
    # What only the flight path says is a disturbance of it: it is learned, at once where it is large.
    apart = trial.apart + dt / _APART * (calm_residual - tested - trial.apart)
    bent = 0.0
    if motion.air != 0.0 and not worthless:
        if abs(apart) > _FAR_APART * drift:
            bent, apart = -apart / (share * motion.air), 0.0
        else:
            bent = -dt / min(_BENDS, elapsed + _LEARNS_AT_LEAST) * (calm_residual - tested) / (share * motion.air)

    # Decide.
    state, kind = belief.state, belief.kind
    suspected_at, detected_at, isolated_at = belief.suspected_at, belief.detected_at, belief.isolated_at
    candidate, candidate_since, whole = trial.candidate, trial.candidate_since, trial.whole
    loss, bias = x[RHO] - kept_effectiveness, x[B] - kept_bias
    if evidence >= 1.0:
        if not alarmed:
            detected_at, suspected_at = now, max(quiet_at, now - _LOOKS_BACK)
        quiet_before = quiet_at
        state, kind, isolated_at = UNDETERMINED, NO_KIND, math.nan
        candidate, candidate_since = NO_KIND, now
        up, down, quiet_at = 0.0, 0.0, now
        if not alarmed:
            x[RHO], x[B] = kept_effectiveness, kept_bias
        since = now - max(quiet_before, detected_at - _LOOKS_BACK)
        _begin_anew(d, i, slot, gains, x, P, 0.5 * travel, spread, noise, since, dt)
        whole, filtered = _look_back(d, i, slot, trial, travel, gains, (kept_effectiveness, kept_bias), since, dt)
    elif not alarmed:
        state = SUSPECTED if evidence > 0.5 else HEALTHY
    else:
        healthy = motion.drift + kept_effectiveness * position + kept_bias
        whole = kept * whole + calm_step - dt * healthy
        unexplained, bandwidth = gains.bandwidth * whole, gains.bandwidth
        gather(sums, unexplained, filtered, dt)
        follow(trial.slow, trial.lagging, trial.off, trial.square, unexplained, position, travel, bandwidth, dt)
        roughly = _DRAG if slot == THRUST else _ROUGHLY
        rough = (math.hypot(kept_sd, roughly), math.hypot(_SURE * drift, roughly * position))
        surprises = surprises_of(x, P, kept_effectiveness, kept_bias, rough)
        share_left = x[RHO] / max(kept_effectiveness, _LEAST_KEPT)
        found = kind_of(sums, trial.off, trial.square, 0.3 * drift, surprises, share_left, bias, dt)
        if found != candidate:
            candidate, candidate_since = found, now
        elif found != NO_KIND and now - candidate_since >= _STEADY:
            state, kind = FAULTY, found
            isolated_at = now if math.isnan(isolated_at) else isolated_at
        nothing = found == NO_KIND and abs(loss * position + bias) < 0.5 * drift and abs(loss) < 0.1
        if nothing and now - max(detected_at, candidate_since) > gains.timeout:
            state, kind = HEALTHY, NO_KIND
            detected_at, suspected_at, isolated_at = math.nan, math.nan, math.nan
            _forget_effectiveness(x, P, gains)
    # Of the healthy actuator's effectiveness, which is not known better than the nominal coefficients are.
    if state >= UNDETERMINED:
        rho, rho_sd, bias, bias_sd = given_kind(x, P, kind, kept_effectiveness, kept_bias, _SURE * drift)
        effectiveness = rho / max(kept_effectiveness, _LEAST_KEPT)
        ratio_sd = math.hypot(rho_sd, effectiveness * kept_sd)
        deviation = math.hypot(ratio_sd, _UNMODELLED)
    else:
        effectiveness, deviation = 1.0, gains.sd_coefficient
        bias_sd = math.sqrt(max(P[B, B], 0.0))
    store(
        Belief(
            state=state,
            kind=kind,
            effectiveness=effectiveness,
            effectiveness_sd=deviation,
            bias=bias,
            bias_sd=bias_sd,
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
            direct_base=base,
            direct_mean=direct_mean,
            air_square=square,
            air_product=product,
            regressor_mean=regressor_mean,
            up=up,
            down=down,
            quiet_at=quiet_at,
            apart=apart,
            kept_effectiveness=kept_effectiveness,
            kept_sd=kept_sd,
            kept_bias=kept_bias,
            candidate=candidate,
            candidate_since=candidate_since,
            whole=whole,
            filtered=filtered,
            sums=sums,
            slow=trial.slow,
            lagging=trial.lagging,
            off=trial.off,
            square=trial.square,
            x=x,
            P=P,
        ),
        d.trial[i, slot],
    )
    return bent


@compiled_apart
def _begin_anew(d, i, slot, gains, x, P, spread_bias, spread, noise, since, dt):
    """Estimate the fault from its presumed onset, ``since`` s ago, on: with wide spreads of what it may be."""
    last = d.recent_at[i]
    ticks = min(int(since / dt) + 1, RECENT, last)
    x[Y] = 0.0
    for n in range(P.shape[0]):
        P[Y, n], P[n, Y] = 0.0, 0.0
    P[Y, Y] = 2.0 * noise * noise
    widen(P, RHO, gains.sd_effectiveness)
    widen(P, B, spread_bias)
    for n in range(last - ticks + 1, last + 1):
        seen = fields(Seen, d.recent[i, slot, n % RECENT])
        predict(x, P, dt, seen.step, seen.drift, seen.regressor, seen.position, spread)
        correct(x, P, noise, True)


@compiled_apart
def _look_back(d, i, slot, trial, travel, gains, kept, since, dt):
    """Fill the sums that isolate a fault from its presumed onset, ``since`` s ago, on.

    ``kept`` are effectiveness and additive effect of the healthy actuator. Returns the states of the two filters.
    """
    effectiveness, bias = kept
    last = d.recent_at[i]
    ticks = min(int(since / dt) + 1, RECENT, last)
    first = last - ticks + 1
    whole, filtered = 0.0, fields(Seen, d.recent[i, slot, first % RECENT]).position
    fill(trial.sums, 0.0)
    fill(trial.off, 0.0)
    fill(trial.square, 0.0)
    fill(trial.lagging, 0.0)
    fill(trial.slow, filtered)
    for n in range(first, last + 1):
        seen = fields(Seen, d.recent[i, slot, n % RECENT])
        healthy = seen.drift + effectiveness * seen.position + bias
        whole = (1.0 - min(gains.bandwidth * dt, 1.0)) * whole + seen.step - dt * healthy
        filtered += min(gains.bandwidth * dt, 1.0) * (seen.position - filtered)
        residual = gains.bandwidth * whole
        gather(trial.sums, residual, filtered, dt)
        follow(trial.slow, trial.lagging, trial.off, trial.square, residual, seen.position, travel, gains.bandwidth, dt)
    return whole, filtered


@compiled
def _forget_effectiveness(x, P, gains):
    """Take the effectiveness for that of a healthy actuator again."""
    x[RHO] = 1.0
    for n in range(P.shape[0]):
        P[RHO, n], P[n, RHO] = 0.0, 0.0
    P[RHO, RHO] = gains.sd_coefficient * gains.sd_coefficient
