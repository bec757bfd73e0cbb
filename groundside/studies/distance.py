"""How far values are from those of the scenario, in units of their distributions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from ftcc.groundside.statistics import Distribution, DistributionError
from ftcc.groundside.studies.quantities import RandomQuantity

__all__ = ["distance", "own_value", "place_of", "values_at"]

_INSIDE = 1e-6
"""Distance of all points from the faces of the unit cube, where a distribution may have no finite quantile."""


def own_value(document: Any, quantity: RandomQuantity) -> tuple[Any, bool]:
    """Return the scenario's own value of a quantity, and True; the median and False where it has no such value."""
    node = document
    for part in quantity.path:
        try:
            node = node[int(part)] if isinstance(node, list) else node[part]
        except (LookupError, TypeError, ValueError):
            node = None
            break
    try:
        place_of(quantity.distribution, node)
    except DistributionError:
        return quantity.distribution.values([0.5])[0], False
    return node, True


def place_of(law: Distribution, value: Any) -> float:
    """Return F(value), from 0 to 1; a value between two numbers of a choice is between their steps.

    Raises
    ------
    DistributionError
        If it is no number, or a word that the choice does not have.
    """
    if law.name == "choice" and law.ordered and isinstance(value, int | float) and not isinstance(value, bool):
        values = law.parameters["values"]
        if value not in values:
            shares = law.parameters.get("p", [1.0 / len(values)] * len(values))
            return min(1.0, math.fsum(share for one, share in zip(values, shares, strict=True) if one < value))
    return law.place(value)


def distance(quantities: Sequence[RandomQuantity], values: Sequence[Any], own: Sequence[Any]) -> float:
    """Return sqrt(sum d_i^2) with d_i = abs(F_i(value) - F_i(own)), F_i the distribution function of quantity i.

    Words, and true and false, have no order and cost nothing. It is at most sqrt(n) for n quantities.
    """
    steps = [
        place_of(one.distribution, value) - place_of(one.distribution, mine)
        for one, value, mine in zip(quantities, values, own, strict=True)
        if one.distribution.ordered
    ]
    return math.sqrt(math.fsum(step * step for step in steps))


def values_at(quantities: Sequence[RandomQuantity], point: Sequence[float]) -> tuple[Any, ...]:
    """Return the quantile of each quantity at a point of the unit cube."""
    pairs = zip(quantities, point, strict=True)
    return tuple(one.distribution.values([min(max(u, _INSIDE), 1.0 - _INSIDE)])[0] for one, u in pairs)
