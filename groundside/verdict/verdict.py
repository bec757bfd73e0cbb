"""How a flight went: the findings, and a verdict.

- **failed**: an aircraft was lost or its recording ended early; or, at the end, a tracking error was larger than its
  scheme allows, a UAV was outside a bound of its scheme, or an oscillation had not decayed.
- **with remarks**: not failed, but a bound was left for a while, an actuator was at its limits for a long time, the
  flight ended early, or the scheme declares no tracking errors.
- **as it should be**: none of these.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

from ftcc.groundside.text import ids

__all__ = [
    "AS_IT_SHOULD",
    "FAILED",
    "REMARKS",
    "SCHEMA_VERSION",
    "VERDICT_FILE",
    "LimitCycle",
    "Loss",
    "Outside",
    "Saturation",
    "TrackingError",
    "Verdict",
    "with_unit",
]

SCHEMA_VERSION = 1
"""Version of ``verdict.json``."""

AS_IT_SHOULD, REMARKS, FAILED = "as it should be", "with remarks", "failed"
"""The verdicts, in a few words each."""

VERDICT_FILE = "verdict.json"
"""The verdict's file in a run's folder."""

_SEVERITY = {AS_IT_SHOULD: "info", REMARKS: "warning", FAILED: "error"}


@dataclass(frozen=True)
class TrackingError:
    """A tracking error over the flight, of all UAVs together."""

    name: str
    """Expression over recorded columns."""
    unit: str
    meaning: str
    largest: float
    """Absolute value."""
    uav: int
    at: float
    """Time of the largest value, s; ``uav`` had it."""
    end: float | None
    """Largest absolute value at the end, over UAVs that flew to the end; None if none did."""
    end_uav: int | None
    allowed: float | None
    """Largest allowed value at the end; None if the scheme gives none."""
    too_large: bool
    """Whether it was above the allowed value at the end."""


@dataclass(frozen=True)
class Outside:
    """A bound that a UAV left."""

    name: str
    meaning: str
    uav: int
    seconds: float
    until: float
    """Last time outside, s."""
    at_end: bool
    """Whether it was outside at the end of the flight."""


@dataclass(frozen=True)
class Saturation:
    """How long a commanded actuator was at a limit."""

    actuator: str
    uav: int
    share: float
    """Share of the time that the UAV flew, 0 to 1."""


@dataclass(frozen=True)
class LimitCycle:
    """An oscillation that did not decay."""

    signal: str
    unit: str
    uav: int
    frequency: float
    """rad/s."""
    amplitude: float
    """At the end, in ``unit``."""


@dataclass(frozen=True)
class Loss:
    """A UAV that was lost before the end of the flight."""

    uav: int
    at: float
    """s."""
    why: str


@dataclass(frozen=True)
class Verdict:
    """How a flight went."""

    flown: float
    """Duration of the recording, s."""
    planned: float
    """Duration of the mission, s."""
    tracking: tuple[TrackingError, ...]
    """In the order in which the scheme declares them; empty if it declares none."""
    outside: tuple[Outside, ...]
    saturation: tuple[Saturation, ...]
    """Every actuator that was ever at a limit, the longest time first."""
    saturated: tuple[Saturation, ...]
    """Those that were at a limit for a long time."""
    limit_cycles: tuple[LimitCycle, ...]
    """The largest one of each UAV."""
    lost: tuple[Loss, ...]

    @property
    def failures(self) -> list[str]:
        """Reasons for which the flight failed."""
        return [
            *(f"UAV {loss.uav} lost at {loss.at:.1f} s: {loss.why}" for loss in self.lost),
            *(_too_large(error) for error in self.tracking if error.too_large),
            *_bounds([one for one in self.outside if one.at_end], "left, and outside in the end"),
            *_limit_cycles(self.limit_cycles),
        ]

    @property
    def remarks(self) -> list[str]:
        """Remarks that do not make the flight a failed one."""
        short = self.flown < self.planned
        return [
            *([f"ended at {self.flown:g} of {self.planned:g} s"] if short else []),
            *([] if self.tracking else ["nothing says what the scheme tracks"]),
            *_bounds([one for one in self.outside if not one.at_end], "left for a while"),
            *_saturations(self.saturated),
        ]

    @property
    def word(self) -> str:
        """The verdict: `AS_IT_SHOULD`, `REMARKS` or `FAILED`."""
        if self.failures:
            return FAILED
        return REMARKS if self.remarks else AS_IT_SHOULD

    @property
    def severity(self) -> str:
        """Severity of the event that reports the verdict."""
        return _SEVERITY[self.word]

    @property
    def text(self) -> str:
        """The verdict in one line."""
        reasons = [*self.failures, *self.remarks]
        return f"verdict: {self.word}" + (f": {'; '.join(reasons)}" if reasons else "")

    @property
    def largest(self) -> list[str]:
        """The tracking errors, a line each."""
        return [_as_text(error) for error in self.tracking]

    def as_json(self) -> dict[str, Any]:
        """Return the content of ``verdict.json``."""
        found = asdict(self)
        del found["saturated"]
        return {
            "schema": SCHEMA_VERSION,
            "verdict": self.word,
            "failures": self.failures,
            "remarks": self.remarks,
            **found,
        }

    def dumps(self) -> str:
        """Return the content of ``verdict.json`` as text."""
        return json.dumps(self.as_json(), indent=2, allow_nan=False) + "\n"


def with_unit(value: float | None, unit: str) -> str:
    """Return a number with its unit as text, angles in degrees; "-" for None."""
    if value is None:
        return "-"
    if unit.startswith("rad"):
        return f"{math.degrees(value):.3g} deg{unit.removeprefix('rad')}"
    return f"{value:.3g} {unit}".removesuffix(" -")


def _as_text(error: TrackingError) -> str:
    end = "" if error.end is None else f", {with_unit(error.end, error.unit)} in the end"
    largest = f"up to {with_unit(error.largest, error.unit)}, UAV {error.uav} at {error.at:.1f} s"
    return f"{error.meaning} ({error.name}): {largest}{end}"


def _too_large(error: TrackingError) -> str:
    allowed = "" if error.allowed is None else f", {with_unit(error.allowed, error.unit)} allowed"
    return (
        f"{error.meaning} ({error.name}): {with_unit(error.end, error.unit)} in the end, UAV {error.end_uav}{allowed}"
    )


def _named(found: Iterable[Any], key: str) -> Iterator[tuple[str, list[Any]]]:
    """Group findings by one of their fields; the order of first appearance stays."""
    for name in dict.fromkeys(getattr(one, key) for one in found):
        yield name, [one for one in found if getattr(one, key) == name]


def _who(found: Iterable[Any]) -> str:
    return f"UAV {ids(one.uav for one in found)}"


def _bounds(found: Iterable[Outside], how: str) -> list[str]:
    return [
        f"{name} {how}, for up to {max(one.seconds for one in those):.3g} s: {_who(those)}"
        for name, those in _named(list(found), "name")
    ]


def _saturations(found: Iterable[Saturation]) -> list[str]:
    lines = []
    for name, those in _named(list(found), "actuator"):
        most = f"{100.0 * max(one.share for one in those):.0f} % of the time"
        lines.append(f"{name.replace('_', ' ')} at its limits for up to {most}: {_who(those)}")
    return lines


def _limit_cycles(found: Iterable[LimitCycle]) -> list[str]:
    lines = []
    for name, those in _named(list(found), "signal"):
        worst = max(those, key=lambda one: one.amplitude)
        what = f"{worst.frequency:.2g} rad/s, up to +-{with_unit(worst.amplitude, worst.unit)}"
        lines.append(f"limit cycle of {name.replace('_', ' ')}, {what}: {_who(those)}")
    return lines
