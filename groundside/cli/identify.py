"""The command ``ftcc identify``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ftcc.groundside.cli.common import fail, terminal

if TYPE_CHECKING:
    from rich.table import Table

    from ftcc.groundside.jsbsim import Identified, Scale

__all__ = ["identify"]


def identify(
    aircraft: Annotated[str, typer.Argument(help="An aircraft of the package jsbsim, or its XML file.")],
    airspeed: Annotated[float, typer.Option(help="Airspeed of the level flight around which it is fitted, m/s.")],
    altitude: Annotated[float, typer.Option(help="Its altitude above mean sea level, m.")] = 1000.0,
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="Write the airframe sheet into this file.")] = None,
    plot: Annotated[Path | None, typer.Option(metavar="FILE", help="Draw fit and responses into this file.")] = None,
    gains: Annotated[
        str | None, typer.Option(metavar="SCHEME", help="Print the gains of this scheme, scaled for the aircraft.")
    ] = None,
    form: Annotated[str, typer.Option(help="Form of the scheme whose gains are scaled.")] = "flight",
) -> None:
    """Fit our airframe to an aircraft of JSBSim: the nominal model with which the laws fly it."""
    from ftcc.airside.schemes import find
    from ftcc.groundside.jsbsim import draw_fit, identify, scale_of, sheet_text
    from ftcc.sim.jsbsim.aircraft import Aircraft, JsbsimError
    from ftcc.sim.trim import TrimError

    if not (math.isfinite(airspeed) and airspeed > 0.0):
        fail(f"--airspeed {airspeed:g}: must be a positive number of m/s")
    if not math.isfinite(altitude):
        fail(f"--altitude {altitude:g}: must be a number of m")
    try:
        scheme = find(gains) if gains is not None else None
    except LookupError as error:
        fail(f"--gains {gains}: {error.args[0]}")
    if scheme is not None and form not in scheme.forms:
        fail(f"--form {form}: scheme {scheme.name} has no such form; it has {', '.join(scheme.forms)}")
    try:
        found = identify(Aircraft(aircraft), airspeed, altitude)
    except (JsbsimError, TrimError) as error:
        fail(str(error))
    shown = terminal()
    shown.print(f"{found.aircraft.title} of JSBSim at {airspeed:g} m/s and {altitude:g} m", highlight=False)
    for table in (_fits(found), _levels(found), _modes(found), _controls(found)):
        shown.print()
        shown.print(table)
    if scheme is not None:
        shown.print()
        _print_gains(scheme.name, form, scale_of(found.airframe, airspeed))
    try:
        if out is not None:
            out.write_text(sheet_text(found), encoding="utf-8")
        if plot is not None:
            draw_fit(found, plot)
    except (OSError, ValueError) as error:
        fail(f"cannot be written: {error}")
    for file in (out, plot):
        if file is not None:
            terminal(stderr=True).print(f"wrote {file}", highlight=False, soft_wrap=True)


def _table(*headings: str) -> Table:
    from rich.table import Table

    made = Table(header_style="bold", box=None, pad_edge=False)
    made.add_column(headings[0])
    for heading in headings[1:]:
        made.add_column(heading, justify="right")
    return made


def _fits(found: Identified) -> Table:
    table = _table("fit", "R²", "largest error", "of")
    for name, fit in found.fits.items():
        error, size = abs(fit.measured - fit.fitted).max(), abs(fit.measured).max()
        table.add_row(name, f"{fit.determination:.4f}", f"{error:.4f}", f"{size:.4f}")
    return table


def _levels(found: Identified) -> Table:
    """Level flight of JSBSim's aircraft, and of the sheet."""
    from ftcc.sim.trim import trim

    level = trim(found.airframe, found.V)
    table = _table(
        "level flight", "alpha, deg", "elevator, deg", "thrust, N", "bank, deg", "aileron, deg", "rudder, deg"
    )
    own = found.steady
    table.add_row(
        "JSBSim",
        *(f"{math.degrees(value):.3f}" for value in (own.alpha, own.elevator)),
        f"{own.thrust:.1f}",
        *(f"{math.degrees(value):.3f}" for value in (own.mu, own.aileron, own.rudder)),
    )
    alpha, elevator = math.degrees(level.alpha), math.degrees(level.elevator)
    table.add_row("fitted", f"{alpha:.3f}", f"{elevator:.3f}", f"{level.thrust:.1f}", "0", "0", "0")
    return table


def _modes(found: Identified) -> Table:
    from ftcc.groundside.cli.airframe import shown_mode
    from ftcc.sim.jsbsim.linear import linear_modes
    from ftcc.sim.linear_modes import modes

    table = _table("mode", "JSBSim", "fitted")
    ours = modes(found.airframe, found.V)
    theirs = linear_modes(found.aircraft, found.controls, found.V, found.altitude)
    for name in dict.fromkeys(mode.name for mode in (*theirs, *ours)):
        table.add_row(
            name, *("; ".join(shown_mode(mode) for mode in modes if mode.name == name) for modes in (theirs, ours))
        )
    return table


def _controls(found: Identified) -> Table:
    table = _table("actuator", "least", "most", "")
    for name in ("aileron", "elevator", "rudder", "thrust"):
        control, unit = getattr(found.controls, name), "N" if name == "thrust" else "deg"
        if name in found.controls.missing:
            table.add_row(name, "none", "none", "")
            continue
        ends = (control.least, control.most) if name == "thrust" else map(math.degrees, (control.least, control.most))
        table.add_row(name, *(f"{value:.1f}" for value in ends), unit)
    return table


def _print_gains(scheme: str, form: str, scale: Scale) -> None:
    from ftcc.airside.schemes import find
    from ftcc.groundside.jsbsim import scaled_gains

    changed, unknown = scaled_gains(find(scheme), form, scale)
    print(f"# {scheme}, form {form}: times x {scale.time:.3g}, speeds x {scale.speed:.3g}, lengths x the product")
    if unknown:
        print(f"# not scaled, for want of a unit that the rule knows: {', '.join(unknown)}")
    print("[gains]")
    for name, value in changed.items():
        print(f"{name} = {float(f'{value:.4g}')!r}")
