"""Counter-based random numbers: the same key gives the same draw, in any order, in plain Python and compiled.

Philox4x32-10 (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC11). Only the low 64 bits of products
are used and everything is masked, so that Python's integers and numba's wrapping int64 agree.
"""

from __future__ import annotations

import math

from ftcc.link.compiled import compiled

__all__ = ["ATTACK", "CHANNEL", "DOOR", "GUST", "NOISE", "TURBULENCE", "gaussian_pair", "philox", "uniform"]

CHANNEL = 1
NOISE = 2
GUST = 3
TURBULENCE = 4
DOOR = 5
ATTACK = 6

_MASK = 0xFFFFFFFF


@compiled
def philox(seed: int, a: int, b: int, c: int, d: int):
    """Four 32-bit integers for the 64-bit key ``seed`` and the counter ``(a, b, c, d)`` of 32-bit integers."""
    # Numbers from arrays would warn of the overflow that is meant here.
    seed, a, b, c, d = int(seed), int(a), int(b), int(c), int(d)
    k0 = seed & _MASK
    k1 = (seed >> 32) & _MASK
    for _ in range(10):
        p0 = 0xD2511F53 * a
        p1 = 0xCD9E8D57 * c
        a, b, c, d = (
            ((p1 >> 32) & _MASK) ^ b ^ k0,
            p1 & _MASK,
            ((p0 >> 32) & _MASK) ^ d ^ k1,
            p0 & _MASK,
        )
        k0 = (k0 + 0x9E3779B9) & _MASK
        k1 = (k1 + 0xBB67AE85) & _MASK
    return a, b, c, d


@compiled
def uniform(word: int) -> float:
    """A 32-bit integer as a number in (0, 1)."""
    return (word + 0.5) / 4294967296.0


@compiled
def gaussian_pair(u: int, v: int):
    """Two independent standard normal numbers from two 32-bit integers (Box and Muller)."""
    radius = math.sqrt(-2.0 * math.log(uniform(u)))
    angle = 2.0 * math.pi * uniform(v)
    return radius * math.cos(angle), radius * math.sin(angle)
