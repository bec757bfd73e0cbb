"""Level trim of the longitudinal airframe."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.link.cache import kept
from ftcc.sim.airframe import Airframe, longitudinal_rates

__all__ = ["Trim", "TrimError", "steady_climb", "trim"]

_SCALE = np.array([0.03, -0.2, 20.0])
"""Typical angle of attack, elevator and thrust: the unknowns are solved for as multiples of these."""
_SCALE_CLIMB = np.array([0.03, -0.2, 0.1])
"""The same for angle of attack, elevator and flight-path angle."""

_LARGEST_ALPHA = 0.8
"""Beyond this the polynomials of the airframe have solutions without physical meaning, rad."""


class TrimError(ValueError):
    """The airframe has no level trim there."""


class Trim(NamedTuple):
    """Level flight at constant speed."""

    alpha: float
    """Angle of attack, which is the pitch angle in level flight, rad."""
    elevator: float
    """rad."""
    thrust: float
    """N."""


def trim(airframe: Airframe, V: float, d1: float = 0.0, d2: float = 0.0, d3: float = 0.0) -> Trim:
    """Trim at airspeed ``V`` (m/s), gamma = q = 0, under constant disturbances.

    Solves (2.8), (2.10) and (2.12) with all rates zero for angle of attack, elevator and thrust.

    Parameters
    ----------
    airframe : Airframe
    V : float
        Airspeed, m/s.
    d1, d2, d3 : float
        Disturbances of airspeed (m/s^2), flight-path angle (rad/s) and pitch rate (rad/s^2).

    Raises
    ------
    TrimError
        If there is none.
    """
    return Trim(*_trim(tuple(map(float, airframe)), float(V), float(d1), float(d2), float(d3)))


@functools.cache
@kept
def _trim(parameters: tuple[float, ...], V: float, d1: float, d2: float, d3: float) -> list[float]:
    from scipy.optimize import root  # takes longer to import than all else here

    airframe = Airframe(*parameters)

    def rates(unknown: NDArray[np.float64]) -> list[float]:
        alpha, elevator, thrust = (float(value) for value in unknown * _SCALE)
        V_dot, _, _, gamma_dot, _, q_dot = longitudinal_rates(
            V, 0.0, alpha, 0.0, thrust, elevator, d1, d2, d3, airframe
        )
        return [V_dot, gamma_dot, q_dot]

    found = root(rates, np.ones(3), tol=1e-12)
    alpha, elevator, thrust = (float(value) for value in found.x * _SCALE)
    if max(abs(rate) for rate in rates(found.x)) > 1e-9 or abs(alpha) > _LARGEST_ALPHA:
        raise TrimError(f"the airframe has no level trim at {V:g} m/s with disturbances {d1:g}, {d2:g}, {d3:g}")
    return [alpha, elevator, thrust]


def steady_climb(airframe: Airframe, V: float, thrust: float) -> float:
    """Climb rate (m/s, negative: sink rate) that ``thrust`` (N) holds at the constant airspeed ``V`` (m/s).

    Solves (2.8), (2.10) and (2.12) with all rates and the pitch rate zero for angle of attack, elevator and path angle.

    Raises
    ------
    TrimError
        If there is none.
    """
    return _steady_climb(tuple(map(float, airframe)), float(V), float(thrust))


@functools.cache
@kept
def _steady_climb(parameters: tuple[float, ...], V: float, thrust: float) -> float:
    from scipy.optimize import root

    airframe = Airframe(*parameters)

    def rates(unknown: NDArray[np.float64]) -> list[float]:
        alpha, elevator, gamma = (float(value) for value in unknown * _SCALE_CLIMB)
        V_dot, _, _, gamma_dot, _, q_dot = longitudinal_rates(
            V, gamma, gamma + alpha, 0.0, thrust, elevator, 0.0, 0.0, 0.0, airframe
        )
        return [V_dot, gamma_dot, q_dot]

    found = root(rates, np.array([1.0, 1.0, 0.0]), tol=1e-12)
    alpha, _, gamma = (float(value) for value in found.x * _SCALE_CLIMB)
    if max(abs(rate) for rate in rates(found.x)) > 1e-9 or abs(alpha) > _LARGEST_ALPHA:
        raise TrimError(f"the airframe has no steady climb at {V:g} m/s with a thrust of {thrust:g} N")
    return float(V * np.sin(gamma))
