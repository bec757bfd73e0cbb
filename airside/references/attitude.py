"""A UAV's own attitude: commands of bank, angle of attack and sideslip through the second-order filter (7.65)."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.flight_path import Own, decode_state
from ftcc.link.actuators import ACTUATORS
from ftcc.link.compiled import compiled, fields
from ftcc.link.mavlink import dialect
from ftcc.link.messages import StateMessage

__all__ = ["Command", "Filter", "Reference", "command_from_ground", "refer", "stand"]


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


_RATE = Reference._fields.index("mu_dot")


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
            rate = reference[_RATE + axis]
            rate += h * a.frequency * (a.frequency * error - 2.0 * a.damping * rate)
            reference[_RATE + axis] = rate
            reference[axis] += h * rate


@compiled
def stand(reference, period_us):
    """Hold: keep the attitude; the commands wait."""
    for axis in range(3):
        reference[_RATE + axis] = 0.0
    return True


_BANK, _ALPHA, _BETA = 1.05, (-0.15, 0.26), 0.26
"""Targets that are taken, rad: a bank of 60 deg, an angle of attack short of the stall, 15 deg of sideslip (chosen)."""
_UNIT = 0.01
"""By how much the length of a quaternion may differ from 1."""


_RATES = (
    dialect.ATTITUDE_TARGET_TYPEMASK_BODY_ROLL_RATE_IGNORE,
    dialect.ATTITUDE_TARGET_TYPEMASK_BODY_PITCH_RATE_IGNORE,
    dialect.ATTITUDE_TARGET_TYPEMASK_BODY_YAW_RATE_IGNORE,
)


def command_from_ground(message: Any, own: NDArray[np.float64], now_us: int) -> tuple[Command | None, str]:
    """What a SET_ATTITUDE_TARGET asks for, by the flight path of ``own``; or None and why it is refused.

    Its thrust is ignored: the laws leave thrust alone, and no client can leave it out. Rates are refused: the filter
    makes them.
    """
    if message.type_mask & dialect.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE:
        return None, "attitude target: without an attitude"
    rates = zip(_RATES, (message.body_roll_rate, message.body_pitch_rate, message.body_yaw_rate), strict=True)
    if any(not message.type_mask & ignored and rate != 0.0 and not math.isnan(rate) for ignored, rate in rates):
        return None, "attitude target: asks for rates, too"
    q = [float(value) for value in message.q]
    length = math.sqrt(sum(value * value for value in q))
    if not abs(length - 1.0) < _UNIT:  # also where it is not a number
        return None, "attitude target: no unit quaternion"
    path = Own(*own.tolist())
    state = dict.fromkeys(StateMessage._fields, 0.0)
    state |= zip(("q1", "q2", "q3", "q4"), (value / length for value in q), strict=True)
    state["vx"] = math.cos(path.gamma) * math.cos(path.chi)
    state["vy"] = math.cos(path.gamma) * math.sin(path.chi)
    state["vz"] = -math.sin(path.gamma)
    seen = np.zeros(len(Own._fields))
    decode_state(np.array(list(state.values())), 0.0, np.zeros(len(ACTUATORS)), seen)
    wanted = Own(*seen.tolist())
    if abs(wanted.mu) > _BANK or not _ALPHA[0] <= wanted.alpha <= _ALPHA[1] or abs(wanted.beta) > _BETA:
        shown = [round(math.degrees(angle)) for angle in (wanted.mu, wanted.alpha, wanted.beta)]
        return None, "target {}, {}, {} deg: outside the envelope".format(*shown)
    return Command(now_us / 1e6, wanted.mu, wanted.alpha, wanted.beta), ""
