"""The stage `defend`, between `hear` and the law: the gate, then trust, then what the F most extreme may not say.

In this order, so that a neighbour that one of them has silenced is not counted by the next.
"""

from __future__ import annotations

import math

from ftcc.airside.defence.arrays import CARRIED, GIVEN, LAST, LEADS, TRUST, TRUSTED, VALUE, Column, Edge
from ftcc.airside.defence.credibility import ANGLE, judge_record, say_of
from ftcc.airside.defence.events import BANNED, EXTREME, SURPRISING, note_standing
from ftcc.airside.defence.gains import DefenceGains
from ftcc.airside.defence.resilient import bounds, is_extreme, ranked
from ftcc.link.compiled import compiled_apart, compiled_within, copy, fields
from ftcc.link.rotation import wrapped

__all__ = ["defend"]

_UNIT, _RATE, _RATE_OF = (Column._fields.index(name) for name in ("unit", "rate", "rate_of"))
_STAMP, _BANNED, _STANDING = (Edge._fields.index(name) for name in ("stamp", "banned_until", "standing"))
_FOLLOWER = 0


@compiled_within
def _measure(d, i, n, m, values, age, valid, shared, horizon, now):
    """Set ``scratch``: how far each neighbour's value in column ``m`` is off the own one, and whether it takes part.

    Both are carried to the present by their rates where the law does so; rates are compared as they were told. Who has
    no say takes no part. Who shares nothing of the kind is at nan: a leader's speed stands in no follower's record.
    """
    own_column = d.columns[_FOLLOWER, m]
    distances, counts = d.scratch[0], d.scratch[1]
    is_value = own_column[_RATE_OF] == VALUE
    own = shared[m]
    if is_value and own_column[_RATE] >= 0 and d.switches[CARRIED] == 1:
        own += shared[own_column[_RATE]] * (now - d.shared_at[i])
    for j in range(n):
        column = d.columns[d.known[i, j, LEADS], m]
        counts[j], distances[j] = 0.0, math.nan
        if valid[j] == 0.0 or column[_RATE_OF] != own_column[_RATE_OF]:
            continue
        value = values[j, m]
        if is_value and column[_RATE] >= 0:
            value += values[j, column[_RATE]] * _carried_for(d, age[j], horizon)
        counts[j], distances[j] = 1.0 if d.heard[TRUST, i, j, m] > 0.0 else 0.0, value - own
        if own_column[_UNIT] == ANGLE:
            distances[j] = wrapped(distances[j])


@compiled_within
def _carried_for(d, age, horizon):
    """Time over which a record of this age is carried to the present, s."""
    return min(age, horizon) if d.switches[CARRIED] == 1 else 0.0


@compiled_within
def _judge(d, i, n, values, age, valid, stamp, shared, gains, now):
    """Look at the records that are new, and set what they leave each neighbour of its say."""
    knows_itself = d.shared_at[i] == d.shared_at[i]
    news = False
    for j in range(n):
        _set_say(d, i, j, age[j], valid[j], gains, now)
        news = news or _is_new(d, i, j, stamp[j])
        for m in range(values.shape[1]):
            d.off_crowd[j, m] = 0.0
    if not news:
        return
    if knows_itself and gains.crowd + gains.crowd_speed + gains.crowd_angle > 0.0:
        for m in range(values.shape[1]):
            if d.columns[_FOLLOWER, m, _RATE_OF] == VALUE:
                _measure(d, i, n, m, values, age, valid, shared, gains.horizon, now)
                _set_off_crowd(d, n, m)
    for j in range(n):
        if _is_new(d, i, j, stamp[j]):
            columns, at = d.columns[d.known[i, j, LEADS]], stamp[j] / 1e6
            judge_record(d.gains[i], columns, d.edges[i, j], d.heard[LAST, i, j], values[j], at, d.off_crowd[j], now)
            _set_say(d, i, j, age[j], valid[j], gains, now)


@compiled_within
def _is_new(d, i, j, stamp):
    """Whether the record with this stamp, us, has not been looked at yet; before the first the stamp is negative."""
    return stamp >= 0 and stamp / 1e6 != d.edges[i, j, _STAMP]


@compiled_within
def _set_say(d, i, j, age, valid, gains, now):
    """Set what ban, credit and age leave neighbour ``j`` of its say; who has not been heard yet is not doubted."""
    say = 1.0
    if d.known[i, j, TRUSTED] == 0 and valid > 0.0:
        say = say_of(d.edges[i, j], now)
        if gains.oldest > 0.0 and age > gains.oldest:
            say = 0.0
    for m in range(d.off_crowd.shape[1]):
        d.heard[TRUST, i, j, m] = say


@compiled_within
def _set_off_crowd(d, n, m):
    """Set how far each value in ``scratch`` is off the median of all, the own one among them."""
    distances, counts = d.scratch[0], d.scratch[1]
    distances[n], counts[n] = 0.0, 1.0
    count = 1
    for j in range(n):
        count += 1 if counts[j] > 0.0 else 0
    middle = 0.5 * (ranked(distances, counts, n + 1, (count - 1) // 2) + ranked(distances, counts, n + 1, count // 2))
    for j in range(n):
        d.off_crowd[j, m] = distances[j] - middle if distances[j] == distances[j] else 0.0


@compiled_within
def _clip(d, i, n, m, values, age, gains):
    """Move the values in column ``m``, which ``scratch`` holds, into the hull of what the majority tells.

    A value whose rate has been moved before is corrected by what the law will carry it on less, or more.
    """
    distances, counts = d.scratch[0], d.scratch[1]
    low, high = bounds(distances, counts, d.known[i], n, gains.hull)
    for j in range(n):
        if counts[j] > 0.0 and d.known[i, j, TRUSTED] == 0:
            d.heard[GIVEN, i, j, m] += min(max(distances[j], low), high) - distances[j]
            rate, column = d.columns[d.known[i, j, LEADS], m, _RATE], d.columns[d.known[i, j, LEADS], m]
            if rate >= 0 and column[_RATE_OF] == VALUE:
                moved = d.heard[GIVEN, i, j, rate] - values[j, rate]
                d.heard[GIVEN, i, j, m] -= moved * _carried_for(d, age[j], gains.horizon)


@compiled_within
def _reduce(d, i, n, m, gains):
    """Leave out the F most extreme values of column ``m``, which ``scratch`` holds, and their rates."""
    distances, counts = d.scratch[0], d.scratch[1]
    for j in range(n):
        if d.known[i, j, TRUSTED] == 1:
            counts[j] = 0.0
    for j in range(n):
        if counts[j] > 0.0 and is_extreme(distances, counts, n, j, gains.F):
            at = m
            while at >= 0:
                d.heard[TRUST, i, j, at] = 0.0
                at = d.columns[d.known[i, j, LEADS], at, _RATE]


@compiled_within
def _note_standings(d, i, n, valid, gains, events, now, dt):
    """Bring the standing of the neighbours to this tick, and note who begins or ceases to be distrusted."""
    share = min(dt / gains.memory, 1.0)
    for j in range(n):
        if valid[j] == 0.0:
            continue
        edge, left = d.edges[i, j], 1.0
        columns = d.columns[d.known[i, j, LEADS]]
        for m in range(columns.shape[0]):
            if columns[m, _RATE_OF] == VALUE:
                left = min(left, d.heard[TRUST, i, j, m])
        edge[_STANDING] += (left - edge[_STANDING]) * share
        reason = EXTREME
        if now < edge[_BANNED]:
            reason = BANNED
        elif say_of(edge, now) < 0.5:
            reason = SURPRISING
        note_standing(events, edge, i, j, reason, math.floor(now * 1e6 + 0.5))


@compiled_apart
def defend(d, i, n, values, age, valid, stamp, shared, events, now, dt):
    """Set what the law of UAV ``i`` is given of what it has heard from ``n`` in-neighbours, and its trust in that.

    Both stand in ``d.heard`` then, see `Defence`.

    Parameters
    ----------
    d : `Defence`.
    values, age, valid, stamp : of its in-edges, as in the inbox.
    shared : what it shares itself, as of ``d.shared_at``; it is its own value.
    events : the autopilots' events.
    now, dt : present time and control period, s.
    """
    gains = fields(DefenceGains, d.gains[i])
    for j in range(n):
        copy(values[j], d.heard[GIVEN, i, j])
    _judge(d, i, n, values, age, valid, stamp, shared, gains, now)
    if d.shared_at[i] == d.shared_at[i]:
        # Rates first: a value is moved by where its rate will carry it.
        for rates in (True, False):
            for m in range(values.shape[1]):
                kind = d.columns[_FOLLOWER, m, _RATE_OF]
                if (kind >= 0) != rates or kind < VALUE:
                    continue
                if gains.hull > 0.0 or (gains.F > 0.0 and not rates):
                    _measure(d, i, n, m, values, age, valid, shared, gains.horizon, now)
                if gains.hull > 0.0:
                    _clip(d, i, n, m, values, age, gains)
                if gains.F > 0.0 and not rates:
                    _reduce(d, i, n, m, gains)
    _note_standings(d, i, n, valid, gains, events, now, dt)
