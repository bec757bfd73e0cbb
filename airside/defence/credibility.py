"""What a neighbour's record is worth by itself and by its sender's past: the gate, and credit, which recovers."""

from __future__ import annotations

from ftcc.airside.defence.arrays import VALUE, Column, Edge
from ftcc.airside.defence.gains import DefenceGains
from ftcc.link.compiled import compiled, copy
from ftcc.link.rotation import wrapped

__all__ = ["ANGLE", "credit_left", "is_lie", "judge_record", "say_of", "surprise"]

_UNIT, _RATE, _RATE_OF = (Column._fields.index(name) for name in ("unit", "rate", "rate_of"))
_STAMP, _BANNED, _CREDIT = (Edge._fields.index(name) for name in ("stamp", "banned_until", "credit"))
_JUMP, _MOST, _PAST, _CROWD = (DefenceGains._fields.index(name) - 1 for name in ("jump", "most_speed", "past", "crowd"))
"""Where the size for a unit stands in the gains, less the unit's index in `UNITS`, which begins with 1."""
_BAN, _RECOVERY = (DefenceGains._fields.index(name) for name in ("ban", "recovery"))
ANGLE = 3
"""Index into `UNITS`."""
_LEAST, _NONE = 0.01, 0.05
"""Credit never falls below the first, from which it recovers; below the second a neighbour has no say."""


@compiled
def is_lie(change, rate, rate_before, gap, jump, most, rated):
    """Whether a record contradicts itself or what an aircraft can do: the gate.

    The ``change`` of a value in ``gap`` seconds must be that by the mean of the rates that were told at both ends, or,
    where no rate is told (``rated`` 0), at most ``most`` times the gap, within ``jump`` (1 + gap / 1 s); a told rate
    may be at most ``most``. 0 switches a test off.
    """
    if most > 0.0 and rated > 0 and abs(rate) > most:
        return True
    if jump == 0.0:
        return False
    slack = jump * (1.0 + gap)
    if rated > 0:
        return abs(change - 0.5 * (rate + rate_before) * gap) > slack
    return abs(change) > slack + most * gap


@compiled
def surprise(change, rate_before, gap, off_crowd, past, crowd):
    """How surprising a value is, over what is to be expected: > 1 costs credit.

    By the sender's own past, from which the rate told before predicts the change, and by the distance ``off_crowd``
    from the neighbours' median; each over its size, 0 = off.
    """
    found = 0.0
    if past > 0.0:
        found = abs(change - rate_before * gap) / past
    if crowd > 0.0:
        found = max(found, abs(off_crowd) / crowd)
    return found


@compiled
def credit_left(credit, surprised, gap, recovery):
    """Credit after a record, ``gap`` seconds after the last: it recovers with the time constant ``recovery`` (s), and
    is divided by a surprise beyond 1.

    In the manner of trust that weighs edges of a consensus (Mikulski, Lewis, Gu, Hudas, "Trust method for multi-agent
    consensus", SPIE 8387, 2012); this law of it is ours.
    """
    credit += (1.0 - credit) * min(gap / recovery, 1.0)
    return credit / surprised if surprised > 1.0 else credit


@compiled
def judge_record(gains, columns, edge, last, record, stamp, off_crowd, now):
    """Look at a new record of a neighbour: what it does to its ban and its credit, both in ``edge``, see `Edge`.

    Parameters
    ----------
    gains : `DefenceGains` as an array.
    columns : (m, 3), what its role shares, see `Column`.
    last, record : (m,), the record before, which is overwritten, and this one.
    stamp, now : s.
    off_crowd : (m,), distance of each value from the neighbours' median.
    """
    if edge[_STAMP] == edge[_STAMP]:
        gap = stamp - edge[_STAMP]
        worst, lies = 0.0, False
        for m in range(columns.shape[0]):
            unit, at = columns[m, _UNIT], columns[m, _RATE]
            if columns[m, _RATE_OF] != VALUE or unit == 0:
                continue
            change = record[m] - last[m]
            if unit == ANGLE:
                change = wrapped(change)
            rate, before = (record[at], last[at]) if at >= 0 else (0.0, 0.0)
            rated = 1 if at >= 0 else 0
            lies = lies or is_lie(change, rate, before, gap, gains[_JUMP + unit], gains[_MOST + unit], rated)
            worst = max(worst, surprise(change, before, gap, off_crowd[m], gains[_PAST + unit], gains[_CROWD + unit]))
        if lies:
            edge[_BANNED] = now + gains[_BAN]
        edge[_CREDIT] = credit_left(edge[_CREDIT], worst, gap, gains[_RECOVERY])
        edge[_CREDIT] = max(edge[_CREDIT], _LEAST)
    edge[_STAMP] = stamp
    copy(record, last)


@compiled
def say_of(edge, now):
    """Share of its weight that ban and credit leave a neighbour."""
    if now < edge[_BANNED]:
        return 0.0
    return edge[_CREDIT] if edge[_CREDIT] >= _NONE else 0.0
