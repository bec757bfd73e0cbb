"""An attack as an autopilot gets it, and which of the shared values it falsifies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from ftcc.airside.scheme import Quantity, rates_of

__all__ = ["FOR_EVER", "Attack", "Touched", "touched", "values_by_signal"]

FOR_EVER = 2**62
"""An end beyond every simulated time, us."""

_HIGHEST_ORDER = 2
"""A lie about a value is carried into its rate and into the rate of that."""


@dataclass(frozen=True)
class Attack:
    """A lie of one UAV, or on one of its in-edges; see ``link.attacks`` for the kinds."""

    kind: str
    at_us: int
    until_us: int = FOR_EVER
    """Both by the stamps of the records: from ``at_us`` on, before ``until_us``."""
    sender: int | None = None
    """The in-edge on which it acts; None: what this UAV itself tells everybody."""
    speaker: int | None = None
    """sybil: the in-neighbour that speaks in the sender's name."""
    role: str = "follower"
    """The sender's role: what it shares."""
    signals: tuple[str, ...] = ()
    """What is falsified; empty: all values that are no rates."""
    consistent: bool = True
    """Whether told rates fit the told values."""
    size: Mapping[str, float] = field(default_factory=dict)
    """By signal, in its unit."""
    rate: Mapping[str, float] = field(default_factory=dict)
    """By signal, in its unit per second."""
    period: float = 0.0
    """s."""
    delay: float = 0.0
    """s."""
    onset: float = 0.0
    """s."""
    number: int = 0
    """Tells the random numbers of attacks apart."""


class Touched(NamedTuple):
    """What an attack does to each column of a record."""

    source: tuple[int, ...]
    """The column whose lie changes this one; -1: it stays true."""
    order: tuple[int, ...]
    """0: the value that is lied about; 1, 2: its first, second derivative."""
    is_error: tuple[bool, ...]
    """Whether the value is an error, which is zero where all is well."""


def touched(shared: Sequence[Quantity], signals: Sequence[str] = (), consistent: bool = True) -> Touched:
    """Which columns of what a UAV shares an attack changes.

    Raises
    ------
    LookupError
        For a signal that it does not share; the text names those that it does.
    """
    names = [quantity.name for quantity in shared]
    unknown = [name for name in signals if name not in names]
    if unknown:
        raise LookupError(f"it shares no {', '.join(unknown)}; it shares {', '.join(names) or 'nothing'}")
    named = {names.index(name) for name in signals} or {n for n, one in enumerate(shared) if not one.rate_of}
    above = rates_of(shared)
    source, order = [-1] * len(names), [0] * len(names)
    for column in range(len(names)):
        at, steps = column, 0
        while at >= 0 and at not in named and steps < _HIGHEST_ORDER:
            at, steps = above[at], steps + 1
        if at in named and (consistent or steps == 0):
            source[column], order[column] = at, steps
    return Touched(tuple(source), tuple(order), tuple(one.shown_as == "error" for one in shared))


def values_by_signal(
    value: float | Mapping[str, float] | None, shared: Sequence[Quantity], signals: Sequence[str]
) -> dict[str, float]:
    """A size or rate of an attack by signal: a number is that of every signal that is falsified."""
    if value is None:
        return {}
    if isinstance(value, Mapping):
        return dict(value)
    chosen = signals or [one.name for one in shared if not one.rate_of]
    return dict.fromkeys(chosen, float(value))
