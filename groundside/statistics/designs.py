"""Designs: points in the unit cube, by row, the same whatever is asked beside them."""

from __future__ import annotations

import functools
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.errors import UserError

__all__ = ["DESIGNS", "SMALLEST", "Design"]

Array = NDArray[np.float64]

DESIGNS = ("sobol", "lhs", "random")

_BITS = 30
_CELLS = 2.0**_BITS
"""Cells of an axis; points of "sobol" and "random" are in the middles of cells."""
SMALLEST = 0.5 / _CELLS
"""Smallest coordinate of a point; the largest is 1 - SMALLEST, so that quantiles of unbounded distributions exist."""


@dataclass(frozen=True)
class Design:
    """Points in the unit cube.

    "sobol" (Sobol' sequence, scrambled by Owen's linear matrix and a digital shift, `scipy.stats.qmc.Sobol`) and
    "random" (independent) do not depend on ``samples``: row n is the same alone or among a million, and a longer study
    goes on where a shorter one ended. "lhs" (Latin hypercube) does: each of ``samples`` equal slices of each axis
    holds one point, so that another number of samples is another design, and part of it is no Latin hypercube.

    Raises
    ------
    UserError
        The kind is unknown, a number is negative, or "sobol" has too many dimensions.
    """

    kind: str
    """One of `DESIGNS`."""
    dimensions: int
    seed: int
    samples: int

    def __post_init__(self) -> None:
        if self.kind not in DESIGNS:
            raise UserError(f"design {self.kind!r}: must be {', '.join(DESIGNS[:-1])} or {DESIGNS[-1]}")
        for name in ("dimensions", "seed", "samples"):
            number = getattr(self, name)
            if isinstance(number, bool) or not isinstance(number, int | np.integer) or number < 0:
                raise UserError(f"{name} = {number!r} of a design: must be a whole number from 0 on")
        if self.kind == "sobol":
            from scipy.stats.qmc import Sobol

            if self.dimensions > Sobol.MAXDIM:
                raise UserError(f"{self.dimensions} dimensions: a Sobol' design has at most {Sobol.MAXDIM}")

    def points(self, first: int, last: int) -> Array:
        """Return rows first to last - 1, shape (last - first, dimensions), from SMALLEST to 1 - SMALLEST.

        Raises
        ------
        UserError
            The design has no such rows: "lhs" has ``samples``, the others 2^30.
        """
        rows = self.samples if self.kind == "lhs" else 2**_BITS
        if not 0 <= first <= last <= rows:
            raise UserError(f"rows {first} to {last} of a {self.kind} design: it has {rows}")
        if self.dimensions == 0 or first == last:
            return np.zeros((last - first, self.dimensions))
        match self.kind:
            case "sobol":
                return _sobol(self, first, last)
            case "lhs":
                return _latin_hypercube(self)[first:last].copy()
            case _:
                return _random(self, first, last)


def _sobol(design: Design, first: int, last: int) -> Array:
    from scipy.stats import qmc

    with warnings.catch_warnings():
        # It warns that a number of points is no power of two; rows are asked in any portions here.
        warnings.simplefilter("ignore", UserWarning)
        sequence: Any = qmc.Sobol(design.dimensions, scramble=True, bits=_BITS, seed=_generator(design))
        if first > 0:
            sequence.fast_forward(first)
        points: Array = sequence.random(last - first)
    return points + SMALLEST


@functools.lru_cache(maxsize=1)
def _latin_hypercube(design: Design) -> Array:
    """Return all points: none can be had without the others."""
    from scipy.stats import qmc

    sampler: Any = qmc.LatinHypercube(design.dimensions, seed=_generator(design))
    points: Array = sampler.random(design.samples)
    return np.clip(points, SMALLEST, 1.0 - SMALLEST)


def _random(design: Design, first: int, last: int) -> Array:
    """Random numbers by counter (Salmon et al. 2011): row n begins at counter n times the blocks of a row."""
    of_block = 4
    blocks = -(-design.dimensions // of_block)
    key = np.random.SeedSequence(design.seed).generate_state(2, np.uint64)
    bits = np.random.Philox(key=key, counter=first * blocks)
    words = bits.random_raw((last - first) * blocks * of_block).reshape(last - first, -1)[:, : design.dimensions]
    return (words >> np.uint64(64 - _BITS)) / _CELLS + SMALLEST


def _generator(design: Design) -> np.random.Generator:
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(design.seed)))
