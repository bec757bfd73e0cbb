"""What the stage `defend` works on, a row per UAV; m are the values of a record, n the in-edges."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.defence.gains import DefenceGains
from ftcc.airside.scheme import Scheme, rates_of
from ftcc.airside.spec import AutopilotSpec

__all__ = ["NOT_TOLD", "Column", "Defence", "Edge", "columns_of", "new_defence"]

NOT_TOLD, VALUE = -2, -1
"""`Column.rate_of`, where a role does not share the value, and where it is the rate of nothing."""

UNITS = ("", "m", "m/s", "rad")
"""Of values whose size can be judged; rad goes around."""


class Column(NamedTuple):
    """What is known of a value that a role shares: columns of ``Defence.columns`` (integers)."""

    unit: int
    """Index into `UNITS`; 0: another one."""
    rate: int
    """The column of its rate; -1: none is shared."""
    rate_of: int
    """The column whose rate it is; `VALUE`, `NOT_TOLD`."""


class Edge(NamedTuple):
    """What is remembered of an in-neighbour: columns of ``Defence.edges``."""

    stamp: float
    """Of the last record that was looked at, s; nan before the first."""
    banned_until: float
    """s."""
    credit: float
    """Trust that its past leaves, 0..1."""
    standing: float
    """Recent mean of the share of its weight that is left to its values, the least of them, 0..1."""
    distrusted: float
    """1 from where it was announced as such."""


class Defence(NamedTuple):
    """Of k autopilots."""

    on: NDArray[np.int64]
    """(1,): 1 in a swarm with ``[defence]``."""
    gains: NDArray[np.float64]
    """(k, g): see `DefenceGains`."""
    columns: NDArray[np.int64]
    """(2, m, 3): see `Column`; first what followers share, then leaders."""
    carried: NDArray[np.float64]
    """(1,): 1 where the law carries what it hears to the present, 0 where it uses values as they were told."""
    leads: NDArray[np.int64]
    """(k, n): 1 where the in-neighbour is a leader."""
    trusted: NDArray[np.int64]
    """(k, n): 1 where it is trusted whatever it tells."""
    shared_at: NDArray[np.float64]
    """(k,): instant of ``Autopilots.shared``, s; nan before the first."""
    edges: NDArray[np.float64]
    """(k, n, 5): see `Edge`."""
    last: NDArray[np.float64]
    """(k, n, m): the last record."""
    values: NDArray[np.float64]
    """(k, n, m): what the law gets of what was heard."""
    trust: NDArray[np.float64]
    """(k, n, m): share of its weight that each value keeps; 1 while nothing is doubted."""
    full: NDArray[np.float64]
    """(k, 1, m): trust in a virtual leader."""
    told: NDArray[np.float64]
    """(n, m): scratch for what the neighbours of a UAV told."""
    off_crowd: NDArray[np.float64]
    """(n, m): scratch for how far each value is off the neighbours' median."""
    scratch: NDArray[np.float64]
    """(2, n + 1): of a value, the distances of the neighbours' from the own one, and who counts."""


def columns_of(scheme: Scheme, values: int) -> NDArray[np.int64]:
    """(2, values, 3): what is known of the values in records of followers and of leaders, see `Column`."""
    table = np.zeros((2, values, len(Column._fields)), np.int64)
    table[:] = Column(0, -1, NOT_TOLD)
    for row, role in zip(table, ("follower", "leader"), strict=True):
        shared = scheme.shared.get(role, ())
        rates = rates_of(shared)
        for m, (quantity, rate_of) in enumerate(zip(shared, rates, strict=True)):
            unit = UNITS.index(quantity.unit) if quantity.unit in UNITS else 0
            row[m] = Column(unit, rates.index(m) if m in rates else -1, rate_of)
    return table


def new_defence(specs: Sequence[AutopilotSpec], scheme: Scheme, edges: int, values: int) -> Defence:
    """Before the first tick, when nobody is doubted; at most ``edges`` in-edges, records of ``values`` numbers."""
    k = len(specs)
    leads, trusted = np.zeros((k, edges), np.int64), np.zeros((k, edges), np.int64)
    for i, spec in enumerate(specs):
        senders = [neighbour.uav for neighbour in spec.neighbours]
        leads[i, : len(senders)] = [uav in spec.defence.leaders for uav in senders]
        trusted[i, : len(senders)] = [uav in spec.defence.trusted for uav in senders]
    remembered = np.empty((k, edges, len(Edge._fields)))
    remembered[:] = Edge(math.nan, -math.inf, 1.0, 1.0, 0.0)
    off = (0.0,) * len(DefenceGains._fields)
    return Defence(
        on=np.array([any(spec.defence.on for spec in specs)], np.int64),
        gains=np.array([spec.defence.gains or off for spec in specs], np.float64),
        columns=columns_of(scheme, values),
        carried=np.array([float(scheme.carries)]),
        leads=leads,
        trusted=trusted,
        shared_at=np.full(k, math.nan),
        edges=remembered,
        last=np.zeros((k, edges, values)),
        values=np.zeros((k, edges, values)),
        trust=np.ones((k, edges, values)),
        full=np.ones((k, 1, values)),
        told=np.zeros((edges, values)),
        off_crowd=np.zeros((edges, values)),
        scratch=np.zeros((2, edges + 1)),
    )
