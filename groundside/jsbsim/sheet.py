"""An identified aircraft as an airframe sheet, with what each number is."""

from __future__ import annotations

from collections.abc import Iterator

from ftcc.groundside.jsbsim.identification import Identified
from ftcc.link.airframe import Airframe, parameters

__all__ = ["sheet_text"]

_DIGITS = 6


def sheet_text(found: Identified) -> str:
    """Return the airframe sheet of an identified aircraft, as TOML."""
    return "\n".join(_lines(found)) + "\n"


def _lines(found: Identified) -> Iterator[str]:
    aircraft = found.aircraft.title
    yield f"# {aircraft} of JSBSim as our laws know it: fitted to what accelerates it around level flight, by"
    yield f"# ftcc identify {found.aircraft.name} --airspeed {found.V:g} --altitude {found.altitude:g}"
    yield "# JSBSim flies its own equations, tables, engine and flight controls; this is the nominal model alone."
    yield "# Signs as in reference_25kg: a positive deflection gives a negative moment about its own axis."
    yield ""
    yield f'title = "{aircraft} of JSBSim at {found.V:g} m/s"'
    yield ""
    notes = parameters(Airframe)
    for name, value in found.airframe._asdict().items():
        yield _line(name, value, f"{notes[name].unit}, {notes[name].meaning}")
    yield _line("T_max", found.controls.thrust.most, "N, full throttle at that airspeed and altitude")


def _line(name: str, value: float, meaning: str) -> str:
    number = f"{float(f'{value:.{_DIGITS}g}')!r}"
    return f"{name:6} = {number:16} # {meaning}"
