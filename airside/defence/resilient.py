"""What a follower leaves of values that up to F of its neighbours may have made up.

Values are compared by their distances from the own one, so that angles go the shorter way around: ``distances`` holds
that of each in-neighbour, ``counts`` is 1 for those whose value takes part. Of equal values, that of the earlier edge
counts as the more extreme one: every autopilot decides alike, to the last bit.
"""

from __future__ import annotations

import math

from ftcc.airside.defence.arrays import TRUSTED
from ftcc.link.compiled import compiled, compiled_apart

__all__ = ["bounds", "is_extreme", "ranked"]


@compiled
def is_extreme(distances, counts, n, j, F):
    """Whether W-MSR leaves out the value of neighbour ``j`` of ``n``: one of the F largest of those above the own
    value, or of the F smallest of those below.

    LeBlanc, Zhang, Koutsoukos, Sundaram, "Resilient asymptotic consensus in robust networks", IEEE Journal on Selected
    Areas in Communications 31 (2013), section IV-A: where there are fewer than F on a side, all of them. Equal values
    are never left out.
    """
    mine = distances[j]
    if mine == 0.0:
        return False
    sign = 1.0 if mine > 0.0 else -1.0
    ahead = 0
    for other in range(n):
        if counts[other] > 0.0:
            further = sign * distances[other] - sign * mine
            if further > 0.0 or (further == 0.0 and other < j):
                ahead += 1
    return ahead < F


@compiled_apart
def ranked(distances, counts, n, rank):
    """The value with ``rank`` smaller ones among those of ``n`` that count; nan where there are not so many."""
    for j in range(n):
        if counts[j] > 0.0:
            smaller = 0
            for other in range(n):
                if counts[other] > 0.0 and (
                    distances[other] < distances[j] or (distances[other] == distances[j] and other < j)
                ):
                    smaller += 1
            if smaller == rank:
                return distances[j]
    return math.nan


@compiled
def bounds(distances, counts, known, n, F):
    """Lower and upper bound of what at least one honest neighbour, or the own value, vouches for.

    From the (F + 1)-th smallest to the (F + 1)-th largest of the ``n`` values heard, extended to the own one (distance
    0) and to those of trusted neighbours (``known``, see `Defence`): with at most F liars among the others, the
    interval lies within the hull of the honest values. The own value stands in it always, as in W-MSR. The idea of the
    trimmed hull: Vaidya, Tseng, Liang, "Iterative approximate Byzantine consensus in arbitrary directed graphs", PODC
    2012; to clip a value into it instead of leaving it out is ours.
    """
    low, high, others = 0.0, 0.0, 0
    for j in range(n):
        if counts[j] > 0.0:
            if known[j, TRUSTED] == 1:
                low, high = min(low, distances[j]), max(high, distances[j])
                counts[j] = -1.0
            else:
                others += 1
    if others > F:
        low = min(low, ranked(distances, counts, n, F))
        high = max(high, ranked(distances, counts, n, others - 1 - F))
    for j in range(n):
        counts[j] = abs(counts[j])
    return low, high
