"""Measurement noise, and the measured state as MAVLink carries it."""

from __future__ import annotations

import math

from ftcc.link.actuators import as_sent
from ftcc.link.compiled import compiled, copy, store
from ftcc.link.messages import StateMessage
from ftcc.link.philox import NOISE, gaussian_pair, philox
from ftcc.link.rotation import body_attitude
from ftcc.sim.plant import ALPHA, BETA, CHI, GAMMA, MU, TRUTH, P, Q, R, V, X, Y, Z

__all__ = ["add_noise", "encode_state"]

_CHANNELS = len(TRUTH)


@compiled
def add_noise(true, deviation, seed, uav, tick, out):
    """Write ``true`` (13,), in the order of `TRUTH`, with white noise drawn for this tick into ``out`` (13,).

    ``deviation`` (13,) holds the standard deviations. Returns whether there is any noise.
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
    """Write ``measured`` (13,), in the order of `TRUTH`, as a `StateMessage` into ``out`` (13,), rounded to float32.

    The attitude is that of `body_attitude`; position and velocity are north, east, down.
    """
    cos_gamma = math.cos(measured[GAMMA])
    q1, q2, q3, q4 = body_attitude(measured[CHI], measured[GAMMA], measured[MU], measured[ALPHA], measured[BETA])
    message = StateMessage(
        q1=q1,
        q2=q2,
        q3=q3,
        q4=q4,
        rollspeed=measured[P],
        pitchspeed=measured[Q],
        yawspeed=measured[R],
        x=measured[X],
        y=measured[Y],
        z=-measured[Z],
        vx=measured[V] * cos_gamma * math.cos(measured[CHI]),
        vy=measured[V] * cos_gamma * math.sin(measured[CHI]),
        vz=-measured[V] * math.sin(measured[GAMMA]),
    )
    store(message, out)
    as_sent(out)
