"""Who distrusts whom, as events: noted by the tick, worded later."""

from __future__ import annotations

from ftcc.airside.defence.arrays import Edge
from ftcc.link.compiled import compiled
from ftcc.link.events import note

__all__ = ["BANNED", "EXTREME", "SURPRISING", "TRUST_KINDS", "note_standing", "trust_text"]

_DISTRUSTS, _TRUSTS = TRUST_KINDS = (20, 21)
"""Kinds of the events of this module; their number is the in-edge times `_REASONS` plus the reason."""

_REASONS = 4
BANNED, SURPRISING, EXTREME = range(3)
"""Why a value is left out."""
_WORDS = {
    BANNED: "it contradicts itself, or what an aircraft can do",
    SURPRISING: "what it tells surprises again and again",
    EXTREME: "its values are the most extreme",
}
_STANDING, _DISTRUSTED = (Edge._fields.index(name) for name in ("standing", "distrusted"))
_DOUBT, _FAITH = 0.2, 0.6
"""A neighbour is distrusted from where its standing falls below the first until it rises above the second."""


@compiled
def note_standing(events, edge, i, j, reason, now_us):
    """Note an event where UAV ``i`` begins or ceases to distrust its in-neighbour ``j``, an index as well."""
    if edge[_DISTRUSTED] == 0.0 and edge[_STANDING] < _DOUBT:
        edge[_DISTRUSTED] = 1.0
        note(events, now_us, i, _DISTRUSTS, j * _REASONS + reason)
    elif edge[_DISTRUSTED] == 1.0 and edge[_STANDING] > _FAITH:
        edge[_DISTRUSTED] = 0.0
        note(events, now_us, i, _TRUSTS, j * _REASONS + reason)


def trust_text(kind: int, number: int, senders: list[int]) -> tuple[str, str]:
    """Severity and text of an event of a kind of this module; ``senders`` are the ids behind the in-edges."""
    edge, reason = divmod(number, _REASONS)
    if kind == _TRUSTS:
        return "info", f"trusts UAV {senders[edge]} again"
    if reason == EXTREME:
        # Of honest neighbours some are always the most extreme: that is no alarm.
        return "info", f"leaves UAV {senders[edge]} out of its sums: {_WORDS[reason]}"
    return "warning", f"distrusts UAV {senders[edge]}: {_WORDS[reason]}"
