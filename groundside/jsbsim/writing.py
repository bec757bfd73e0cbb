"""Write an airframe sheet as a JSBSim aircraft, from the templates beside this file."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ftcc.groundside.errors import UserError
from ftcc.groundside.jsbsim.actuators import Actuator, actuators_of
from ftcc.groundside.jsbsim.terms import AXES, SLUGS_TO_POUNDS, coefficients
from ftcc.groundside.schema import AirframeSheet, PointMassSheet, record_of
from ftcc.link.actuators import ACTUATORS, unit_of
from ftcc.link.airframe import Airframe, parameters
from ftcc.sim.jsbsim.units import FOOT, POUND, SLUG
from ftcc.sim.trim import TrimError, trim

__all__ = ["AircraftError", "can_fly_level", "write_aircraft"]

_TEMPLATES = Path(__file__).parent / "aircraft"
_RADIUS = 1e10
"""Of the planet, m: its surface is 20 um below the plane after 600 m, and altitudes are exact to a micrometre."""
_ALTITUDE = 1000.0
"""At the start, m."""


class AircraftError(UserError):
    """A sheet, a name or a folder that cannot be used; nothing has been written."""


def write_aircraft(
    sheet: AirframeSheet | PointMassSheet,
    name: str,
    folder: Path,
    *,
    actuators: Mapping[str, Actuator] | None = None,
    airspeeds: Sequence[float] = (),
) -> list[Path]:
    """Write ``folder``/``name``/``name``.xml, its planet and a README, and level flight at each of ``airspeeds``.

    Parameters
    ----------
    sheet : AirframeSheet
        A point mass has no moments, and is refused.
    name : str
        Of the aircraft: letters, digits, ``_``, ``.`` and single ``-``.
    folder : Path
        The folder of aircraft. In it ``name`` must not exist, or be an empty folder.
    actuators : mapping, optional
        By the names of ``ftcc.link.actuators.ACTUATORS``; default: no lag, travel of 30 deg, see `actuators_of`.
    airspeeds : sequence of float
        Of level flights to begin with, m/s.

    Returns
    -------
    list of Path
        The files: the aircraft first.

    Raises
    ------
    AircraftError
        If that cannot be; what is in the folder stays as it is.
    """
    if not isinstance(sheet, AirframeSheet):
        raise AircraftError(f"{name}: is a point mass; JSBSim flies aircraft with moments, inertia and surfaces")
    if not re.fullmatch(r"\w[\w.]*(-[\w.]+)*", name, flags=re.ASCII):
        raise AircraftError(f"{name}: must be a name of letters, digits, _, . and single -, such as reference_25kg")
    airframe, moved = record_of(sheet, Airframe), dict(actuators or actuators_of(None, sheet.T_max))
    words = _words(sheet, airframe, name, moved)
    try:
        levels = {f"{V:g}": _level(airframe, sheet.T_max, V, moved) for V in airspeeds}
    except TrimError as error:
        raise AircraftError(f"{name}: {error}") from None
    files = {f"{name}.xml": "aircraft.xml.jinja", "flat_earth.xml": "planet.xml.jinja", "README.md": "README.md.jinja"}
    texts = {file: _filled(template, words | {"levels": levels}) for file, template in files.items()}
    for V, level in levels.items():
        for kind in ("level", "fly"):
            texts[f"{kind}_{V}.xml"] = _filled(f"{kind}.xml.jinja", words | {"V": V, "level": level})
    place = folder / name
    try:
        if place.exists() and (not place.is_dir() or any(place.iterdir())):
            raise AircraftError(f"{place}: exists and is not an empty folder; what is in it stays as it is")
        place.mkdir(parents=True, exist_ok=True)
        for file, text in texts.items():
            (place / file).write_text(text, encoding="utf-8")
    except OSError as error:
        raise AircraftError(f"{place}: cannot be written: {error.strerror or error}") from None
    return [place / file for file in texts]


def can_fly_level(sheet: AirframeSheet, actuators: Mapping[str, Actuator], V: float) -> bool:
    """Whether there is level flight at ``V`` (m/s) within the travel of these actuators."""
    try:
        _level(record_of(sheet, Airframe), sheet.T_max, V, actuators)
    except TrimError:
        return False
    return True


def _words(sheet: AirframeSheet, airframe: Airframe, name: str, actuators: Mapping[str, Actuator]) -> dict[str, Any]:
    """What the templates say; all numbers that JSBSim reads are in its own units, as exact as a float is.

    Its table of units is rounded: 1 slug ft^2 is 1.35594 kg m^2 there, which is wrong by 0.9e-4, and 1 N is 0.22482 lb.
    """
    inertia = SLUG * FOOT * FOOT
    pounds = airframe.m / SLUG * SLUGS_TO_POUNDS
    about = parameters(Airframe)
    coefficients()
    return {
        "name": name,
        "title": sheet.title or name,
        "a": airframe,
        "T_max": sheet.T_max,
        "axes": AXES,
        "about": about,
        "inertia": {key: repr(getattr(airframe, key) / inertia) for key in about if key.startswith("I")},
        "weight": repr(pounds),
        "area": repr(airframe.S / FOOT**2),
        "span": repr(airframe.b / FOOT),
        "chord": repr(airframe.c / FOOT),
        "density": repr(airframe.rho / (SLUG / FOOT**3)),
        "radius": repr(_RADIUS / FOOT),
        "radius_m": _RADIUS,
        "GM": repr(airframe.g * _RADIUS * _RADIUS / FOOT**3),
        "newton": repr(1.0 / POUND),
        "channels": [_channel(one, actuators[one], sheet.T_max) for one in ACTUATORS],
        "actuators": actuators,
        "inf": math.inf,
    }


def _channel(name: str, moved: Actuator, full_thrust: float) -> dict[str, Any]:
    """From the command to what acts, of one actuator."""
    if name == "thrust":
        about = {"property": "fcs/thrust-n", "command": "throttle-cmd-norm", "gain": full_thrust, "outputs": ()}
    else:
        shown = f"fcs/{'right-aileron' if name == 'aileron' else name}-pos-rad"
        about = {
            "property": f"fcs/{name}-deflection-rad",
            "command": f"{name}-cmd-norm",
            "gain": moved.travel,
            "outputs": (shown,),
        }
    return {"name": name, "actuator": moved, "unit": unit_of(name), "manner": _manner(name, moved), **about}


def _manner(name: str, moved: Actuator) -> str:
    """In words, how an actuator moves."""
    unit = unit_of(name)
    travel = f"travel {moved.lowest:g} to {moved.highest:g} {unit}"
    if unit == "rad":
        travel += f" ({math.degrees(moved.lowest):.4g} to {math.degrees(moved.highest):.4g} deg)"
    lag = f"lag {moved.lag:g} rad/s" if moved.lag > 0.0 else "no lag"
    return f"{travel}, {lag}, " + (f"at most {moved.rate:g} {unit}/s" if moved.rate < math.inf else "no rate limit")


def _level(airframe: Airframe, full_thrust: float, V: float, actuators: Mapping[str, Actuator]) -> dict[str, Any]:
    """Level flight at ``V`` (m/s): the state at the start and the commands, as fractions."""
    steady = trim(airframe, V)
    for actuator, wanted, unit in (("elevator", steady.elevator, "rad"), ("thrust", steady.thrust, "N")):
        lowest, highest = actuators[actuator].lowest, actuators[actuator].highest
        if not lowest <= wanted <= highest:
            raise TrimError(
                f"level flight at {V:g} m/s needs {actuator} {wanted:.4g} {unit}, and its travel is "
                f"{lowest:.4g} to {highest:.4g} {unit}"
            )
    return {
        "airspeed": repr(V / FOOT),
        "altitude": repr(_ALTITUDE / FOOT),
        "altitude_m": _ALTITUDE,
        "alpha": repr(math.degrees(steady.alpha)),
        "elevator": repr(steady.elevator / actuators["elevator"].travel),
        "throttle": repr(steady.thrust / full_thrust),
        "steady": steady,
    }


def _filled(template: str, words: Mapping[str, Any]) -> str:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATES),
        undefined=jinja2.StrictUndefined,
        autoescape=template.endswith(".xml.jinja"),
        keep_trailing_newline=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(words)
