"""Fractional integral and derivative as a sum of exponentials: a bank of first-order filters that forgets nothing.

From s^-a = (sin(a pi)/pi) integral over p of p^-a/(s + p), by the trapezoidal rule in log p, with the two tails of the
integral as a direct term and as one more pole. The cost of a step does not grow with time, each pole is propagated
exactly, and the derivative is that of the integral, to the last digit.

A bank is an array of `COLUMNS` columns that the caller keeps: a row of settings, then a row per pole, for up to three
signals (axes) that share the operator.
"""

from __future__ import annotations

import math

from ftcc.link.compiled import compiled

__all__ = ["COLUMNS", "fractional_integral", "fractional_rate", "number_of_poles", "remember", "set_poles"]

COLUMNS = 7
"""Columns of a bank: see `_POLE` to `_MEMORY`, which has one for each of three axes."""

_POLE, _WEIGHT, _DECAY, _GAIN, _MEMORY = range(5)
_ORDER, _SLOWEST, _FASTEST, _PER_DECADE, _STEP, _COUNT, _DIRECT = range(COLUMNS)
"""Columns of its first row."""


@compiled
def number_of_poles(slowest, fastest, per_decade):
    """Poles of an operator for the band ``slowest`` to ``fastest`` (rad/s), with the one for all slower ones."""
    return math.floor(per_decade * math.log10(fastest / slowest) + 0.5) + 2


@compiled
def set_poles(bank, order, slowest, fastest, per_decade, h):
    """Fill ``bank`` for the integral of ``order`` a (0 <= a < 1) in steps of ``h``, unless it is filled so already.

    A bank whose poles change forgets; one whose step or order changes does not. With a = 0 there are no poles: the
    integral is the signal itself, the derivative its rate.
    """
    settings = bank[0]
    same_poles = settings[_SLOWEST] == slowest and settings[_FASTEST] == fastest
    same_poles = same_poles and settings[_PER_DECADE] == per_decade
    if same_poles and settings[_ORDER] == order and settings[_STEP] == h:
        return
    settings[_ORDER], settings[_SLOWEST], settings[_FASTEST] = order, slowest, fastest
    settings[_PER_DECADE], settings[_STEP] = per_decade, h
    settings[_COUNT], settings[_DIRECT] = 0.0, 1.0
    if not same_poles:
        bank[1:, _MEMORY:] = 0.0
    if order == 0.0:
        return
    scale = math.sin(order * math.pi) / math.pi
    count = number_of_poles(slowest, fastest, per_decade)
    first = math.log(slowest)
    spacing = (math.log(fastest) - first) / (count - 2)
    low = math.exp(first - 0.5 * spacing)
    high = first + (count - 1.5) * spacing
    settings[_COUNT] = count
    settings[_DIRECT] = scale * math.exp(-order * high) / order
    for k in range(count):
        row = bank[1 + k]
        if k == 0:
            row[_POLE] = low * (1.0 - order) / (2.0 - order)
            row[_WEIGHT] = scale * math.exp((1.0 - order) * (first - 0.5 * spacing)) / (1.0 - order)
        else:
            x = first + (k - 1) * spacing
            row[_POLE] = math.exp(x)
            row[_WEIGHT] = scale * math.exp((1.0 - order) * x) * spacing
        row[_DECAY] = math.exp(-row[_POLE] * h)
        row[_GAIN] = (1.0 - row[_DECAY]) / row[_POLE]


@compiled
def remember(bank, axis, now, before):
    """Advance the poles of ``axis`` over one step in which the signal went from ``before`` to ``now``."""
    mean = 0.5 * (now + before)
    for k in range(1, 1 + int(bank[0, _COUNT])):
        bank[k, _MEMORY + axis] = bank[k, _DECAY] * bank[k, _MEMORY + axis] + bank[k, _GAIN] * mean


@compiled
def fractional_integral(bank, axis, value):
    """D^-a of the signal of ``axis`` that is ``value`` at present."""
    total = bank[0, _DIRECT] * value
    for k in range(1, 1 + int(bank[0, _COUNT])):
        total += bank[k, _WEIGHT] * bank[k, _MEMORY + axis]
    return total


@compiled
def fractional_rate(bank, axis, value, rate):
    """D^(1-a) of the signal of ``axis`` that is ``value`` and changes by ``rate`` at present."""
    total = bank[0, _DIRECT] * rate
    for k in range(1, 1 + int(bank[0, _COUNT])):
        total += bank[k, _WEIGHT] * (value - bank[k, _POLE] * bank[k, _MEMORY + axis])
    return total
