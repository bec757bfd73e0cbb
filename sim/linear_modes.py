"""Linear modes of an airframe about level flight."""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.sim.airframe import Airframe, attitude_rates
from ftcc.sim.trim import trim

__all__ = ["LATERAL", "LONGITUDINAL", "STATES", "Mode", "linearize", "modes", "modes_of"]

STATES = ("V", "chi", "gamma", "mu", "alpha", "beta", "p", "q", "r")
"""Order of the linear model."""

LONGITUDINAL = ("V", "gamma", "alpha", "q")
LATERAL = ("mu", "beta", "p", "r")

_STEP = 1e-5
"""Of the central differences: their error, third derivative times step^2 / 6, and rounding are both below 1e-9."""


class Mode(NamedTuple):
    """A real eigenvalue, or a complex pair by the member with positive frequency."""

    name: str
    eigenvalue: complex
    """1/s."""

    @property
    def oscillates(self) -> bool:
        return self.eigenvalue.imag > 0.0

    @property
    def frequency(self) -> float:
        """Natural frequency, rad/s."""
        return abs(self.eigenvalue)

    @property
    def damping(self) -> float:
        """Damping ratio; +-1 for a real eigenvalue."""
        return -self.eigenvalue.real / abs(self.eigenvalue) if self.eigenvalue else 0.0

    @property
    def time_constant(self) -> float:
        """Time in which a real mode falls, or if negative grows, by the factor e, s."""
        return -1.0 / self.eigenvalue.real if self.eigenvalue.real else math.inf


def linearize(airframe: Airframe, V: float) -> NDArray[np.float64]:
    """Derivatives (9, 9) of the rates of `STATES` by `STATES` in level flight at ``V`` (m/s), all controls fixed."""
    steady = trim(airframe, V)

    def rates(state: NDArray[np.float64]) -> NDArray[np.float64]:
        airspeed, _, *motion = state.tolist()
        acting = [0.0, steady.elevator, 0.0, steady.thrust, 0.0, 0.0, 0.0]
        return np.array(attitude_rates(*[airspeed, *motion, *acting, airframe]))

    at = np.array([V, 0.0, 0.0, 0.0, steady.alpha, 0.0, 0.0, 0.0, 0.0])
    columns = [(rates(at + step) - rates(at - step)) / (2.0 * _STEP) for step in _STEP * np.eye(len(STATES))]
    return np.column_stack(columns)


def modes(airframe: Airframe, V: float) -> list[Mode]:
    """Modes in level flight at ``V`` (m/s): short period, phugoid, roll, Dutch roll, spiral, as far as they exist.

    Of the longitudinal motion the fast pair is the short period. Of the lateral one a complex pair is the Dutch roll,
    the fast real root the roll and the slow one the spiral. A pair that has come apart keeps its name, one per root.

    Raises
    ------
    TrimError
        If there is no level flight.
    """
    matrix = linearize(airframe, V)
    parts = [[STATES.index(name) for name in names] for names in (LONGITUDINAL, LATERAL)]
    return modes_of(*(matrix[np.ix_(part, part)] for part in parts))


def modes_of(longitudinal: NDArray[np.float64], lateral: NDArray[np.float64]) -> list[Mode]:
    """Modes of two linear models (4, 4), by name as `modes` has them."""
    pitch, turn = _roots(longitudinal), _roots(lateral)
    found = [
        Mode(name, root) for name, roots in (("short period", pitch[:2]), ("phugoid", pitch[2:])) for root in roots
    ]
    pairs = [root for root in turn if root.imag != 0.0]
    lone = [root for root in turn if root.imag == 0.0]
    if len(pairs) == 4:
        names = ["Dutch roll", "Dutch roll", "roll-spiral", "roll-spiral"]
        found += [Mode(name, root) for name, root in zip(names, pairs, strict=True)]
    else:
        found += [Mode("roll", lone[0]), *(Mode("Dutch roll", root) for root in pairs or lone[1:-1])]
        found.append(Mode("spiral", lone[-1]))
    return [mode for mode in found if mode.eigenvalue.imag >= 0.0]


def _roots(matrix: NDArray[np.float64]) -> list[complex]:
    """Eigenvalues of a linear model, fastest first."""
    roots = [complex(root) for root in np.linalg.eigvals(matrix)]
    return sorted(roots, key=lambda root: (-round(abs(root), 9), -cmath.phase(root)))
