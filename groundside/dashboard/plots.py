"""Plot the swarm over time: one plot per panel with a series per UAV, so that a snapshot costs one call per plot."""

from __future__ import annotations

import math
from collections.abc import Sequence

import rerun as rr
import rerun.blueprint as rrb

from ftcc.groundside.dashboard.detail import Detail
from ftcc.groundside.dashboard.labels import name
from ftcc.groundside.dashboard.panels import Panel, panels_of, uavs_of
from ftcc.groundside.dashboard.snapshot import Snapshot, UavState
from ftcc.groundside.dashboard.subject import Subject
from ftcc.groundside.dashboard.viewer import Entry
from ftcc.groundside.palette import GRAY, Color, colors

__all__ = ["WINDOW", "Plots", "time_series"]

WINDOW = 60.0
"""Time span of the plots, s."""

_EXTREMES: Color = (158, 164, 172)
"""Colour of the curves of the extremes of all UAVs of a big swarm."""

Curve = tuple[str, Color, float]
"""Name, colour, width."""


class Plots:
    """Draws the panels of a swarm."""

    def __init__(self, subject: Subject, detail: Detail) -> None:
        self._subject = subject
        self._detail = detail
        self._leaders = set(subject.leaders)
        self._leaders_at_first = self._leaders & set(detail.shown)
        self._colors = colors(subject.graph.uavs)
        self._groups = panels_of(subject)
        self._panels = [panel for panels in self._groups.values() for panel in panels]
        self._angles: dict[tuple[str, int | None], float] = {}
        """Latest values of unwrapped angles, by panel and UAV."""
        self._uavs, self._followers = self._curve_uavs(include_leaders=True), self._curve_uavs(include_leaders=False)
        """UAVs with curves in panels of all UAVs, and in panels of followers; None reserves a curve."""

    def views(self) -> dict[str, list[rrb.View]]:
        """Return one view per panel, by group."""
        pale = self._detail.crowded
        return {group: [_view(panel, pale) for panel in panels] for group, panels in self._groups.items()}

    def static(self) -> list[Entry]:
        """Return names, colours and widths of all series."""
        entries = []
        for panel in self._panels:
            names, tints, widths = zip(*self._curves(panel), strict=True)
            entries.append(Entry(_series_path(panel), None, rr.SeriesLines(names=names, colors=tints, widths=widths)))
        return entries

    def draw(self, snapshot: Snapshot, new: Sequence[int] = ()) -> list[Entry]:
        """Return the values of one snapshot; ``new`` are the UAVs that are drawn in full from now on."""
        t = snapshot.t
        entries: list[Entry] = []
        if new:
            self._uavs, self._followers = (
                self._curve_uavs(include_leaders=True),
                self._curve_uavs(include_leaders=False),
            )
            entries += self.static()
        entries += [Entry(_series_path(panel), t, rr.Scalars(self._values(panel, snapshot))) for panel in self._panels]
        for panel in self._panels:
            if panel.band:
                entries += self._band(panel, snapshot)
        return entries

    def _curves(self, panel: Panel) -> list[Curve]:
        """Return the curves whose values `_values` returns, in the same order."""
        uavs = self._uavs if panel.include_leaders else self._followers
        leaders = self._leaders
        # Later curves are drawn on top of earlier ones.
        curves = [("lowest of all", _EXTREMES, 1.0), ("highest of all", _EXTREMES, 1.0)] if self._detail.crowded else []
        curves += [self._curve(uav, "", 2.5 if uav in leaders else 1.5) for uav in uavs]
        if panel.second is not None:
            curves += [self._curve(uav, f" {panel.second[1]}", 0.7) for uav in self._followers]
        if isinstance(panel.bound, str):
            for side in ("upper", "lower"):
                bounds = [self._curve(uav, f" {side} bound", 1.0) for uav in self._followers]
                curves += [(called, GRAY, width) for called, _, width in bounds]
        elif panel.bound is not None:
            curves += [("upper bound", GRAY, 1.0), ("lower bound", GRAY, 1.0)]
        if panel.limits is not None:
            curves += [("lower limit", GRAY, 1.0), ("upper limit", GRAY, 1.0)]
        if panel.obstacles:
            curves.append(("top of the obstacle", GRAY, 5.0))
        return curves

    def _curve(self, uav: int | None, what: str, width: float) -> Curve:
        """Return the curve of a UAV, or a reserved curve without a name."""
        return ("", GRAY, width) if uav is None else (name(uav) + what, self._colors[uav], width)

    def _values(self, panel: Panel, snapshot: Snapshot) -> list[float]:
        uavs = self._uavs if panel.include_leaders else self._followers
        values = self._extremes(panel, snapshot) if self._detail.crowded else []
        read = {uav: self._without_jump(panel, uav, panel.read(panel.value, _state(snapshot, uav))) for uav in {*uavs}}
        values += [read[uav] for uav in uavs]
        followers = [_state(snapshot, uav) for uav in self._followers]
        if panel.second is not None:
            seconds = [panel.read(panel.second, state) for state in followers]
            if panel.angle:
                turn = 2.0 * math.pi * panel.scale
                pairs = zip(self._followers, seconds, strict=True)
                seconds = [_nearest_turn(value, read.get(uav, math.nan), turn) for uav, value in pairs]
            values += seconds
        if isinstance(panel.bound, str):
            bounds = [abs(panel.read(("signals", panel.bound), state)) for state in followers]
            values += bounds + [-bound for bound in bounds]
        elif panel.bound is not None:
            values += [panel.bound * panel.scale, -panel.bound * panel.scale]
        if panel.limits is not None:
            values += [limit * panel.scale for limit in panel.limits]
        if panel.obstacles:
            places = [state.truth["x"] for state in snapshot.uavs.values()]
            beneath = [o.top for o in self._subject.obstacles if any(o.start < x < o.end for x in places)]
            values.append(max(beneath, default=math.nan))
        return values

    def _without_jump(self, panel: Panel, uav: int | None, value: float) -> float:
        """Return an angle without a jump by a turn since the previous snapshot; other values unchanged."""
        if not panel.angle or not math.isfinite(value):
            return value
        value = _nearest_turn(value, self._angles.get((panel.path, uav), math.nan), 2.0 * math.pi * panel.scale)
        self._angles[panel.path, uav] = value
        return value

    def _extremes(self, panel: Panel, snapshot: Snapshot) -> list[float]:
        """Return the lowest and the highest value of all UAVs of a panel."""
        values = (panel.read(panel.value, snapshot.uavs.get(uav)) for uav in uavs_of(panel, self._subject))
        finite = [value for value in values if math.isfinite(value)]
        return [min(finite, default=math.nan), max(finite, default=math.nan)]

    def _curve_uavs(self, include_leaders: bool) -> list[int | None]:
        """Return the UAVs that have curves, of all or of followers; None reserves a curve for a later one."""
        detail = self._detail
        places = [*detail.shown, *[None] * (detail.capacity - len(detail.shown))]
        if include_leaders:
            return places
        # Curves must not move: a leader that is added later leaves an empty one.
        return [None if uav in self._leaders else uav for uav in places if uav not in self._leaders_at_first]

    def _band(self, panel: Panel, snapshot: Snapshot) -> list[Entry]:
        """Return the band between the leaders. Rerun shades one standard deviation around a measured value."""
        edge = [panel.read(panel.value, snapshot.uavs.get(uav)) for uav in self._subject.leaders]
        if not edge or not all(map(math.isfinite, edge)):
            return []
        half = 0.5 * (max(edge) - min(edge))
        band = rr.Measurements(
            [min(edge) + half], variances=[half * half], colors=[GRAY], widths=[0.5], names=["middle of the hull"]
        )
        return [Entry(f"{panel.path}/hull", snapshot.t, band)]


def _series_path(panel: Panel) -> str:
    """Return the entity path of a panel's series; a band has an entity of its own."""
    return f"{panel.path}/uavs" if panel.band else panel.path


def _nearest_turn(angle: float, other: float, turn: float) -> float:
    """Return ``angle`` shifted by whole turns to within half a ``turn`` of another angle, if that is finite."""
    return angle - turn * round((angle - other) / turn) if math.isfinite(angle) and math.isfinite(other) else angle


def _state(snapshot: Snapshot, uav: int | None) -> UavState | None:
    return None if uav is None else snapshot.uavs.get(uav)


def _view(panel: Panel, extremes: bool) -> rrb.View:
    unit = f", {panel.shown_unit}" if panel.unit != "-" else ""
    hints = [*panel.notes, *(["pale: extremes of all"] if extremes else [])]
    notes = f" ({', '.join(hints)})" if hints else ""
    return time_series(panel.path, f"{panel.title}{unit}{notes}")


def time_series(origin: str, title: str) -> rrb.View:
    """Return a plot of the last `WINDOW` seconds."""
    return rrb.TimeSeriesView(
        origin=origin,
        name=title,
        # A legend of eight lines would cover the curves; other views show the colours, and hovering names a curve.
        plot_legend=rrb.PlotLegend(visible=False),
        time_ranges=rrb.VisibleTimeRange(
            "t",
            start=rrb.TimeRangeBoundary.cursor_relative(seconds=-WINDOW),
            end=rrb.TimeRangeBoundary.cursor_relative(),
        ),
    )
