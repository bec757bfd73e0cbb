"""Choose the plots of a swarm from the signals that its scheme declares, so that a user's own scheme is shown, too.

A signal is plotted by its role (`ftcc.airside.scheme.Quantity.shown_as`): error, estimate, adapted; a signal with a
bound is an error, too. If an estimate's name is NAME_hat and the plant has a disturbance NAME, the true value is drawn
with it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from ftcc.airside.scheme import Quantity
from ftcc.groundside.dashboard.snapshot import UavState
from ftcc.groundside.dashboard.subject import Subject
from ftcc.link.actuators import unit_of

__all__ = ["Panel", "panels_of"]

Source = Literal["truth", "signals", "command", "acting", "effectiveness", "disturbances"]
Where = tuple[Source, str]

_MOTION = {
    "containment": ("z", "V"),
    "formation": ("z", "V"),
    "attitude": ("mu", "alpha", "beta"),
    "fire": ("V", "z"),
}
"""True states that are plotted, by family."""
_MEANINGS = {
    "z": ("Altitude", "m"),
    "V": ("Airspeed", "m/s"),
    "mu": ("Bank", "rad"),
    "alpha": ("Angle of attack", "rad"),
    "beta": ("Sideslip", "rad"),
}
_ANGLES = ("mu", "alpha", "chi")
"""True states that are recorded modulo a turn, and whose curves are unwrapped."""
_REFERENCES = ("_r", "_ref", "_d", "hat", "_hat", "_id")
"""Suffixes of signals that are references of a state, the one closest to the law first."""
_NO_LIMIT = 2.0 * math.pi
"""Limits of angles from this value mean no limit, rad."""
_LONGEST = 38
"""Longest title that fits half the width, characters."""
_MOST = 6
"""Largest number of panels in a group."""


@dataclass(frozen=True)
class Panel:
    """One plot: a curve per UAV, with bounds, limits and references."""

    path: str
    title: str
    unit: str
    value: Where
    second: Where | None = None
    """Quantity drawn as a thin line beside it."""
    include_leaders: bool = False
    """Whether leaders are drawn, too."""
    bound: float | str | None = None
    """Symmetric bound: a constant, or the name of a signal."""
    limits: tuple[float, float] | None = None
    notes: tuple[str, ...] = ()
    """Hints in the title."""
    band: bool = False
    """Shade the range between the leaders."""
    obstacles: bool = False
    """Draw the top of the obstacle that any UAV is above."""
    angle: bool = False
    """Whether the value is an angle, whose curves are unwrapped."""
    degrees: bool = False
    """Show angles in degrees, as the chapters on attitude control do."""

    @property
    def scale(self) -> float:
        """Return the factor from the recorded to the shown unit."""
        return math.degrees(1.0) if self.degrees and self.unit.startswith("rad") else 1.0

    @property
    def shown_unit(self) -> str:
        """Return the unit on the axis."""
        return self.unit.replace("rad", "deg", 1) if self.degrees else self.unit

    def read(self, where: Where, state: UavState | None) -> float:
        """Return a value of a UAV in the shown unit; nan if it is unknown."""
        if state is None:
            return math.nan
        source, name = where
        return getattr(state, source).get(name, math.nan) * self.scale  # type: ignore[no-any-return]


def panels_of(subject: Subject) -> dict[str, list[Panel]]:
    """Return the panels by group: "Tracking", "Commands", "Estimates", "Adaptation"; empty groups are left out."""
    groups = {
        "Tracking": [*_motion(subject), *_errors(subject)],
        "Commands": _commands(subject),
        "Estimates": [*_estimates(subject), *_effectiveness(subject)],
        "Adaptation": _adaptation(subject),
    }
    degrees = subject.family == "attitude"
    return {name: [replace(panel, degrees=degrees) for panel in panels] for name, panels in groups.items() if panels}


def _motion(subject: Subject) -> list[Panel]:
    names = {signal.name for signal in subject.signals}
    panels = []
    for name in _MOTION[subject.family]:
        meaning, unit = _MEANINGS[name]
        references = [r for suffix in _REFERENCES if (r := f"{name}{suffix}") in names]
        band = name == "z" and subject.family == "containment"
        obstacles = name == "z" and bool(subject.obstacles)
        notes = [
            *(["band: hull"] if band else []),
            *(["gray: obstacles"] if obstacles else []),
            *(["thin: reference"] if references else []),
        ]
        panels.append(
            Panel(
                path=f"/plots/motion/{name}",
                title=meaning,
                unit=unit,
                value=("truth", name),
                second=("signals", references[0]) if references else None,
                include_leaders=True,
                band=band,
                obstacles=obstacles,
                notes=tuple(notes),
                angle=name in _ANGLES,
            )
        )
    return panels


def _errors(subject: Subject) -> list[Panel]:
    found = [s for s in subject.signals if s.bound is not None]
    found += [s for s in subject.signals if s.bound is None and s.shown_as == "error" and s.unit != "-"]
    return [
        Panel(f"/plots/errors/{s.name}", _title(s), s.unit, ("signals", s.name), bound=s.bound) for s in found[:_MOST]
    ]


def _commands(subject: Subject) -> list[Panel]:
    return [
        Panel(
            path=f"/plots/actuators/{name}",
            title=name.capitalize().replace("_", " "),
            unit=unit_of(name),
            value=("acting", name),
            second=("command", name),
            limits=limit if unit_of(name) != "rad" or max(map(abs, limit)) < _NO_LIMIT else None,
            notes=("thin: commanded", "gray: limits"),
        )
        for name, limit in subject.limits.items()
    ]


def _estimates(subject: Subject) -> list[Panel]:
    disturbances = dict(subject.disturbances)
    panels = []
    for signal in subject.signals:
        if signal.shown_as != "estimate":
            continue
        stem = signal.name.removesuffix("_hat")
        true: Where | None = ("disturbances", stem) if stem in disturbances and stem != signal.name else None
        panels.append(
            Panel(
                path=f"/plots/estimates/{signal.name}",
                title=_title(signal),
                unit=signal.unit,
                value=("signals", signal.name),
                second=true,
                notes=("thin: true",) if true else (),
            )
        )
    return panels[:_MOST]


def _effectiveness(subject: Subject) -> list[Panel]:
    return [
        Panel(
            path=f"/plots/effectiveness/{name}",
            title=f"True effectiveness of the {name.replace('_', ' ')}",
            unit="-",
            value=("effectiveness", name),
        )
        for name, limit in subject.limits.items()
    ]


def _adaptation(subject: Subject) -> list[Panel]:
    adapted = [s for s in subject.signals if s.shown_as == "adapted"]
    return [Panel(f"/plots/adaptation/{s.name}", _title(s), s.unit, ("signals", s.name)) for s in adapted[:8]]


def _title(signal: Quantity) -> str:
    if not signal.meaning:
        return signal.name
    title = f"{signal.meaning[0].upper()}{signal.meaning[1:]} {signal.name}"
    if len(title) > _LONGEST:
        # The text after a comma names the component, as the symbol does.
        title = f"{title.partition(',')[0].removesuffix(signal.name).strip()} {signal.name}"
    return title


def uavs_of(panel: Panel, subject: Subject) -> Sequence[int]:
    """Return the UAVs whose curves a panel shows."""
    return sorted(subject.graph.uavs) if panel.include_leaders else subject.followers
