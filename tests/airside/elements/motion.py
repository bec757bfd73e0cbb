"""Independent integration of an element's rates."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp


def integrated(
    rates: Callable[[float, NDArray[np.float64]], Sequence[float]], start: Sequence[float], t: NDArray[np.float64]
) -> NDArray[np.float64]:
    """States at the times ``t``, shape (states, times), by an adaptive integrator of order 8."""
    solution = solve_ivp(rates, (0.0, float(t[-1])), list(start), "DOP853", t, rtol=1e-10, atol=1e-12, max_step=0.05)
    assert solution.success, solution.message
    found: NDArray[np.float64] = solution.y
    return found
