"""Compensation of the actuators' lag (not in the monograph)."""

from __future__ import annotations

import math

from ftcc.link.compiled import compiled

__all__ = ["lead_filter", "leading_command", "modelled_position"]


@compiled
def modelled_position(position, in_force, lag, h):  # type: ignore[no-untyped-def]
    """Position of a first-order actuator of bandwidth ``lag`` (rad/s) after ``h`` seconds of the command in force."""
    return in_force + (position - in_force) * math.exp(-lag * h)


@compiled
def leading_command(position, wanted, lag, target_lag):  # type: ignore[no-untyped-def]
    """The command that moves an actuator of bandwidth ``lag`` to ``wanted`` as one of bandwidth ``target_lag``."""
    return position + (target_lag / lag) * (wanted - position)


@compiled
def lead_filter(value, target, slow, fast):  # type: ignore[no-untyped-def]
    """Lead (slow s + 1)/(fast s + 1) on ``target``, both time constants in s, for slow != fast.

    Returns
    -------
    output, value' : float
    """
    rate = (target - value) / fast
    return value + slow * rate, rate
