"""The parameters of an aircraft: name, unit, meaning and range, one line each. Everything else derives its list here.

The true aircraft is an `Airframe` (`ftcc.sim.airframe`), what a law knows of it are the same fields and its limits
(`ftcc.airside.model.Model`), and a sheet gives them by name. Only the list stands once: truth and nominal model have
different values, and each has equations of its own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple, TypeVar, get_type_hints

__all__ = ["Airframe", "Parameter", "PointMass", "parameters", "with_inherited_fields"]

Record = TypeVar("Record")


@dataclass(frozen=True)
class Parameter:
    """Unit, meaning and range of a parameter; used as annotation."""

    unit: str
    meaning: str
    above: float = -math.inf
    """The value must be larger than this."""
    least: float = -math.inf
    """The value must be at least this."""


P = Parameter


class Airframe(NamedTuple):
    """A fixed-wing aircraft in the names of (2.1)-(2.7); SI units, rad. Body axes: forward, right, down.

    Moments are made non-dimensional with span and chord, rates with b p/(2V), c q/(2V) and b r/(2V).
    """

    m: Annotated[float, P("kg", "mass", above=0.0)]
    S: Annotated[float, P("m^2", "wing area", above=0.0)]
    c: Annotated[float, P("m", "mean aerodynamic chord", above=0.0)]
    b: Annotated[float, P("m", "span", above=0.0)]
    rho: Annotated[float, P("kg/m^3", "air density", above=0.0)]
    g: Annotated[float, P("m/s^2", "gravity", above=0.0)]
    Ix: Annotated[float, P("kg m^2", "roll moment of inertia", above=0.0)]
    Iy: Annotated[float, P("kg m^2", "pitch moment of inertia", above=0.0)]
    Iz: Annotated[float, P("kg m^2", "yaw moment of inertia", above=0.0)]
    Ixz: Annotated[float, P("kg m^2", "product of inertia")]
    CD0: Annotated[float, P("-", "drag at alpha = 0", least=0.0)]
    CDa: Annotated[float, P("1/rad", "drag by angle of attack")]
    CDa2: Annotated[float, P("1/rad^2", "drag by its square")]
    CL0: Annotated[float, P("-", "lift at alpha = 0")]
    CLa: Annotated[float, P("1/rad", "lift by angle of attack", above=0.0)]
    CLde: Annotated[float, P("1/rad", "lift by elevator")]
    Cm0: Annotated[float, P("-", "pitching moment at alpha = 0")]
    Cma: Annotated[float, P("1/rad", "pitching moment by angle of attack")]
    Cmde: Annotated[float, P("1/rad", "pitching moment by elevator")]
    Cmq: Annotated[float, P("-", "pitching moment by pitch rate")]
    CY0: Annotated[float, P("-", "side force at beta = 0")]
    CYb: Annotated[float, P("1/rad", "side force by sideslip")]
    Cl0: Annotated[float, P("-", "rolling moment at beta = 0")]
    Clb: Annotated[float, P("1/rad", "rolling moment by sideslip")]
    Clda: Annotated[float, P("1/rad", "rolling moment by aileron")]
    Cldr: Annotated[float, P("1/rad", "rolling moment by rudder")]
    Clp: Annotated[float, P("-", "rolling moment by roll rate")]
    Clr: Annotated[float, P("-", "rolling moment by yaw rate")]
    Cn0: Annotated[float, P("-", "yawing moment at beta = 0")]
    Cnb: Annotated[float, P("1/rad", "yawing moment by sideslip")]
    Cnda: Annotated[float, P("1/rad", "yawing moment by aileron")]
    Cndr: Annotated[float, P("1/rad", "yawing moment by rudder")]
    Cnp: Annotated[float, P("-", "yawing moment by roll rate")]
    Cnr: Annotated[float, P("-", "yawing moment by yaw rate")]


class PointMass(NamedTuple):
    """An aircraft as a point, in the names of (9.32); SI units."""

    m: Annotated[float, P("kg", "mass", above=0.0)]
    g: Annotated[float, P("m/s^2", "gravity", above=0.0)]
    rho: Annotated[float, P("kg/m^3", "air density", above=0.0)]
    S: Annotated[float, P("m^2", "wing area", above=0.0)]
    CD0: Annotated[float, P("-", "drag without lift", least=0.0)]
    kn: Annotated[float, P("-", "load-factor effectiveness", least=0.0)]
    kd: Annotated[float, P("-", "induced drag", least=0.0)]


def parameters(record: Any) -> dict[str, Parameter]:
    """The `Parameter` of each field of a NamedTuple class, by name, in its order; fields without one are left out."""
    found = {}
    for name, hint in get_type_hints(record, include_extras=True).items():
        for note in getattr(hint, "__metadata__", ()):
            if isinstance(note, Parameter):
                found[name] = note
    return found


def with_inherited_fields(record: type[Record]) -> type[Record]:
    """Class decorator: a NamedTuple of the fields that ``record`` inherits from one, then of its own.

    A class that inherits from a NamedTuple gets no new fields by itself; type checkers read the decorated class as it
    is written.
    """
    new: Any = NamedTuple
    # The hints of a class begin with those that it inherits.
    made = new(record.__name__, list(get_type_hints(record, include_extras=True).items()))
    made.__doc__, made.__module__ = record.__doc__, record.__module__
    return made  # type: ignore[no-any-return]
