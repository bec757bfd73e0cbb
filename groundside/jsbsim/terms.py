"""An airframe in the names of JSBSim: its sizes, and which coefficient makes which force or moment, (2.6) and (2.7)."""

from __future__ import annotations

import math
from typing import NamedTuple

from ftcc.link.airframe import Airframe, parameters
from ftcc.sim.jsbsim.units import FOOT, SLUG

__all__ = ["AXES", "SIZES", "SLUGS_TO_POUNDS", "Axis", "coefficients"]

SLUGS_TO_POUNDS = 32.174049
"""By which JSBSim makes the mass of a weight."""

SIZES = {
    "m": ("inertia/mass-slugs", SLUG),
    "g": ("accelerations/gravity-ft_sec2", FOOT),
    "rho": ("atmosphere/rho-slugs_ft3", SLUG / FOOT**3),
    "S": ("metrics/Sw-sqft", FOOT**2),
    "c": ("metrics/cbarw-ft", FOOT),
    "b": ("metrics/bw-ft", FOOT),
    "Ix": ("inertia/ixx-slugs_ft2", SLUG * FOOT**2),
    "Iy": ("inertia/iyy-slugs_ft2", SLUG * FOOT**2),
    "Iz": ("inertia/izz-slugs_ft2", SLUG * FOOT**2),
    "Ixz": ("inertia/ixz-slugs_ft2", SLUG * FOOT**2),
}
"""Where JSBSim tells the sizes of an aircraft, and its unit there; the sign of Ixz depends on the aircraft's file."""
_ALPHA, _BETA = "aero/alpha-rad", "aero/beta-rad"
_AILERON, _ELEVATOR, _RUDDER = (f"fcs/{name}-deflection-rad" for name in ("aileron", "elevator", "rudder"))
_ROLL = ("aero/bi2vel", "velocities/p-aero-rad_sec")
_PITCH = ("aero/ci2vel", "velocities/q-aero-rad_sec")
_YAW = ("aero/bi2vel", "velocities/r-aero-rad_sec")
_SPAN, _CHORD = ("metrics/bw-ft",), ("metrics/cbarw-ft",)


class Axis(NamedTuple):
    """A force along a wind axis, or a moment about a body axis."""

    name: str
    """As JSBSim calls it."""
    meaning: str
    length: tuple[str, ...]
    """What makes a moment of it: span or chord; nothing for a force."""
    terms: dict[str, tuple[str, ...]]
    """By coefficient, the properties by which it is multiplied."""


AXES = (
    Axis("DRAG", "against the airspeed", (), {"CD0": (), "CDa": (_ALPHA,), "CDa2": (_ALPHA, _ALPHA)}),
    Axis("SIDE", "to the right, across the airspeed", (), {"CY0": (), "CYb": (_BETA,)}),
    Axis("LIFT", "up, across the airspeed", (), {"CL0": (), "CLa": (_ALPHA,), "CLde": (_ELEVATOR,)}),
    Axis(
        "ROLL",
        "right wing down",
        _SPAN,
        {"Cl0": (), "Clb": (_BETA,), "Clda": (_AILERON,), "Cldr": (_RUDDER,), "Clp": _ROLL, "Clr": _YAW},
    ),
    Axis("PITCH", "nose up", _CHORD, {"Cm0": (), "Cma": (_ALPHA,), "Cmde": (_ELEVATOR,), "Cmq": _PITCH}),
    Axis(
        "YAW",
        "nose right",
        _SPAN,
        {"Cn0": (), "Cnb": (_BETA,), "Cnda": (_AILERON,), "Cndr": (_RUDDER,), "Cnp": _ROLL, "Cnr": _YAW},
    ),
)


def coefficients() -> tuple[str, ...]:
    """Names of the aerodynamic coefficients that `AXES` uses, each once.

    Raises
    ------
    TypeError
        If `Airframe` has another one: its term would be missing in the aircraft.
    """
    used = tuple(name for axis in AXES for name in axis.terms)
    missing = [name for name in parameters(Airframe) if name.startswith("C") and name not in used]
    if missing or not math.isclose(len(set(used)), len(used)):
        raise TypeError(f"ftcc.groundside.jsbsim.terms: no term for {', '.join(missing)}")
    return used
