"""Random quantities: which values a draw gives to which keys of the scenario."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ftcc.groundside.statistics import Design, Distribution, distribution_of, saltelli
from ftcc.groundside.studies.errors import StudyError

__all__ = ["Draws", "RandomQuantity", "quantities_in", "quantity_of"]

SEED = "seed"
"""Key of the seed, which `Draws` draws too where it measures sensitivities."""
_BLOCK = 256
"""Points that are computed together."""


@dataclass(frozen=True)
class RandomQuantity:
    """A key of the scenario and the distribution of its value."""

    key: str
    distribution: Distribution

    @property
    def path(self) -> tuple[str, ...]:
        """Return the keys, and numbers in lists, that lead to the value."""
        return tuple(self.key.split("."))


def quantities_in(table: Mapping[str, Any], where: str = "study.random") -> Iterator[RandomQuantity]:
    """Yield the random quantities of a ``[study.random]`` table, whose keys may be nested tables or have dots.

    Raises
    ------
    StudyError, DistributionError
    """
    for key, value in table.items():
        here = f"{where}.{key}"
        if not isinstance(value, Mapping):
            raise StudyError(
                f'{here} = {value!r}: must be {{ distribution = "uniform", low = 0, high = 1 }} or the like'
            )
        if isinstance(value.get("distribution"), str):
            yield RandomQuantity(here.removeprefix("study.random."), distribution_of(value, here))
        else:
            yield from quantities_in(value, here)


def quantity_of(text: str, option: str = "--random") -> RandomQuantity:
    """Read ``KEY=DISTRIBUTION(...)`` of the command line.

    Raises
    ------
    StudyError, DistributionError
    """
    key, equals, given = text.partition("=")
    if not equals or not key.strip() or not given.strip():
        raise StudyError(
            f"{option} {text}: must be key.path=distribution(...), such as channel.loss=uniform(low=0, high=0.6)"
        )
    return RandomQuantity(key.strip(), distribution_of(given.strip(), f"{option} {key.strip()}"))


@dataclass(frozen=True)
class Draws:
    """Values of all random quantities, by number of the draw: the same alone or among a million.

    With ``sensitivity``, a base sample of 2 (d + 1) dimensions, seed included, gives d + 3 draws each: A, B, and A with
    one column of B (Saltelli et al. 2010).
    """

    quantities: tuple[RandomQuantity, ...]
    design: str
    samples: int
    """Number of draws; with ``sensitivity``, of base samples."""
    seed: int
    sensitivity: bool = False

    @property
    def count(self) -> int:
        """Return the number of draws."""
        return self.samples * self.of_each

    @property
    def of_each(self) -> int:
        """Return the draws of a base sample."""
        return len(self.varied) + 2 if self.sensitivity else 1

    @functools.cached_property
    def varied(self) -> tuple[RandomQuantity, ...]:
        """Return the quantities that are drawn; with ``sensitivity`` the seed is the last one."""
        if not self.sensitivity:
            return self.quantities
        seeds = {"distribution": "integers", "low": self.seed, "high": self.seed + 2**31}
        return (*self.quantities, RandomQuantity(SEED, distribution_of(seeds, SEED)))

    def values(self, draw: int, attempt: int = 0) -> tuple[Any, ...]:
        """Return the value of each of `quantities`; ``attempt`` > 0: instead of values with which no flight begins."""
        return self._all(draw, attempt)[: len(self.quantities)]

    def seed_of(self, draw: int) -> int:
        """Return the seed of a draw's flights."""
        return int(self._all(draw, 0)[-1]) if self.sensitivity else self.seed + draw

    def _all(self, draw: int, attempt: int) -> tuple[Any, ...]:
        if not self.varied:
            return ()
        if attempt == 0:
            point = _points(self, draw // _BLOCK)[draw % _BLOCK]
        else:  # independent points, because those of the design are taken
            again = Design("random", len(self.varied), self.seed + 1 + draw, attempt + 1)
            point = again.points(attempt, attempt + 1)[0]
        return tuple(one.distribution.values(point[n : n + 1])[0] for n, one in enumerate(self.varied))

    def middle(self) -> tuple[Any, ...]:
        """Return the median of each of `quantities`."""
        return self.at([0.5] * len(self.quantities))

    def at(self, shares: Sequence[float]) -> tuple[Any, ...]:
        """Return the quantile of each of `quantities`."""
        pairs = zip(self.quantities, shares, strict=True)
        return tuple(one.distribution.values([share])[0] for one, share in pairs)


@functools.lru_cache(maxsize=8)
def _cached_points(design: Design, sensitivity: bool, dimensions: int, block: int, last: int) -> Any:
    first = block * _BLOCK
    if not sensitivity:
        return design.points(first, last)
    of_each = dimensions + 2
    bases = range(first // of_each, -(-last // of_each))
    points = saltelli(design, bases.start, bases.stop).reshape(-1, dimensions)
    return points[first - bases.start * of_each :][: last - first]


def _points(draws: Draws, block: int) -> Any:
    dimensions = len(draws.varied)
    design = Design(draws.design, 2 * dimensions if draws.sensitivity else dimensions, draws.seed, draws.samples)
    return _cached_points(design, draws.sensitivity, dimensions, block, min((block + 1) * _BLOCK, draws.count))
