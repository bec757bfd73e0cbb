"""The command ``ftcc airframe``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ftcc.groundside.cli.common import fail, terminal

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rich.table import Table

    from ftcc.groundside.schema import AirframeSheet
    from ftcc.sim.jsbsim.steady import Steady
    from ftcc.sim.linear_modes import Mode
    from ftcc.sim.trim import Trim

__all__ = ["airframe", "shown_mode"]

_SPEEDS = (18.0, 22.0, 25.0, 30.0, 35.0)
"""m/s, where nobody gives others."""
_OF_JSBSIM = "jsbsim:"
"""How the name of an aircraft of JSBSim begins."""
_COLUMNS_TO_CHOOSE = 6
"""More airspeeds than this do not fit side by side."""


def airframe(
    name: Annotated[
        str,
        typer.Argument(
            metavar="[NAME]",
            help="Name of a bundled airframe, or a TOML file; jsbsim:NAME or jsbsim:FILE: an aircraft of JSBSim.",
        ),
    ] = "reference_25kg",
    airspeed: Annotated[
        list[float] | None, typer.Option(help="Airspeed, m/s; can be repeated; default: 18, 22, 25, 30 and 35.")
    ] = None,
    coefficient: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=FACTOR", help="Multiply an aerodynamic coefficient, or all (all=FACTOR); can be repeated."
        ),
    ] = None,
    altitude: Annotated[float, typer.Option(help="Altitude of an aircraft of JSBSim, m.")] = 1000.0,
    plot: Annotated[Path | None, typer.Option(metavar="FILE", help="Draw the poles into this file.")] = None,
    jsbsim: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write it as an aircraft for JSBSim into this folder.")
    ] = None,
    actuators: Annotated[
        str | None,
        typer.Option(
            metavar="SCENARIO",
            help="Whose actuators the JSBSim aircraft has; default: no lag, surfaces +-30 deg, thrust 0 to T_max.",
        ),
    ] = None,
) -> None:
    """Show level trim and linear modes of an airframe, with thrust and surfaces fixed; write it for JSBSim."""
    from ftcc.groundside.scenario import load_airframe
    from ftcc.groundside.schema import AirframeSheet, record_of
    from ftcc.sim.airframe import Airframe, scaled
    from ftcc.sim.linear_modes import modes
    from ftcc.sim.trim import TrimError, trim

    speeds = airspeed or [*_SPEEDS]
    for V in speeds:
        if not (math.isfinite(V) and V > 0.0):
            fail(f"--airspeed {V:g}: must be a positive number of m/s")
    if len(speeds) > _COLUMNS_TO_CHOOSE:
        fail(f"--airspeed: {len(speeds)} values; at most {_COLUMNS_TO_CHOOSE} fit side by side")
    if actuators is not None and jsbsim is None:
        fail("--actuators: is for the aircraft that --jsbsim DIR writes")
    if name.startswith(_OF_JSBSIM):
        if coefficient or jsbsim is not None:
            fail("--coefficient, --jsbsim: are for our airframes; JSBSim's aircraft have files of their own")
        _show(*_of_jsbsim(name.removeprefix(_OF_JSBSIM), speeds, altitude), plot)
        return
    sheet = load_airframe(name, Path("NAME"))
    if not isinstance(sheet, AirframeSheet):
        fail(f"airframe = {name!r}: is a point mass; it has no attitude to trim and no linear modes")
    aircraft = record_of(sheet, Airframe)
    try:
        aircraft = scaled(aircraft, _factors(coefficient or []))
    except ValueError as error:
        fail(f"--coefficient {error}")
    try:
        levels = {V: trim(aircraft, V) for V in speeds}
    except TrimError as error:
        fail(f"--airspeed: {error}")
    found = {V: modes(aircraft, V) for V in speeds}
    _show(sheet.title or name, levels, found, plot)
    if jsbsim is not None:
        scaled_sheet = sheet.model_copy(update=aircraft._asdict())
        _write(scaled_sheet, Path(name).stem if Path(name).suffix else name, jsbsim, actuators, airspeed)


def _show(title: str, levels: Mapping[float, Trim | Steady], found: dict[float, list[Mode]], plot: Path | None) -> None:
    """Print trims and modes by airspeed, and draw the modes."""
    out = terminal()
    out.print(title, highlight=False)
    out.print()
    out.print(_trims(levels))
    out.print()
    out.print(_modes(found))
    if plot is not None:
        try:
            _draw(found, title, plot)
        except (OSError, ValueError) as error:
            fail(f"--plot {plot}: cannot be written: {error}")
        terminal(stderr=True).print(f"wrote {plot}", highlight=False, soft_wrap=True)


def _of_jsbsim(
    name: str, speeds: list[float], altitude: float
) -> tuple[str, dict[float, Steady], dict[float, list[Mode]]]:
    """Return title, level flights and modes of an aircraft of JSBSim."""
    from ftcc.sim.jsbsim.aircraft import Aircraft, JsbsimError
    from ftcc.sim.jsbsim.controls import controls_of
    from ftcc.sim.jsbsim.linear import linear_modes
    from ftcc.sim.jsbsim.steady import steady_flight
    from ftcc.sim.trim import TrimError

    if not math.isfinite(altitude):
        fail(f"--altitude {altitude:g}: must be a number of m")
    aircraft = Aircraft(name)
    try:
        controls = {V: controls_of(aircraft, V, altitude) for V in speeds}
        levels = {V: steady_flight(aircraft, controls[V], V, altitude) for V in speeds}
        found = {V: linear_modes(aircraft, controls[V], V, altitude) for V in speeds}
    except (JsbsimError, TrimError) as error:
        fail(str(error))
    return f"{aircraft.title} of JSBSim at {altitude:g} m", levels, found


def _write(sheet: AirframeSheet, name: str, folder: Path, scenario: str | None, airspeeds: list[float] | None) -> None:
    """Write the JSBSim aircraft, with level flight at ``airspeeds``, or where its travel allows it."""
    from ftcc.groundside.jsbsim import actuators_of, can_fly_level, write_aircraft
    from ftcc.groundside.scenario import load

    moved = actuators_of(None if scenario is None else load(scenario).plan, sheet.T_max)
    speeds = airspeeds or [V for V in _SPEEDS if can_fly_level(sheet, moved, V)]
    files = write_aircraft(sheet, name, folder, actuators=moved, airspeeds=speeds)
    out = terminal(stderr=True)
    of = "no lag, surfaces +-30 deg, thrust 0 to T_max" if scenario is None else f"those of {scenario}"
    out.print(
        f"wrote {files[0]} and {len(files) - 1} files beside it; actuators: {of}",
        markup=False,
        highlight=False,
        soft_wrap=True,
    )


def _factors(given: list[str]) -> dict[str, float]:
    factors = {}
    for one in given:
        name, equals, text = one.partition("=")
        try:
            value = float(text) if equals else math.nan
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            fail(f"--coefficient {one}: must be NAME=FACTOR, such as all=1.2 or CLde=1")
        factors[name.strip()] = value
    return factors


def _table(heading: str) -> Table:
    from rich.table import Table

    made = Table(header_style="bold", box=None, pad_edge=False)
    made.add_column(heading)
    return made


def _trims(levels: Mapping[float, Trim | Steady]) -> Table:
    """A row per airspeed."""
    table = _table("V, m/s")
    for heading in ("alpha, rad", "deg", "elevator, rad", "deg", "thrust, N"):
        table.add_column(heading, justify="right")
    for V, level in levels.items():
        table.add_row(
            f"{V:g}",
            f"{level.alpha:.6f}",
            f"{math.degrees(level.alpha):.3f}",
            f"{level.elevator:.6f}",
            f"{math.degrees(level.elevator):.3f}",
            f"{level.thrust:.3f}",
        )
    return table


def _modes(found: dict[float, list[Mode]]) -> Table:
    """A row per mode, a column per airspeed."""
    table = _table("mode")
    for V in found:
        table.add_column(f"{V:g} m/s", justify="right")
    for name in dict.fromkeys(mode.name for modes in found.values() for mode in modes):
        cells = [[shown_mode(mode) for mode in modes if mode.name == name] for modes in found.values()]
        alike = [mode for modes in found.values() for mode in modes if mode.name == name]
        unit = "wn rad/s, zeta" if all(mode.oscillates for mode in alike) else "1/s"
        table.add_row(f"{name} {unit}", *("; ".join(cell) for cell in cells))
    return table


def shown_mode(mode: Mode) -> str:
    """Return frequency (rad/s) and damping of a mode, or its real eigenvalue (1/s)."""
    return f"{mode.frequency:.3f}, {mode.damping:.3f}" if mode.oscillates else f"{mode.eigenvalue.real:+.4f}"


def _draw(found: dict[float, list[Mode]], title: str, file: Path) -> None:
    """Poles in the complex plane, and those near the origin once more."""
    from ftcc.groundside.canvas import plt

    figure, axes = plt.subplots(1, 2, figsize=(11.0, 4.5), layout="constrained")
    markers = {"short period": "o", "phugoid": "s", "roll": "D", "Dutch roll": "^", "spiral": "v", "roll-spiral": "*"}
    for shade, modes in enumerate(found.values()):
        for mode in modes:
            for root in {mode.eigenvalue, mode.eigenvalue.conjugate()}:
                for axis in axes:
                    axis.plot(root.real, root.imag, markers[mode.name], color=f"C{shade}", fillstyle="none")
    for name in dict.fromkeys(mode.name for modes in found.values() for mode in modes):
        axes[0].plot([], [], markers[name], color="gray", fillstyle="none", label=name)
    for shade, V in enumerate(found):
        axes[1].plot([], [], "-", color=f"C{shade}", label=f"{V:g} m/s")
    slow = max(abs(mode.eigenvalue) for modes in found.values() for mode in modes if mode.name in ("phugoid", "spiral"))
    axes[1].set(xlim=(-1.3 * slow, 1.3 * slow), ylim=(-1.3 * slow, 1.3 * slow), title="near the origin")
    axes[0].set(title=f"poles of {title}")
    for axis in axes:
        axis.axvline(0.0, color="gray", linewidth=0.8)
        axis.set(xlabel="real part, 1/s", ylabel="imaginary part, rad/s")
        axis.grid(alpha=0.3)
        axis.legend()
    figure.savefig(file, dpi=150)
    plt.close(figure)
