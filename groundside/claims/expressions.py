"""Expressions over the columns of a recording; claims, figures and schemes use them.

An expression is arithmetic over column names, such as ``z - z_d`` or ``abs(S1) / 2``:

- ``z[4]`` is the z of UAV 4 at the same times.
- ``total(z)`` and ``largest(z)`` are taken over all followers.
- ``disagreement(z)`` is sum_j a_ij (z_i - z_j) over the in-neighbours j of follower i.
- Angles are recorded within half a turn. ``wrapped(mu - mu_d)`` is a difference within half a turn (rad), and
  ``turn_disagreement(mu)`` is the disagreement of such differences.

With leaders in the graph, followers have further columns: ``x_d`` and ``z_d`` are position and altitude from the hull
weights; ``hull_distance`` is the distance above or below all leaders, ``hull_distance_x`` that ahead of or behind them.
"""

from __future__ import annotations

import ast
import functools
import math
import operator
from collections.abc import Callable, Iterable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ftcc.link.graph import Graph, GraphError

__all__ = [
    "CLOSE",
    "DERIVED",
    "Signals",
    "check_expression",
    "evaluate_expression",
    "names_in",
    "recorded_names",
    "uavs_in",
    "unwrapped",
    "window_of",
    "wrapped",
]

Array = NDArray[np.float64]

_PLACES = {"x_d": "x", "z_d": "z"}
_DISTANCES = {"hull_distance_x": "x", "hull_distance": "z"}
"""Derived columns, and the leaders' recorded column from which each is computed."""

DERIVED = {
    "x_d": "forward position of the containment point, m",
    "z_d": "altitude of the containment point, m",
    "hull_distance_x": "distance outside the leaders' forward positions, m",
    "hull_distance": "distance outside the leaders' altitudes, m",
}

CLOSE = 1e-9
"""Tolerance for equal times, s."""


class Signals(Protocol):
    """A recording, on disk or in memory."""

    @property
    def uavs(self) -> tuple[int, ...]: ...

    @property
    def names(self) -> tuple[str, ...]: ...

    def column(self, name: str, uav: int) -> Array: ...


# --- angles ----------------------------------------------------------------------------------------------------------


def wrapped(angle: Array) -> Array:
    """Return angles (rad) within half a turn of 0, as ``link.rotation.wrapped``; those within it keep their bits."""
    away = (np.abs(angle) > np.pi) & np.isfinite(angle)
    return angle - 2.0 * np.pi * np.floor((np.where(away, angle, 0.0) + np.pi) / (2.0 * np.pi))


def unwrapped(angle: Array, turn: float = 2.0 * math.pi, beside: Array | None = None) -> Array:
    """Return a curve of angles without jumps of a ``turn`` (in the unit of ``angle``); nan values stay.

    The curve begins with the first angle or, if another curve is given, within half a turn of ``beside``.
    """
    found = np.array(angle, np.float64)
    there = np.isfinite(found)
    found[there] = np.unwrap(found[there], period=turn)
    if beside is not None and (both := np.flatnonzero(there & np.isfinite(beside))).size:
        found -= turn * np.round((found[both[0]] - beside[both[0]]) / turn)
    return found


# --- expressions -----------------------------------------------------------------------------------------------------

_OPERATORS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "abs": np.abs,
    "round": np.round,
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
    "exp": np.exp,
    "degrees": np.degrees,
    "wrapped": wrapped,
    "min": np.minimum,
    "max": np.maximum,
}


def _total(x: Array, i: int, graph: Graph) -> Array:
    return np.asarray(x.sum(axis=0), np.float64)


def _largest(x: Array, i: int, graph: Graph) -> Array:
    return np.asarray(x.max(axis=0), np.float64)


def _disagreement(x: Array, i: int, graph: Graph, difference: Callable[[Array], Array] = np.asarray) -> Array:
    found = np.zeros(x.shape[1])
    for j, weight in enumerate(graph.adjacency[i, : len(x)]):
        if weight > 0.0:
            found += weight * difference(x[i] - x[j])
    return found


_SWARM_FUNCTIONS: dict[str, Callable[[Array, int, Graph], Array]] = {
    "total": _total,
    "largest": _largest,
    "disagreement": _disagreement,
    "turn_disagreement": functools.partial(_disagreement, difference=wrapped),
}
"""Functions of the values of all followers (followers, n), for the i-th follower."""


@functools.cache
def _parse(expression: str) -> ast.expr:
    try:
        return ast.parse(expression.strip(), mode="eval").body
    except SyntaxError as error:
        raise ValueError(f"{expression!r} is not an expression: {error.msg}") from None


@functools.cache
def names_in(expression: str) -> frozenset[str]:
    """Return the column names that an expression uses.

    Raises
    ------
    ValueError
        If it is not arithmetic over columns.
    """
    names = set()
    called = set()
    for node in ast.walk(_parse(expression)):
        if isinstance(node, ast.Call):
            known = {**_FUNCTIONS, **_SWARM_FUNCTIONS}
            if not isinstance(node.func, ast.Name) or node.func.id not in known or node.keywords:
                raise ValueError(f"{expression!r}: functions are {', '.join(known)}")
            if node.func.id in _SWARM_FUNCTIONS and len(node.args) != 1:
                raise ValueError(f"{expression!r}: {node.func.id} takes one argument")
            called.add(id(node.func))
        elif isinstance(node, ast.Name):
            names.add((id(node), node.id))
        elif isinstance(node, (ast.BinOp, ast.UnaryOp)):
            if type(node.op) not in _OPERATORS:
                raise ValueError(f"{expression!r}: operators are + - * / **")
        elif isinstance(node, ast.Constant):
            if not isinstance(node.value, (int, float)) or isinstance(node.value, bool):
                raise ValueError(f"{expression!r}: {node.value!r} is not a number")
        elif isinstance(node, ast.Subscript):
            _subscript(expression, node)
        elif not isinstance(node, (ast.operator, ast.unaryop, ast.expr_context)):
            raise ValueError(f"{expression!r}: only arithmetic over columns is allowed")
    return frozenset(name for key, name in names if key not in called)


def recorded_names(expression: str) -> frozenset[str]:
    """Return the recorded columns that an expression is computed from; those of `DERIVED` come from others.

    Raises
    ------
    ValueError
        If it is not arithmetic over columns.
    """
    return frozenset((_PLACES | _DISTANCES).get(name, name) for name in names_in(expression))


def _subscript(expression: str, node: ast.Subscript) -> tuple[str, int]:
    """Return column and UAV of ``z[4]``."""
    name, uav = node.value, node.slice
    if isinstance(name, ast.Name) and isinstance(uav, ast.Constant) and type(uav.value) is int:
        return name.id, uav.value
    raise ValueError(f"{expression!r}: write z[4] for the z of UAV 4")


def uavs_in(expression: str) -> set[int]:
    """Return the UAVs that an expression names."""
    subscripts = (node for node in ast.walk(_parse(expression)) if isinstance(node, ast.Subscript))
    return {_subscript(expression, node)[1] for node in subscripts}


def check_expression(expression: str, columns: Iterable[str]) -> None:
    """Raise `ValueError` if an expression is not valid or uses an unknown column; the message names the known ones."""
    known = [*columns, *DERIVED]
    unknown = sorted(names_in(expression) - set(known))
    if unknown:
        raise ValueError(f"{expression!r}: there is no column {', '.join(unknown)}; there are {', '.join(known)}")


def evaluate_expression(expression: str, signals: Signals, graph: Graph, uav: int) -> Array:
    """Return the values (n,) of an expression for one UAV, at all its recorded times."""
    t = signals.column("t", uav)
    with np.errstate(all="ignore"):
        result = np.asarray(_value(_parse(expression), signals, graph, uav), np.float64)
    return np.broadcast_to(result, t.shape)


def _value(expression: ast.expr, signals: Signals, graph: Graph, uav: int) -> Any:
    t = signals.column("t", uav)

    def of_all(node: ast.expr) -> Array:
        rows = []
        for other in graph.followers:
            times = signals.column("t", other)
            rows.append(_values_at(t, times, np.broadcast_to(_value(node, signals, graph, other), times.shape)))
        return np.array(rows)

    def value(node: ast.expr) -> Any:
        if isinstance(node, ast.BinOp):
            return _OPERATORS[type(node.op)](value(node.left), value(node.right))
        if isinstance(node, ast.UnaryOp):
            return _OPERATORS[type(node.op)](value(node.operand))
        if isinstance(node, ast.Call):
            assert isinstance(node.func, ast.Name)
            if node.func.id in _SWARM_FUNCTIONS:
                place = graph.followers.index(uav) if uav in graph.followers else -1
                return _SWARM_FUNCTIONS[node.func.id](of_all(node.args[0]), place, graph)
            return _FUNCTIONS[node.func.id](*(value(argument) for argument in node.args))
        if isinstance(node, ast.Name):
            return _column(node.id, signals, graph, uav)
        if isinstance(node, ast.Subscript):
            name, other = _subscript(ast.unparse(expression), node)
            return _values_at(t, signals.column("t", other), _column(name, signals, graph, other))
        assert isinstance(node, ast.Constant)
        assert isinstance(node.value, (int, float))
        return np.float64(node.value)

    return value(expression)


def _values_at(t: Array, times: Array, values: Array) -> Array:
    """Return ``values``, given at ``times``, at the times ``t``; nan where there is none."""
    if np.array_equal(t, times):
        return values
    found = np.full(len(t), np.nan)
    if len(times):
        place = np.minimum(np.searchsorted(times, t - CLOSE), len(times) - 1)
        there = np.abs(times[place] - t) <= CLOSE
        found[there] = values[place][there]
    return found


def _column(name: str, signals: Signals, graph: Graph, uav: int) -> Array:
    if name not in DERIVED:
        return signals.column(name, uav)
    along = (_PLACES | _DISTANCES)[name]
    leaders = _leader_columns(along, signals, graph, signals.column("t", uav))
    if name in _DISTANCES:
        own = signals.column(along, uav)
        outside: Array = np.maximum(np.maximum(leaders.min(axis=0) - own, own - leaders.max(axis=0)), 0.0)
        return outside
    if uav not in graph.followers:
        return np.full(leaders.shape[1], np.nan)
    place: Array = _hull_weights(graph)[graph.followers.index(uav)] @ leaders
    return place


def _hull_weights(graph: Graph) -> Array:
    """``graph.hull_weights``, computed once: many claims of many UAVs ask for them."""
    return _computed_hull_weights(graph.followers, graph.leaders, tuple(graph.weights.items()))


@functools.lru_cache(maxsize=4)
def _computed_hull_weights(
    followers: tuple[int, ...], leaders: tuple[int, ...], weights: tuple[tuple[tuple[int, int], float], ...]
) -> Array:
    return Graph(followers, leaders, dict(weights)).hull_weights


def _leader_columns(name: str, signals: Signals, graph: Graph, t: Array) -> Array:
    """Return a column of the leaders at times ``t`` (leaders, n); nan where a leader was not recorded."""
    try:
        _hull_weights(graph)
    except GraphError as error:
        raise ValueError(f"{', '.join(DERIVED)} need leaders: {error}") from None
    return np.array([_values_at(t, signals.column("t", uav), signals.column(name, uav)) for uav in graph.leaders])


def window_of(t: Array, window: tuple[float, float]) -> slice:
    """Return the rows within a window, both ends included."""
    first = int(np.searchsorted(t, window[0] - CLOSE))
    return slice(first, int(np.searchsorted(t, window[1] + CLOSE)))
