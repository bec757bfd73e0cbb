"""Gains for an aircraft of other size and speed: those for the reference airframe, scaled by their units.

The rule: time in units of the aircraft's own pitching, 1 / sqrt(-Cma qbar S c / Iy), speed in units of its airspeed,
length in units of both, and mass in units of its mass. A gain in 1/s therefore shrinks as the aircraft gets slower in
pitch, one in m/s grows with its speed, and one without a unit stays.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from ftcc.airside.scheme import Scheme, quantities
from ftcc.link.airframe import Airframe
from ftcc.sim.inner_loop import pace_of

__all__ = ["Scale", "scale_of", "scaled_gains"]

_DESIGN_SPEED = 30.0
"""For which the gains of all schemes were designed, on the reference airframe, m/s."""
_DESIGN_MASS = 25.0
"""Of the reference airframe, kg."""
_POWERS = {"m": (1.0, 0.0, 0.0), "s": (0.0, 1.0, 0.0), "rad": (0.0, 0.0, 0.0), "N": (1.0, -2.0, 1.0)}
"""Powers of length, time and mass in each unit."""
_FACTOR = re.compile(r"([A-Za-z]+)(?:\^(\d+)|\^\((\d+)/(\d+)\))?$")
"""A unit with a power, such as s^2 or s^(1/2)."""


class Scale(NamedTuple):
    """How an aircraft compares with the reference airframe at its design speed."""

    time: float
    """Its pitching takes this many times as long."""
    speed: float
    """It flies this many times as fast."""
    mass: float
    """It is this many times as heavy."""

    def factor(self, unit: str) -> float | None:
        """Return the factor of a quantity in this unit; None for a unit that the rule does not know."""
        factor = 1.0
        # A power may hold a slash of its own.
        for n, part in enumerate(re.split(r"/(?![^(]*\))", unit)):
            for word in part.split():
                power = _power(word)
                if power is None:
                    return None
                length, time, mass = power
                one = (self.speed * self.time) ** length * self.time**time * self.mass**mass
                factor *= one if n == 0 else 1.0 / one
        return factor


def _power(word: str) -> tuple[float, float, float] | None:
    """Return the powers of length, time and mass in a unit with its exponent; None if the rule does not know it."""
    if word in ("1", "-"):
        return 0.0, 0.0, 0.0
    found = _FACTOR.match(word)
    if found is None or found[1] not in _POWERS:
        return None
    exponent = float(found[2]) if found[2] else float(found[3]) / float(found[4]) if found[3] else 1.0
    length, time, mass = _POWERS[found[1]]
    return exponent * length, exponent * time, exponent * mass


def scale_of(airframe: Airframe, V: float) -> Scale:
    """Return the scale of an aircraft that flies at ``V`` (m/s)."""
    return Scale(1.0 / float(pace_of(V, airframe)), V / _DESIGN_SPEED, airframe.m / _DESIGN_MASS)


def scaled_gains(scheme: Scheme, form: str, scale: Scale) -> tuple[dict[str, float], list[str]]:
    """Return the gains of a form that the rule changes, and the names of those whose unit it does not know.

    Altitudes at which estimates start are left to the scenario.
    """
    own, notes = scheme.gains(form, {}), quantities(scheme.gains_type)
    changed, unknown = {}, []
    for name, value in own._asdict().items():
        note = notes[name]
        factor = scale.factor(note.unit)
        if factor is None:
            unknown.append(name)
        elif factor != 1.0 and value != 0.0 and not note.follows:
            changed[name] = value * factor
    return changed, unknown
