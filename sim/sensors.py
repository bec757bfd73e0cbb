"""What a vehicle reports: measurement noise and the state as MAVLink carries it."""

from __future__ import annotations

import math

import numpy as np

from ftcc.link.compiled import compiled, copy
from ftcc.link.philox import NOISE, gaussian_pair, philox
from ftcc.link.rotation import body_attitude
from ftcc.sim.plant import ALPHA, BETA, CHI, GAMMA, MU, TRUTH, P, Q, R, V, X, Y, Z

__all__ = ["add_noise", "encode_state"]

_CHANNELS = len(TRUTH)


@compiled
def add_noise(true, deviation, seed, uav, tick, out):
    """``true`` (order of `TRUTH`) with white noise of the given standard deviations, drawn for this tick.

    Returns whether there is any.
    """
    copy(true, out)
    noisy = False
    for i in range(_CHANNELS):
        noisy = noisy or deviation[i] > 0.0
    if not noisy:
        return False
    for pair in range((_CHANNELS + 1) // 2):
        u, v, _, _ = philox(seed, tick & 0xFFFFFFFF, uav, NOISE, pair)
        first, second = gaussian_pair(u, v)
        out[2 * pair] += deviation[2 * pair] * first
        if 2 * pair + 1 < _CHANNELS:
            out[2 * pair + 1] += deviation[2 * pair + 1] * second
    return True


@compiled
def encode_state(measured, out):
    """Turn ``measured`` (order of `TRUTH`) into the fields of ``wire.STATE``, rounded to float32 as on the wire.

    Attitude as `body_attitude` has it; north-east-down.
    """
    cos_gamma = math.cos(measured[GAMMA])
    out[0], out[1], out[2], out[3] = body_attitude(
        measured[CHI], measured[GAMMA], measured[MU], measured[ALPHA], measured[BETA]
    )
    out[4], out[5], out[6] = measured[P], measured[Q], measured[R]
    out[7], out[8], out[9] = measured[X], measured[Y], -measured[Z]
    out[10] = measured[V] * cos_gamma * math.cos(measured[CHI])
    out[11] = measured[V] * cos_gamma * math.sin(measured[CHI])
    out[12] = -measured[V] * math.sin(measured[GAMMA])
    for i in range(13):
        out[i] = float(np.float32(out[i]))
