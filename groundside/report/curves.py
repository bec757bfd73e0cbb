"""Evaluate the curves of a figure from a flight, and check whether the flight has them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.claims import DERIVED, Signals, evaluate_expression, names_in, uavs_in, window_of
from ftcc.groundside.report.definitions import Panel

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission

__all__ = ["Curve", "Flown", "curves_of", "drawable", "has_columns", "last_time", "uavs_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Flown:
    """A flight to draw."""

    label: str
    signals: Signals
    mission: Mission
    event_times: tuple[float, ...] = ()
    """Times of events, s."""


@dataclass(frozen=True)
class Curve:
    """One curve of a panel."""

    name: str
    """"UAV 1", or "1 - 2" for a difference."""
    uav: int
    x: Array
    y: Array


def drawable(panel: Panel, flight: Flown) -> bool:
    """Return whether a flight has all columns of a panel, and reaches its window."""
    expressions = [e for e in (panel.y, panel.x, panel.bound, panel.true, panel.reference) if e is not None]
    return has_columns(flight, expressions, panel.pairs) and (
        panel.window is None or last_time(flight) > panel.window[0]
    )


def has_columns(flight: Flown, expressions: Sequence[str], pairs: Sequence[tuple[int, int]] | None) -> bool:
    """Return whether a flight has the columns and UAVs that ``expressions`` and ``pairs`` name."""
    graph = flight.mission.graph
    known = {"t", *flight.signals.names, *(DERIVED if graph.leaders else ())}
    others = {uav for expression in expressions for uav in uavs_in(expression)}
    others |= {uav for pair in pairs or () for uav in pair}
    return all(names_in(expression) <= known for expression in expressions) and others <= set(graph.uavs)


def last_time(flight: Flown) -> float:
    """Return the last recorded time of any UAV, s; -1 if nothing was recorded."""
    times = [flight.signals.column("t", uav) for uav in flight.signals.uavs]
    return max((float(t[-1]) for t in times if len(t)), default=-1.0)


def uavs_of(uavs: Sequence[int] | str, mission: Mission) -> tuple[int, ...]:
    """Return the ids of "followers", "leaders", "all" or a list."""
    if isinstance(uavs, str):
        graph = mission.graph
        return {"followers": graph.followers, "leaders": graph.leaders, "all": graph.uavs}[uavs]
    return tuple(uav for uav in uavs if uav in mission.uavs)


def curves_of(
    y: str,
    flight: Flown,
    uavs: Sequence[int] | str,
    pairs: Sequence[tuple[int, int]] | None = None,
    window: tuple[float, float] | None = None,
    x: str = "t",
) -> Iterator[Curve]:
    """Yield an expression as a curve per UAV, or the difference per pair; UAVs without rows are left out."""
    graph = flight.mission.graph
    compared = [(uav, None) for uav in uavs_of(uavs, flight.mission)] if pairs is None else list(pairs)
    for uav, other in compared:
        t = flight.signals.column("t", uav)
        if len(t) == 0 or (other is not None and len(flight.signals.column("t", other)) == 0):
            continue
        values = evaluate_expression(y, flight.signals, graph, uav)
        name = f"UAV {uav}"
        if other is not None:
            theirs = evaluate_expression(y, flight.signals, graph, other)
            rows = min(len(values), len(theirs))
            t, values, name = t[:rows], values[:rows] - theirs[:rows], f"{uav} - {other}"
        along = t if x == "t" else evaluate_expression(x, flight.signals, graph, uav)[: len(t)]
        rows_ = window_of(t, window) if window is not None else slice(None)
        if len(t[rows_]):
            yield Curve(name, uav, along[rows_], values[rows_])
