"""A UAV's own attitude: commands of bank, angle of attack and sideslip through the second-order filter (7.65)."""

from __future__ import annotations

from typing import NamedTuple

from ftcc.link.compiled import compiled, fields

__all__ = ["Command", "Filter", "Reference", "refer", "stand"]


class Reference(NamedTuple):
    """Attitude with respect to the velocity, X1d = (mu, alpha, beta), and its rate."""

    mu: float
    """Bank, rad."""
    alpha: float
    """Angle of attack, rad."""
    beta: float
    """Sideslip, rad."""
    mu_dot: float
    """rad/s."""
    alpha_dot: float
    """rad/s."""
    beta_dot: float
    """rad/s."""


class Filter(NamedTuple):
    """Parameters of the filter, the same for the three axes."""

    frequency: float
    """Natural frequency, rad/s."""
    damping: float
    step_us: float
    """Integration step, us; divides the control period."""


class Command(NamedTuple):
    """From ``at`` (s) on, until the next one: go to this attitude (rad)."""

    at: float
    mu: float
    alpha: float
    beta: float


@compiled
def refer(parameters, commands, reference, now_us, period_us):
    """Filter the command in force, X1d'' = w^2 (X1c - X1d) - 2 zeta w X1d' (7.65), in semi-implicit Euler steps.

    The latest row among those whose time has come is in force: the last one may overrule the others.
    """
    if now_us == 0:
        return
    a = fields(Filter, parameters)
    step_us = int(a.step_us)
    h = a.step_us / 1e6
    for begin in range(now_us - period_us, now_us, step_us):
        latest = 0
        for n in range(commands.shape[0]):
            if commands[n, 0] <= begin / 1e6:
                latest = n
        for axis in range(3):
            error = commands[latest, 1 + axis] - reference[axis]
            reference[3 + axis] += h * a.frequency * (a.frequency * error - 2.0 * a.damping * reference[3 + axis])
            reference[axis] += h * reference[3 + axis]


@compiled
def stand(reference, period_us):
    """Hold: keep the attitude; the commands wait."""
    for axis in range(3):
        reference[3 + axis] = 0.0
    return True
