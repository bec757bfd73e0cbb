"""Conditions on gains that several schemes share, as findings of their checks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ftcc.airside.scheme import Flight, Problem

__all__ = ["above_leaders_climb", "bounds_errors", "largest_degree", "stable_in_steps", "weighted"]


def largest_degree(flight: Flight) -> float:
    """Largest sum of a follower's in-weights."""
    graph = flight.graph
    return max(sum(graph.weights.get((i, j), 0.0) for j in graph.uavs) for i in graph.followers)


def weighted(name: str, degree: float) -> str:
    """The name of a gain whose rate counts with the weights of the graph."""
    return f"{name}, times {degree:g}, the largest sum of weights with which a UAV hears"


def stable_in_steps(rates: Mapping[str, float], step: float) -> list[Problem]:
    """No rate (1/s, by the gain that sets it) may reach 2/step: explicit Euler steps of ``step`` seconds."""
    return [
        Problem(
            True,
            f"gain {name}: its rate {rate:.0f} 1/s is unstable in Euler steps of {step * 1e3:g} ms: "
            f"needs more than {rate / 2.0:.0f} steps a second (control rate times substeps)",
        )
        for name, rate in rates.items()
        if rate * step >= 2.0
    ]


def bounds_errors(gains: Any, flight: Flight, steepest: float, lost: float) -> list[Problem]:
    """Conditions on the bound of the synchronization errors of chapters 7 and 8, and on where these start.

    ``steepest`` is the largest gain phi / (k eps_inf) of the outer loop (1/rad) that was flown with success, ``lost``
    the least with which control was lost.
    """
    problems = []
    if gains.eps0 < gains.eps_inf:
        problems.append(Problem(True, f"gain eps0 = {gains.eps0:g} rad: must be at least eps_inf = {gains.eps_inf:g}"))
    phi = gains.lambda1 + gains.lambda2 * largest_degree(flight)
    steepness = phi * (1.0 / gains.k_lo + 1.0 / gains.k_up) / (2.0 * gains.eps_inf)
    if steepness > steepest:
        problems.append(
            Problem(
                False,
                f"phi / (k eps_inf) = {steepness:.1f} 1/rad with the graph's weights: control is held up to "
                f"{steepest:g}, lost from {lost:g} on; widen eps_inf or lower lambda1, lambda2",
            )
        )
    return problems + _starts_within_bound(gains, flight)


def _starts_within_bound(gains: Any, flight: Flight) -> list[Problem]:
    """Warn of UAVs whose synchronization error E = lambda1 e + lambda2 sum_j a_ij (e - e_j) starts beyond its bound."""
    problems = []
    low, high = -gains.k_lo * gains.eps0, gains.k_up * gains.eps0
    for i, own in flight.initial_errors.items():
        weights = {j: flight.graph.weights[i, j] for j in flight.graph.senders(i) if j in flight.initial_errors}
        for n, axis in enumerate(("bank", "angle of attack", "sideslip")):
            disagreement = sum(weight * (own[n] - flight.initial_errors[j][n]) for j, weight in weights.items())
            error = gains.lambda1 * own[n] + gains.lambda2 * disagreement
            if not low < error < high:
                problems.append(
                    Problem(
                        False,
                        f"UAV {i} starts with a synchronization error of {error:.3g} rad in {axis}: outside of the "
                        f"bound at the start, {low:.3g} .. {high:.3g} rad, within which alone the law is proved",
                    )
                )
    return problems


def above_leaders_climb(gains: Any, name: str, flight: Flight, source: str) -> list[Problem]:
    """A gain in m/s must exceed the leaders' largest climb rate."""
    value = getattr(gains, name)
    if value > flight.leader_climb:
        return []
    return [
        Problem(
            True,
            f"gain {name} = {value:g} m/s: must exceed the leaders' largest climb rate, "
            f"{flight.leader_climb:.3f} m/s ({source})",
        )
    ]
