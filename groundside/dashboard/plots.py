"""The swarm over time: a plot to a panel, a series to a UAV, so that a snapshot costs one call to the plot."""

from __future__ import annotations

import math
from collections.abc import Sequence

import rerun as rr
import rerun.blueprint as rrb

from ftcc.groundside.dashboard.panels import Panel, panels_of, uavs_of
from ftcc.groundside.dashboard.subject import Subject
from ftcc.groundside.dashboard.viewer import Entry
from ftcc.groundside.dashboard.words import name
from ftcc.groundside.palette import GRAY, Color, colors
from ftcc.groundside.snapshot import Snapshot

__all__ = ["WINDOW", "Plots", "time_series"]

WINDOW = 60.0
"""Time that the plots show, s."""

Curve = tuple[str, Color, float]
"""Name, colour, width."""


class Plots:
    """Draws the panels of a swarm."""

    def __init__(self, subject: Subject) -> None:
        self._subject = subject
        self._colors = colors(subject.graph.uavs)
        self._groups = panels_of(subject)
        self._panels = [panel for panels in self._groups.values() for panel in panels]

    def views(self) -> dict[str, list[rrb.View]]:
        """One view to a panel, by group."""
        return {group: [_view(panel) for panel in panels] for group, panels in self._groups.items()}

    def static(self) -> list[Entry]:
        """Names, colours and widths of all series."""
        entries = []
        for panel in self._panels:
            names, tints, widths = zip(*self._curves(panel), strict=True)
            entries.append(Entry(_curves_of(panel), None, rr.SeriesLines(names=names, colors=tints, widths=widths)))
        return entries

    def draw(self, snapshot: Snapshot) -> list[Entry]:
        """The values of one instant."""
        t = snapshot.t
        entries = [Entry(_curves_of(panel), t, rr.Scalars(self._values(panel, snapshot))) for panel in self._panels]
        for panel in self._panels:
            if panel.band:
                entries += self._band(panel, snapshot)
        return entries

    def _curves(self, panel: Panel) -> list[Curve]:
        """What `_values` gives, in the same order."""
        uavs = uavs_of(panel, self._subject)
        leaders = self._subject.leaders
        curves = [(name(uav), self._colors[uav], 2.5 if uav in leaders else 1.5) for uav in uavs]
        if panel.second is not None:
            curves += [(f"{name(uav)} {panel.second[1]}", self._colors[uav], 0.7) for uav in self._followers(uavs)]
        if isinstance(panel.bound, str):
            for side in ("upper", "lower"):
                curves += [(f"{name(uav)} {side} bound", GRAY, 1.0) for uav in self._followers(uavs)]
        elif panel.bound is not None:
            curves += [("upper bound", GRAY, 1.0), ("lower bound", GRAY, 1.0)]
        if panel.limits is not None:
            curves += [("lower limit", GRAY, 1.0), ("upper limit", GRAY, 1.0)]
        if panel.obstacles:
            curves.append(("top of the obstacle", GRAY, 5.0))
        return curves

    def _values(self, panel: Panel, snapshot: Snapshot) -> list[float]:
        uavs = uavs_of(panel, self._subject)
        states = [snapshot.uavs.get(uav) for uav in uavs]
        values = [panel.read(panel.value, state) for state in states]
        followers = [snapshot.uavs.get(uav) for uav in self._followers(uavs)]
        if panel.second is not None:
            values += [panel.read(panel.second, state) for state in followers]
        if isinstance(panel.bound, str):
            bounds = [abs(panel.read(("signals", panel.bound), state)) for state in followers]
            values += bounds + [-bound for bound in bounds]
        elif panel.bound is not None:
            values += [panel.bound * panel.scale, -panel.bound * panel.scale]
        if panel.limits is not None:
            values += [limit * panel.scale for limit in panel.limits]
        if panel.obstacles:
            places = [state.truth["x"] for state in states if state is not None]
            beneath = [o.top for o in self._subject.obstacles if any(o.start < x < o.end for x in places)]
            values.append(max(beneath, default=math.nan))
        return values

    def _followers(self, uavs: Sequence[int]) -> list[int]:
        leaders = self._subject.leaders
        return [uav for uav in uavs if uav not in leaders]

    def _band(self, panel: Panel, snapshot: Snapshot) -> list[Entry]:
        """What lies between the leaders. Rerun shades one standard deviation about a measured value."""
        edge = [panel.read(panel.value, snapshot.uavs.get(uav)) for uav in self._subject.leaders]
        if not edge or not all(map(math.isfinite, edge)):
            return []
        half = 0.5 * (max(edge) - min(edge))
        band = rr.Measurements(
            [min(edge) + half], variances=[half * half], colors=[GRAY], widths=[0.5], names=["middle of the hull"]
        )
        return [Entry(f"{panel.path}/hull", snapshot.t, band)]


def _curves_of(panel: Panel) -> str:
    """Entity of a panel's series; a band beside them is an entity of its own."""
    return f"{panel.path}/uavs" if panel.band else panel.path


def _view(panel: Panel) -> rrb.View:
    unit = f", {panel.shown_unit}" if panel.unit != "-" else ""
    notes = f" ({', '.join(panel.notes)})" if panel.notes else ""
    return time_series(panel.path, f"{panel.title}{unit}{notes}")


def time_series(origin: str, title: str) -> rrb.View:
    """A plot of the last `WINDOW` seconds."""
    return rrb.TimeSeriesView(
        origin=origin,
        name=title,
        # A legend of eight lines would cover the curves; the other views show the colours, the pointer names a curve.
        plot_legend=rrb.PlotLegend(visible=False),
        time_ranges=rrb.VisibleTimeRange(
            "t",
            start=rrb.TimeRangeBoundary.cursor_relative(seconds=-WINDOW),
            end=rrb.TimeRangeBoundary.cursor_relative(),
        ),
    )
