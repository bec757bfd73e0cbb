"""Draws whose values are given: what a search flies next."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ftcc.groundside.studies.quantities import Draws

__all__ = ["GivenDraws"]


@dataclass(frozen=True)
class GivenDraws(Draws):
    """Values of all random quantities, given one by one; whatever else is random has one seed in all flights."""

    own: tuple[Any, ...] = ()
    """The scenario's own value of each quantity, or its median."""
    first: int = 0
    """Number of the first draw of ``rows``."""
    rows: tuple[tuple[Any, ...], ...] = ()

    @property
    def count(self) -> int:
        """Return the number of draws up to the last one given."""
        return self.first + len(self.rows)

    def values(self, draw: int, attempt: int = 0) -> tuple[Any, ...]:
        """Return the value of each of `quantities`, the same in each attempt."""
        return self.rows[draw - self.first]

    def seed_of(self, draw: int) -> int:
        """Return the seed of all draws."""
        return self.seed

    def middle(self) -> tuple[Any, ...]:
        """Return values with which the scenario flies."""
        return self.own
