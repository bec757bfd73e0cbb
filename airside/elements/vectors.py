"""Algebra of three axes on tuples: no memory, the same bits compiled and in plain Python. Matrices are their rows."""

from __future__ import annotations

from ftcc.airside.elements.nonlinear import clip
from ftcc.link.compiled import compiled
from ftcc.link.rotation import nearest_turn, wrapped

__all__ = [
    "added",
    "applied",
    "applied_transposed",
    "dot",
    "limited_to",
    "nearest_turns",
    "over",
    "scaled",
    "subtracted",
    "times",
    "turned",
]


@compiled
def added(a, b):
    """a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@compiled
def subtracted(a, b):
    """a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compiled
def turned(a, b):
    """From the angles b to the angles a (rad), each the shorter way around: a - b within half a turn."""
    return wrapped(a[0] - b[0]), wrapped(a[1] - b[1]), wrapped(a[2] - b[2])


@compiled
def nearest_turns(a, b):
    """The angles a (rad) plus the whole turns that bring each within half a turn of its like in b."""
    return nearest_turn(a[0], b[0]), nearest_turn(a[1], b[1]), nearest_turn(a[2], b[2])


@compiled
def scaled(factor, a):
    """``factor`` (a number) times a."""
    return factor * a[0], factor * a[1], factor * a[2]


@compiled
def times(a, b):
    """Axis by axis: diag(a) b."""
    return a[0] * b[0], a[1] * b[1], a[2] * b[2]


@compiled
def over(a, b):
    """Axis by axis: diag(b)^-1 a."""
    return a[0] / b[0], a[1] / b[1], a[2] / b[2]


@compiled
def dot(a, b):
    """a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def applied(m, a):
    """m a, for a matrix of three rows."""
    return dot(m[0], a), dot(m[1], a), dot(m[2], a)


@compiled
def applied_transposed(m, a):
    """m^T a."""
    return (
        m[0][0] * a[0] + m[1][0] * a[1] + m[2][0] * a[2],
        m[0][1] * a[0] + m[1][1] * a[1] + m[2][1] * a[2],
        m[0][2] * a[0] + m[1][2] * a[1] + m[2][2] * a[2],
    )


@compiled
def limited_to(a, low, high):
    """Each axis within its limits."""
    return clip(a[0], low[0], high[0]), clip(a[1], low[1], high[1]), clip(a[2], low[2], high[2])
