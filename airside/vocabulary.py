"""Quantities that several schemes name alike: those of three axes, the errors of attitude, longitudinal motion."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ftcc.airside.scheme import Quantity

__all__ = [
    "ACCELERATED_MOTION",
    "ALTITUDE_MOTION",
    "ATTITUDE_TRACKING",
    "ELEVATOR_WANTED",
    "LONGITUDINAL_DISTURBANCES",
    "PLANE_MOTION",
    "THRUST_WANTED",
    "angles",
    "body_rates",
    "space",
    "surfaces",
]

Q = Quantity


def _each(
    axes: Sequence[tuple[str, str]], name: str, unit: str, meaning: str, bound: float | str | None, rate_of: str = ""
) -> tuple[Quantity, ...]:
    return tuple(
        Q(name.format(symbol), unit, meaning.format(axis), bound=bound, rate_of=rate_of.format(symbol))
        for symbol, axis in axes
    )


def angles(
    name: str, unit: str, meaning: str, bound: float | str | None = None, rate_of: str = ""
) -> tuple[Quantity, ...]:
    """A quantity of each angle of attitude; {} in its name stands for the symbol, in its meaning for the word."""
    axes = (("mu", "bank"), ("alpha", "angle of attack"), ("beta", "sideslip"))
    return _each(axes, name, unit, meaning, bound, rate_of)


def body_rates(name: str, unit: str, meaning: str, bound: float | str | None = None) -> tuple[Quantity, ...]:
    """As `angles`, for the three body rates."""
    return _each((("p", "roll"), ("q", "pitch"), ("r", "yaw")), name, unit, meaning, bound)


def surfaces(name: str, unit: str, meaning: str, bound: float | str | None = None) -> tuple[Quantity, ...]:
    """As `angles`, for the three surfaces."""
    return _each([(word, word) for word in ("aileron", "elevator", "rudder")], name, unit, meaning, bound)


def space(
    name: str, unit: str, meaning: str = "", bound: float | str | None = None, rate_of: str = ""
) -> tuple[Quantity, ...]:
    """As `angles`, for the three directions of space."""
    return _each((("x", "north"), ("y", "east"), ("z", "up")), name, unit, meaning, bound, rate_of)


ATTITUDE_TRACKING = (
    Q("wrapped(mu - mu_d)", "rad", "bank off its reference", bound=math.radians(3.0)),
    Q("alpha - alpha_d", "rad", "angle of attack off its reference", bound=math.radians(3.0)),
    Q("beta - beta_d", "rad", "sideslip off its reference", bound=math.radians(3.0)),
)
"""Errors that a law of attitude must make small, with the size that counts as small."""

ALTITUDE_MOTION = (Q("z", "m", "altitude"), Q("z_dot", "m/s", "climb rate", rate_of="z"))
"""Altitude as a leader shares it."""
PLANE_MOTION = (
    Q("x", "m", "forward position"),
    Q("x_dot", "m/s", "forward speed", rate_of="x"),
    *ALTITUDE_MOTION,
)
"""Motion in the vertical plane as a leader shares it."""
ACCELERATED_MOTION = (
    Q("V", "m/s", "airspeed"),
    Q("V_dot", "m/s^2", "acceleration; a follower's is modelled", rate_of="V"),
    *ALTITUDE_MOTION,
)
"""Speed and altitude as neighbours share them."""
LONGITUDINAL_DISTURBANCES = (
    Q("d1_hat", "m/s^2", "estimated disturbance of the airspeed"),
    Q("d2_hat", "rad/s", "estimated disturbance of the flight path"),
    Q("lumped_hat", "rad/s^2", "estimated effect of fault and disturbance on the pitch rate"),
)
"""Estimates of the disturbance observers of speed, flight path and pitch rate."""
THRUST_WANTED = Q("thrust_wanted", "N", "thrust command before saturation")
ELEVATOR_WANTED = Q("elevator_wanted", "rad", "elevator command before saturation")
