"""What a UAV that lies tells its neighbours, record by record.

The law of an attacked UAV knows nothing of it. Where several attacks on the same records last at once, each takes for
the truth what the one before it tells. All times are those of the records' stamps.
"""

from __future__ import annotations

import math

from ftcc.airside.attacks.arrays import LOG_FULL, OWN, Clock, LogRow, Numbers, Row
from ftcc.link.attacks import KINDS
from ftcc.link.channel import deliver
from ftcc.link.compiled import compiled, compiled_apart, copy
from ftcc.link.exchange import due_sequence, slot_of
from ftcc.link.philox import ATTACK, gaussian_pair, philox

__all__ = ["deliver_with_lies", "hear_through_lies", "is_quiet", "must_be_recorded", "tell"]

_COUNT, _LOGGED, _SEED, _EXCHANGE_US, _RECORD_US = range(len(Clock._fields))
(
    _UAV,
    _EDGE,
    _KIND,
    _BEGIN,
    _END,
    _DELAY,
    _WINDOW,
    _NUMBER,
    _SENDER,
    _RECEIVER,
    _SPEAKER,
    _LEADS,
    _FIRST,
    _KEPT_FIRST,
    _KEPT_LAST,
) = range(len(Row._fields))
_COLUMNS = len(Row._fields)
_PERIOD, _ONSET = range(len(Numbers._fields))
_VALUES = len(Numbers._fields)
_LOG_T, _LOG_SENDER, _LOG_RECEIVER, _LOG_LEADS = range(len(LogRow._fields))
_LOG_VALUES = len(LogRow._fields)
_DRIFT, _FREEZE, _REPLAY = KINDS["drift"].code, KINDS["freeze"].code, KINDS["replay"].code
_NOISE, _OSCILLATE, _OPPOSITE = KINDS["noise"].code, KINDS["oscillate"].code, KINDS["opposite"].code
_COLLUDE, _SYBIL = KINDS["collude"].code, KINDS["sybil"].code
_IDS = 65536
"""More than there are ids of UAVs."""
_HIGHEST_ORDER = 2
_MASK = 0xFFFFFFFF
_MOST_COLUMNS = 256


@compiled
def is_quiet(attacks):
    """Whether nobody lies, and nobody will unless the ground asks for it."""
    return attacks.clock[_COUNT] == 0


@compiled
def must_be_recorded(attacks):
    """Whether there is little room left for what was true and told."""
    return attacks.clock[_LOGGED] >= LOG_FULL


@compiled
def _drifted(size, rate, since, x, order):
    """x + r s, until it is ``size`` away; 0: no limit."""
    limited = size != 0.0 and abs(rate) * since >= abs(size)
    if order == 0:
        return x + math.copysign(abs(size), rate) if limited else x + rate * since
    return x + rate if order == 1 and not limited else x


@compiled
def _oscillating(size, period, since, x, order):
    w = 2.0 * math.pi / period
    if order == 0:
        return x + size * math.sin(w * since)
    return x + size * w * math.cos(w * since) if order == 1 else x - size * w * w * math.sin(w * since)


@compiled
def _mean_of_truth_and_target(target, rate, onset, since, value, first, x, order):
    """(1 - w) x + w (c + r s) and its derivatives; ``value`` is what is lied about, ``first`` its derivative."""
    rising = since < onset
    w = since / onset if rising else 1.0
    speed = 1.0 / onset if rising else 0.0
    if order == 0:
        return (1.0 - w) * x + w * (target + rate * since)
    if order == 1:
        return (1.0 - w) * x + w * rate + speed * (target + rate * since - value)
    return (1.0 - w) * x + 2.0 * speed * (rate - first)


@compiled
def _looked_back(attacks, n, column, sequence):
    """What the sender told ``delay`` records ago, or within a window that is replayed; at least the oldest kept."""
    row = attacks.rows[n]
    depth = attacks.history.shape[1]
    if row[_WINDOW] > 0:
        wanted = row[_FIRST] - row[_DELAY] + (sequence - row[_FIRST]) % row[_WINDOW]
    else:
        wanted = max(sequence - row[_DELAY], sequence - depth + 1)
    wanted = max(wanted, row[_KEPT_FIRST])
    return attacks.history[n, wanted % depth, column]


@compiled
def _lie(attacks, n, values, column, sequence, stamp):
    """What attack ``n`` makes of one value of a record."""
    m = attacks.history.shape[2]
    row, numbers = attacks.rows[n], attacks.numbers[n]
    kind, source, order = row[_KIND], row[_COLUMNS + column], row[_COLUMNS + m + column]
    size, rate, beginning = (
        numbers[_VALUES + column],
        numbers[_VALUES + m + column],
        numbers[_VALUES + 2 * m + column],
    )
    since = (stamp - row[_BEGIN]) / 1e6
    x = values[column]
    if kind == _DRIFT:
        return _drifted(size, rate, since, x, order)
    if kind == _FREEZE:
        return beginning if order == 0 else 0.0
    if kind == _REPLAY:
        return _looked_back(attacks, n, column, sequence)
    if kind == _NOISE:
        if order > 0:
            return x
        link = row[_SENDER] * _IDS + row[_RECEIVER]
        u, v, _, _ = philox(attacks.clock[_SEED], sequence & _MASK, link, ATTACK, row[_NUMBER] * _MOST_COLUMNS + column)
        return x + size * gaussian_pair(u, v)[0]
    if kind == _OSCILLATE:
        return _oscillating(size, numbers[_PERIOD], since, x, order)
    if kind == _OPPOSITE:
        return 2.0 * beginning - x if order == 0 else -x
    if kind == _COLLUDE:
        first = 0.0
        for other in range(m):
            if row[_COLUMNS + other] == source and row[_COLUMNS + m + other] == 1:
                first = values[other]
        return _mean_of_truth_and_target(size, rate, numbers[_ONSET], since, values[source], first, x, order)
    # An offset, also of what a speaker tells in another's name.
    return x + size if order == 0 else x


@compiled
def _remember(attacks, n, values, sequence):
    """Keep a record for a replay; one that never came is as the next."""
    row, depth = attacks.rows[n], attacks.history.shape[1]
    if row[_KEPT_FIRST] < 0:
        row[_KEPT_FIRST], row[_KEPT_LAST] = sequence, sequence
    start = max(min(row[_KEPT_LAST] + 1, sequence), sequence - depth + 1)
    for one in range(start, sequence + 1):
        for m in range(attacks.history.shape[2]):
            attacks.history[n, one % depth, m] = values[m]
    row[_KEPT_LAST] = sequence


@compiled
def _begin(attacks, n, values, sequence):
    """Keep the values of the first false record; an exchange that is repeated at one instant sets them again."""
    row, m = attacks.rows[n], attacks.history.shape[2]
    if row[_FIRST] >= 0 and row[_FIRST] != sequence:
        return
    row[_FIRST] = sequence
    mirrors_errors = row[_KIND] == _OPPOSITE
    for column in range(m):
        about_zero = mirrors_errors and row[_COLUMNS + 2 * m + column] == 1
        attacks.numbers[n, _VALUES + 2 * m + column] = 0.0 if about_zero else values[column]


@compiled
def _take_over(attacks, exchange, n, i, values, sequence):
    """Replace a record by that of the speaker at the same instant; False where he did not speak."""
    row = exchange.sender[i, attacks.rows[n, _SPEAKER]]
    slot = slot_of(sequence)
    if exchange.sequence[row, slot] != sequence or exchange.radio_on[row, slot] == 0:
        return False
    for m in range(attacks.history.shape[2]):
        values[m] = exchange.values[row, slot, m]
    return True


@compiled
def _note(attacks, n, true, told, stamp):
    """Keep what was true and what was told at ``stamp``, to be recorded; at most once per period of the recording."""
    clock, log, m = attacks.clock, attacks.log, attacks.history.shape[2]
    period = clock[_RECORD_US]
    if stamp > 0 and stamp // period == (stamp - clock[_EXCHANGE_US]) // period:
        return
    t, sender, receiver = stamp / 1e6, float(attacks.rows[n, _SENDER]), float(attacks.rows[n, _RECEIVER])
    place = clock[_LOGGED]
    before = place - 1
    # An exchange that is repeated at one instant counts with its last values.
    while before >= 0 and log[before, _LOG_T] == t:
        if log[before, _LOG_SENDER] == sender and log[before, _LOG_RECEIVER] == receiver:
            place = before
        before -= 1
    if place == log.shape[0]:
        return
    clock[_LOGGED] = max(clock[_LOGGED], place + 1)
    log[place, _LOG_T], log[place, _LOG_SENDER], log[place, _LOG_RECEIVER] = t, sender, receiver
    log[place, _LOG_LEADS] = float(attacks.rows[n, _LEADS])
    for column in range(m):
        log[place, _LOG_VALUES + column] = true[column]
        log[place, _LOG_VALUES + m + column] = told[column]


@compiled_apart
def _falsify(attacks, exchange, true, told, i, edge, sequence, stamp):
    """Put all lies about one record into ``told``, which holds the truth."""
    m = attacks.history.shape[2]
    last = -1
    for n in range(attacks.clock[_COUNT]):
        row = attacks.rows[n]
        if row[_UAV] != i or row[_EDGE] != edge or stamp >= row[_END]:
            continue
        # A window that is replayed again and again must not be overwritten.
        if row[_KIND] == _REPLAY and (row[_WINDOW] == 0 or row[_FIRST] < 0):
            _remember(attacks, n, told, sequence)
        if stamp < row[_BEGIN]:
            continue
        if row[_KIND] == _SYBIL and not _take_over(attacks, exchange, n, i, told, sequence):
            continue
        _begin(attacks, n, told, sequence)
        # A rate's lie needs the true value: the highest derivatives first.
        for step in range(_HIGHEST_ORDER + 1):
            for column in range(m):
                if row[_COLUMNS + column] >= 0 and row[_COLUMNS + m + column] == _HIGHEST_ORDER - step:
                    told[column] = _lie(attacks, n, told, column, sequence, stamp)
        last = n
    if last >= 0:
        _note(attacks, last, true, told, stamp)


@compiled_apart
def tell(attacks, exchange, true, i, sequence, stamp):
    """Set row ``i`` of ``told`` to what UAV ``i`` tells its neighbours of ``true``, its record number ``sequence``."""
    told = attacks.told[i]
    copy(true, told)
    _falsify(attacks, exchange, true, told, i, OWN, sequence, stamp)


@compiled_apart
def hear_through_lies(attacks, exchange, i, edge, sequence, values):
    """Set ``values`` to what UAV ``i`` gets of record ``sequence`` of in-edge ``edge``."""
    row, slot = exchange.sender[i, edge], slot_of(sequence)
    true = exchange.values[row, slot]
    copy(true, values)
    _falsify(attacks, exchange, true, values, i, edge, sequence, exchange.stamp[row, slot])


@compiled_apart
def deliver_with_lies(attacks, exchange, inbox, radio_on, i, now_us, latency_us, seed):
    """As `exchange.deliver_due`, where in-edges may be attacked."""
    heard = attacks.told[attacks.told.shape[0] - 1]
    for edge in range(inbox.degree[i]):
        row = exchange.sender[i, edge]
        while True:
            sequence = due_sequence(exchange, inbox, i, edge, now_us, latency_us)
            if sequence < 0:
                break
            slot = slot_of(sequence)
            hear_through_lies(attacks, exchange, i, edge, sequence, heard)
            both_on = exchange.radio_on[row, slot] == 1 and radio_on == 1
            stamp = exchange.stamp[row, slot]
            deliver(inbox, i, edge, sequence, stamp, both_on, heard, latency_us, now_us, seed)
