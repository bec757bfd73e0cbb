"""The vocabulary of all plants: the truth vector, the guards of a model, and why a vehicle is lost.

The equations of motion are modules of `plants`; `cycle` integrates them.
"""

from __future__ import annotations

from typing import NamedTuple

from ftcc.link.compiled import compiled

__all__ = ["DIVERGED", "LOST", "TRUTH", "UNITS", "Guards", "beyond"]

UNITS = {
    "x": "m", "y": "m", "z": "m", "V": "m/s",
    "gamma": "rad", "chi": "rad", "mu": "rad", "alpha": "rad", "beta": "rad", "theta": "rad",
    "p": "rad/s", "q": "rad/s", "r": "rad/s",
}  # fmt: skip
"""Channels of the truth vector and their units, in its order; altitude z is up."""

TRUTH = tuple(UNITS)

X, Y, Z, V, GAMMA, CHI, MU, ALPHA, BETA, THETA, P, Q, R = range(len(TRUTH))

DIVERGED = 5
"""Key of `LOST`: a command, state or shared value of the law is not finite."""

AIRSPEED, CLIMB, INCIDENCE, NUMBER, SIDESLIP, MODEL = 1, 2, 3, 4, 6, 7
"""Keys of `LOST` that a plant's ``lost`` returns."""

LOST = {
    0: "",
    AIRSPEED: "airspeed outside the model's valid range",
    CLIMB: "flight-path angle outside the model's valid range",
    INCIDENCE: "angle of attack outside the model's valid range",
    NUMBER: "state is not a number",
    DIVERGED: "control law gave a number that is not finite",
    SIDESLIP: "sideslip outside the model's valid range",
    MODEL: "JSBSim can fly it no further",
}
"""Why a vehicle ended, by code."""


class Guards(NamedTuple):
    """Columns of ``Fleet.guards``: beyond these a vehicle is lost."""

    least_airspeed: float
    """m/s."""
    flight_path_angle: float
    """rad."""
    angle_of_attack: float
    """rad."""
    sideslip: float
    """rad."""


@compiled
def beyond(speed, flight_path_angle, angle_of_attack, sideslip, guards):
    """Which of the guards an aircraft is beyond, a key of `LOST`; 0: none. Speed in m/s, angles in rad."""
    if guards.least_airspeed > speed:
        return AIRSPEED
    if abs(flight_path_angle) > guards.flight_path_angle:
        return CLIMB
    if abs(angle_of_attack) > guards.angle_of_attack:
        return INCIDENCE
    if abs(sideslip) > guards.sideslip:
        return SIDESLIP
    return 0
