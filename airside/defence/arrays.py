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

__all__ = [
    "CARRIED",
    "GIVEN",
    "LAST",
    "LEADS",
    "NOT_TOLD",
    "ON",
    "TRUST",
    "TRUSTED",
    "VALUE",
    "Column",
    "Defence",
    "Edge",
    "columns_of",
    "new_defence",
]

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


ON, CARRIED = range(2)
"""Entries of ``Defence.switches``."""
LEADS, TRUSTED = range(2)
"""Columns of ``Defence.known``."""
LAST, GIVEN, TRUST = range(3)
"""First index of ``Defence.heard``."""


class Defence(NamedTuple):
    """Of k autopilots. Few arrays: each costs time where a law is compiled."""

    switches: NDArray[np.int64]
    """(2,): 1 in a swarm with ``[defence]``; 1 where the law carries what it hears to the present, 0 where it uses
    values as they were told."""
    gains: NDArray[np.float64]
    """(k, g): see `DefenceGains`."""
    columns: NDArray[np.int64]
    """(2, m, 3): see `Column`; first what followers share, then leaders."""
    known: NDArray[np.int64]
    """(k, n, 2): of each in-neighbour, 1 where it is a leader, and where it is trusted whatever it tells."""
    shared_at: NDArray[np.float64]
    """(k,): instant of ``Autopilots.shared``, s; nan before the first."""
    edges: NDArray[np.float64]
    """(k, n, 5): see `Edge`."""
    heard: NDArray[np.float64]
    """(3, k, n, m): the last record that was looked at; what the law is given; the share of its weight that each value
    keeps, 1 while nothing is doubted."""
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
    known = np.zeros((k, edges, 2), np.int64)
    for row, spec in zip(known, specs, strict=True):
        for edge, neighbour in enumerate(spec.neighbours):
            row[edge] = neighbour.uav in spec.defence.leaders, neighbour.uav in spec.defence.trusted
    remembered = np.empty((k, edges, len(Edge._fields)))
    remembered[:] = Edge(math.nan, -math.inf, 1.0, 1.0, 0.0)
    heard = np.zeros((3, k, edges, values))
    heard[TRUST] = 1.0
    off = (0.0,) * len(DefenceGains._fields)
    return Defence(
        switches=np.array([any(spec.defence.on for spec in specs), scheme.carries], np.int64),
        gains=np.array([spec.defence.gains or off for spec in specs], np.float64),
        columns=columns_of(scheme, values),
        known=known,
        shared_at=np.full(k, math.nan),
        edges=remembered,
        heard=heard,
        off_crowd=np.zeros((edges, values)),
        scratch=np.zeros((2, edges + 1)),
    )
