"""Prescribed performance: a tube that an error must not leave, and an error transform whose walls are at infinity."""

from __future__ import annotations

import math

from ftcc.airside.elements.nonlinear import clip
from ftcc.link.compiled import compiled

__all__ = ["EDGE", "bounded_transform", "bounded_transforms", "performance_transform", "performance_tube"]

EDGE = 0.98
"""The transform sees at most this share of the tube: beyond it, up to and outside of the wall, it stays finite."""


@compiled
def performance_tube(t, first, last, decay):
    """Half-width (first - last) exp(-decay t) + last of the tube ``t`` seconds after its start; its rate. (3.25)"""
    excess = (first - last) * math.exp(-decay * t)
    return excess + last, -decay * excess


@compiled
def performance_transform(error, error_rate, width, width_rate, lower, upper):
    """Transformed error of a tube -lower width < error < upper width, eqs. (3.26)-(3.29), with its guard `EDGE`.

    Returns
    -------
    share, transformed, slope, slope_rate : float
        The share of the tube in use (as guarded), the transformed error E = 0.5 ln((lower upper + upper share) /
        (lower upper - lower share)), xi = dE/d(error) and its rate.
    """
    share = clip(error / width, -EDGE * lower, EDGE * upper)
    transformed = 0.5 * math.log((lower * upper + upper * share) / (lower * upper - lower * share))
    slope = (lower + upper) / (2.0 * width * (lower + share) * (upper - share))
    share_rate = (error_rate - share * width_rate) / width
    slope_rate = slope * (-width_rate / width - share_rate / (lower + share) + share_rate / (upper - share))
    return share, transformed, slope, slope_rate


@compiled
def bounded_transform(error, width, lower, upper, edge, continued):
    """Transformed error and its slope, eqs. (7.20), (8.16)-(8.17), guarded beyond the share ``edge`` of the tube.

    There the slope is that at the guard. With ``continued`` = 1 the transformed error goes on along it, else it stays.

    Returns
    -------
    transformed, slope : float
        xi and eta = d(xi)/d(error) of chapter 7; E and eta of chapter 8.
    """
    wanted = error / width
    share = clip(wanted, -edge * lower, edge * upper)
    transformed = 0.5 * math.log((lower * upper + upper * share) / (lower * upper - lower * share))
    slope = (1.0 / (lower + share) + 1.0 / (upper - share)) / (2.0 * width)
    return transformed + continued * (wanted - share) * width * slope, slope


@compiled
def bounded_transforms(errors, width, lower, upper, edge, continued):
    """`bounded_transform` of three axes in one tube: the three transformed errors, the three slopes."""
    first, first_slope = bounded_transform(errors[0], width, lower, upper, edge, continued)
    second, second_slope = bounded_transform(errors[1], width, lower, upper, edge, continued)
    third, third_slope = bounded_transform(errors[2], width, lower, upper, edge, continued)
    return (first, second, third), (first_slope, second_slope, third_slope)
