"""Model of the actuators' lag, and its compensation (not in the monograph)."""

from __future__ import annotations

import math

from ftcc.airside.elements.filters import low_pass_step
from ftcc.link.compiled import compiled

__all__ = ["lead_filter", "leading_command", "modelled_position", "modelled_stroke"]


@compiled
def modelled_position(position, in_force, lag, h):
    """Position of a first-order actuator of bandwidth ``lag`` (rad/s) after ``h`` seconds of the command in force."""
    return in_force + (position - in_force) * math.exp(-lag * h)


@compiled
def modelled_stroke(position, in_force, time_constant, h):
    """Mean position of a first-order actuator over ``h`` seconds of the command in force, and its position after them.

    A time constant of 0 s is an actuator without lag.
    """
    if time_constant <= 0.0:
        return in_force, in_force
    after = low_pass_step(position, in_force, time_constant, h)
    return in_force + (position - after) * time_constant / h, after


@compiled
def leading_command(position, wanted, lag, target_lag):
    """The command that moves an actuator of bandwidth ``lag`` to ``wanted`` as one of bandwidth ``target_lag``."""
    return position + (target_lag / lag) * (wanted - position)


@compiled
def lead_filter(value, target, slow, fast):
    """Lead (slow s + 1)/(fast s + 1) on ``target``, both time constants in s, for slow != fast.

    Returns
    -------
    output, value' : float
    """
    rate = (target - value) / fast
    return value + slow * rate, rate
