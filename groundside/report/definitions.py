"""Define the figures of a scheme: sheets of figures as data, and default figures for a scheme without a sheet.

A sheet, ``figures/SCHEME.toml``, lists the figures of the monograph's chapter with their quantities and the values that
the monograph reads off them, so that a run can be compared with it.
"""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Self

from pydantic import Field, ValidationError, model_validator

from ftcc.groundside.errors import UserError
from ftcc.groundside.schema import Id, Strict
from ftcc.link.actuators import unit_of

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission

__all__ = ["Figure", "Panel", "Reading", "Sheet", "main_panels", "plain_sheet", "read_sheet", "sheet_of"]

_FOLDER = Path(__file__).parent / "figures"

_TURNS = {"rad": 2.0 * math.pi, "deg": 360.0}
Uavs = list[Id] | Literal["followers", "leaders", "all"]


class Panel(Strict):
    """One pair of axes: an expression over the recording's columns, a curve per UAV."""

    y: str
    label: str
    unit: str = Field("", description="of y")
    x: str = "t"
    x_label: str = "t"
    x_unit: str = "s"
    uavs: Uavs = "followers"
    pairs: list[tuple[Id, Id]] | None = Field(None, description="draw y of the first minus y of the second instead")
    bound: str | None = Field(None, description="expression; drawn dashed at plus and minus its value")
    true: str | None = Field(None, description="expression of the true value that y estimates; drawn thin and dark")
    reference: str | None = Field(None, description="expression of the reference of y; drawn thin in the same colour")
    limits: str | None = Field(None, description="actuator whose limits are drawn")
    window: tuple[float, float] | None = Field(None, description="s; a detail, beside the others")
    equal: bool = Field(False, description="both axes to the same scale")
    unwrap: bool = Field(False, description="draw y, an angle, without jumps by a turn; unit rad or deg")
    shared: bool = Field(False, description="y is the same for all UAVs: one curve, of the first")
    surroundings: Literal["obstacles", "fire"] | None = Field(
        None, description='"obstacles" where x is the forward position and y the altitude; "fire" on a map, north up'
    )

    @property
    def turn(self) -> float | None:
        """Return a whole turn in the unit of y if y is unwrapped; else None."""
        return _TURNS[self.unit] if self.unwrap else None

    @model_validator(mode="after")
    def _turns(self) -> Self:
        if self.unwrap and self.unit not in _TURNS:
            raise ValueError(f"unwrap: unit = {self.unit!r} is not that of an angle, {' or '.join(_TURNS)}")
        return self


class Reading(Strict):
    """Values that the monograph reads off a figure, compared with the extremes of an expression in a window."""

    what: str
    y: str
    uavs: Uavs = "followers"
    pairs: list[tuple[Id, Id]] | None = None
    window: tuple[float, float] | None = Field(None, description="s; default: the whole flight")
    unit: str = ""
    monograph: tuple[float, float] = Field(description="lowest and highest value")
    kind: Literal["extremes", "within", "lowest", "highest"] = Field(
        "extremes",
        description='"extremes": both values are reached; "within": an axis or a bound that holds all; "lowest" and '
        '"highest": the lowest or highest value lies between the two',
    )
    remark: str = Field("", description="a known difference, and its cause")

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.monograph[0] > self.monograph[1]:
            raise ValueError(f"monograph = {list(self.monograph)}: the lower value first")
        return self


class Figure(Strict):
    """A figure: panels in a column, and below them details side by side."""

    name: str = Field(pattern=r"^[a-z0-9_]+$", description="name of its files")
    title: str
    number: str = Field("", description="in the monograph")
    panels: list[Panel] = Field(min_length=1)
    columns: int = Field(1, ge=1, le=3, description="columns of the panels that are no details")
    readings: list[Reading] = []


class Sheet(Strict):
    """The figures of a scheme."""

    source: str = Field("", description="chapter of the monograph")
    scenarios: list[str] = Field([], description="names of the scenarios that reproduce the monograph")
    figures: list[Figure] = Field(min_length=1)
    summary: list[Panel] = Field([], max_length=2, description="the picture at the top; default: see `main_panels`")
    notes: list[str] = Field([], description="parts of the monograph that are not drawn or cannot be compared, and why")


def main_panels(sheet: Sheet) -> list[Panel]:
    """Return what a flight of the scheme is about: the sheet's summary, or the first panels of its first figures."""
    return sheet.summary or [figure.panels[0] for figure in sheet.figures[:2]]


def read_sheet(path: Path) -> Sheet:
    """Read a sheet.

    Raises
    ------
    UserError
        With the file, the field and the value.
    """
    try:
        return Sheet.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except tomllib.TOMLDecodeError as error:
        raise UserError(f"{path}: not valid TOML: {error}") from None
    except ValidationError as error:
        wrong = "\n".join(f"  {'.'.join(map(str, e['loc']))} = {e['input']!r}: {e['msg']}" for e in error.errors())
        raise UserError(f"{path}:\n{wrong}") from None


def sheet_of(mission: Mission) -> Sheet:
    """Return the sheet of a mission's scheme: the bundled one, or a default one."""
    path = _FOLDER / f"{mission.scheme.name}.toml"
    return read_sheet(path) if path.is_file() else plain_sheet(mission)


_PLANES = {
    "longitudinal": (("z", "altitude", "m"), ("V", "airspeed", "m/s"), ("gamma", "flight-path angle", "rad")),
    "attitude": (("mu", "bank", "rad"), ("alpha", "angle of attack", "rad"), ("beta", "sideslip", "rad")),
    "position": (("x", "north", "m"), ("y", "east", "m"), ("z", "altitude", "m"), ("V", "airspeed", "m/s")),
}
"""States in the default motion figure, by plant."""


def plain_sheet(mission: Mission) -> Sheet:
    """Return default figures from a scheme's signals: motion, errors with bounds, commands with limits, estimates."""
    motion = [
        Panel(y=name, label=meaning, unit=unit, uavs="all", unwrap=unit == "rad")
        for name, meaning, unit in _PLANES[mission.scheme.plant]
    ]
    figures = [Figure(name="motion", title="Motion", panels=motion)]
    errors, estimates = [], []
    for signal in mission.signals:
        panel = Panel(y=signal.name, label=signal.meaning or signal.name, unit=signal.unit)
        if signal.bound is not None:
            errors.append(panel.model_copy(update={"bound": str(signal.bound)}))
        elif signal.shown_as == "error":
            errors.append(panel)
        elif signal.name.endswith("_hat"):
            estimates.append(panel)
    for name, title, panels in (("errors", "Errors", errors), ("estimates", "Estimates", estimates)):
        if panels:
            figures.append(Figure(name=name, title=title, panels=panels))
    commands = [
        Panel(y=f"{name}_command", label=f"{name} command", unit=unit_of(name), limits=name)
        for name in mission.scheme.commands
    ]
    figures.append(Figure(name="commands", title="Commands", panels=commands))
    return Sheet(figures=figures)
