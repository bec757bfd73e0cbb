"""Disturbances of a vehicle by channel: constant or oscillating, with an onset and an end; and the gust of (9.33)."""

from __future__ import annotations

import math
from typing import NamedTuple

from ftcc.link.compiled import compiled, fields, fill
from ftcc.link.philox import GUST, gaussian_pair, philox
from ftcc.sim.faults import onset

__all__ = ["CALM", "Disturbance", "Gust", "disturb", "disturbances_are_steady", "gust"]


class Disturbance(NamedTuple):
    """Columns of ``Fleet.disturbances``."""

    time: float
    """s."""
    channel: float
    """Index into the plant's ``DISTURBANCES``."""
    value: float
    """Constant value, or amplitude, in the channel's unit."""
    onset: float
    """Rate of the exponential onset, 1/s; 0 = step."""
    until: float = math.inf
    """When it ends, as a step, s."""
    frequency: float = 0.0
    """Of value * sin(frequency * (t - time) + phase), rad/s; 0 = constant."""
    phase: float = 0.0
    """rad."""


class Gust(NamedTuple):
    """The gust of (9.33) along the track: a normal number, drawn anew each period and held, each vehicle its own."""

    deviation: float = 0.0
    """m/s."""
    period_us: int = 100_000
    """For which a number is held, us."""
    seed: int = 0


CALM = Gust()
"""No gust."""


@compiled
def disturb(fleet, i, time, out):
    """Write the disturbances of vehicle ``i`` at ``time`` (s) into ``out`` (d,), summed by channel."""
    fill(out, 0.0)
    for n in range(fleet.disturbances.shape[1]):
        one = fields(Disturbance, fleet.disturbances[i, n])
        since = time - one.time
        if since >= 0.0 and time < one.until:
            swing = math.sin(one.frequency * since + one.phase) if one.frequency > 0.0 else 1.0
            out[int(one.channel)] += one.value * onset(since, one.onset) * swing


@compiled
def disturbances_are_steady(fleet, i, begin, end):
    """Whether `disturb` writes the same from ``begin`` to ``end`` (s): none begins, grows, oscillates or ends."""
    for n in range(fleet.disturbances.shape[1]):
        one = fields(Disturbance, fleet.disturbances[i, n])
        if one.time > end or one.until <= begin:
            continue
        if one.time > begin or one.until <= end or one.frequency > 0.0 or onset(begin - one.time, one.onset) < 1.0:
            return False
    return True


@compiled
def gust(fleet, i, time):
    """Gust (m/s) on vehicle ``i`` at ``time`` (s), eq. (9.33)."""
    if fleet.gust_deviation[i] == 0.0:
        return 0.0
    draw = int(time * 1e6) // fleet.gust_period_us[i]
    u, v, _, _ = philox(fleet.gust_seed[i], draw & 0xFFFFFFFF, fleet.uav[i], GUST, 0)
    first, _ = gaussian_pair(u, v)
    return fleet.gust_deviation[i] * first
