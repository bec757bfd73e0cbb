"""The attacks in a process as plain arrays: a row each, of the scenario and from the ground."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.attacks.attack import Attack, touched
from ftcc.airside.scheme import Scheme
from ftcc.airside.schemes import find
from ftcc.airside.spec import AutopilotSpec
from ftcc.link.attacks import KINDS, LONGEST
from ftcc.link.timing import Timing

__all__ = [
    "FROM_GROUND",
    "LOG_FULL",
    "OWN",
    "Attacks",
    "Clock",
    "Numbers",
    "Row",
    "add_attack",
    "end_attacks",
    "new_attacks",
]

OWN = -1
"""Stands for an in-edge: what the UAV itself tells."""
FROM_GROUND = 2**16
"""``Attack.number`` of those from the ground."""

_SPARE = 32
"""Attacks that the ground may have waiting or under way in one process."""
LOG_FULL = 4096
"""Rows of what was told that wait to be recorded at most when a tick begins; there is room for twice as many."""


class Clock(NamedTuple):
    """Entries of ``Attacks.clock``."""

    in_use: int
    """Rows in use; 0: nobody lies, and nothing is done."""
    logged: int
    """Rows of ``log`` in use."""
    seed: int
    exchange_us: int
    record_us: int
    """Time between two recorded rows."""


class Row(NamedTuple):
    """The first columns of ``Attacks.rows`` (integers)."""

    uav: int
    """Index of the UAV in its process."""
    edge: int
    """Its in-edge, or `OWN`."""
    kind: int
    begin: int
    """us."""
    end: int
    """us."""
    delay: int
    """Records that a replay looks back."""
    window: int
    """Records of a window that is replayed; 0: none."""
    number: int
    sender: int
    """Id of whose records are false."""
    receiver: int
    """Id of who hears them; 0: everybody."""
    speaker: int
    """In-edge of who speaks in the sender's name; -1: nobody."""
    leads: int
    """1 where the sender is a leader."""
    first: int
    """Sequence number of the first record that was false; -1: none yet."""
    kept_first: int
    """Sequence number of the first record in the history; -1: none yet."""
    kept_last: int


class Numbers(NamedTuple):
    """The first columns of ``Attacks.numbers``; behind them sizes, rates and values of the beginning, by column."""

    period: float
    onset: float


class LogRow(NamedTuple):
    """The first columns of ``Attacks.log``; behind them what was true, and what was told, by column."""

    t: float
    """s."""
    sender: float
    receiver: float
    """0: everybody."""
    leads: float
    """1 where the sender is a leader."""


class Attacks(NamedTuple):
    """n attacks on records of m values."""

    clock: NDArray[np.int64]
    """(5,), see `Clock`."""
    rows: NDArray[np.int64]
    """(n, c + 3 m): see `Row`; then source, order and whether it is an error of each column, see `Touched`."""
    numbers: NDArray[np.float64]
    """(n, 2 + 3 m): see `Numbers`."""
    history: NDArray[np.float64]
    """(n, LONGEST, m): what a replay looks back on, by sequence number."""
    log: NDArray[np.float64]
    """(l, 4 + 2 m): see `LogRow`."""
    told: NDArray[np.float64]
    """(k + 1, w): what each UAV told its neighbours last, where anybody lies; the last row is scratch."""


def new_attacks(specs: Sequence[AutopilotSpec], shared_width: int, timing: Timing) -> Attacks:
    """The attacks of ``specs``, in their order, with room for more; records have ``shared_width`` values."""
    scheme = find(specs[0].scheme)
    planned = [(i, spec, attack) for i, spec in enumerate(specs) for attack in spec.attacks]
    n, m = len(planned) + _SPARE, scheme.shared_width
    attacks = Attacks(
        clock=np.array(Clock(0, 0, timing.seed, timing.exchange_us, timing.record_every * timing.period_us), np.int64),
        rows=np.zeros((n, len(Row._fields) + 3 * m), np.int64),
        numbers=np.zeros((n, len(Numbers._fields) + 3 * m)),
        history=np.zeros((n, LONGEST, m)),
        log=np.zeros((2 * LOG_FULL, len(LogRow._fields) + 2 * m)),
        told=np.zeros((len(specs) + 1, shared_width)),
    )
    for i, spec, attack in planned:
        if not (attack.kind == "sybil" and spec.authenticated):
            add_attack(attacks, i, spec, attack, scheme)
    return attacks


def add_attack(attacks: Attacks, i: int, spec: AutopilotSpec, attack: Attack, scheme: Scheme, now_us: int = 0) -> bool:
    """Add an attack of UAV ``i``, or on its in-edge; False where there is no room left.

    ``now_us`` is the present time: attacks that have ended by then make room.

    Raises
    ------
    LookupError, ValueError
        If the sender shares no such signal, or ``spec`` has no such in-edge.
    """
    shared = scheme.shared.get(attack.role, ())
    m = scheme.shared_width
    columns = touched(shared, attack.signals, attack.consistent)
    names = [quantity.name for quantity in shared]
    of_receiver = attack.sender is not None
    exchange = int(attacks.clock[Clock._fields.index("exchange_us")])
    row = Row(
        uav=i,
        edge=spec.edge_from(attack.sender) if attack.sender is not None else OWN,
        kind=KINDS[attack.kind].code,
        begin=attack.at_us,
        end=attack.until_us,
        delay=round(attack.delay * 1e6 / exchange),
        window=round(attack.period * 1e6 / exchange),
        number=attack.number,
        sender=attack.sender if attack.sender is not None else spec.uav,
        receiver=spec.uav if of_receiver else 0,
        speaker=spec.edge_from(attack.speaker) if attack.speaker is not None else -1,
        leads=int(attack.role == "leader"),
        first=-1,
        kept_first=-1,
        kept_last=-1,
    )
    count = int(attacks.clock[0])
    if count < len(attacks.rows):
        place = count
        attacks.clock[0] += 1
    else:
        over = np.flatnonzero(attacks.rows[:, Row._fields.index("end")] <= now_us)
        if not len(over):
            return False
        place = int(over[0])
    by_column = np.zeros((3, m), np.int64)
    by_column[0] = -1
    by_column[:, : len(names)] = columns
    attacks.rows[place] = [*row, *by_column.ravel()]
    numbers = np.zeros((3, m))
    for column, source in enumerate(columns.source):
        if source >= 0:
            numbers[0, column] = attack.size.get(names[source], 0.0)
            numbers[1, column] = attack.rate.get(names[source], 0.0)
    attacks.numbers[place] = [attack.period, attack.onset, *numbers.ravel()]
    return True


def end_attacks(
    attacks: Attacks, i: int, edge: int, at_us: int, all_of_them: bool = True, speaker: int | None = None
) -> int:
    """End the attacks on in-edge ``edge`` (or `OWN`) of UAV ``i`` at ``at_us``; return how many.

    Those that would begin later never begin; with ``all_of_them`` false they stay as they are. With ``speaker``, an
    in-edge, only those that speak from there in another's name.
    """
    uav, place, begin, end = (Row._fields.index(name) for name in ("uav", "edge", "begin", "end"))
    rows = attacks.rows[: attacks.clock[0]]
    chosen = (rows[:, uav] == i) & (rows[:, place] == edge) & (rows[:, end] > at_us)
    if not all_of_them:
        chosen &= rows[:, begin] <= at_us
    if speaker is not None:
        chosen &= rows[:, Row._fields.index("speaker")] == speaker
    rows[chosen, end] = at_us
    return int(chosen.sum())
