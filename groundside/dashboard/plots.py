"""The swarm over time: curves, the table and the event log of the dashboard."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import TimelineColumn

from ftcc.airside.scheme import Quantity
from ftcc.groundside.dashboard.scene import faults, name
from ftcc.groundside.dashboard.viewer import Entry
from ftcc.groundside.palette import GRAY, Color, colors
from ftcc.groundside.snapshot import Event, Snapshot

__all__ = ["Plots", "tracking_errors"]

WINDOW = 60.0
"""Time that the plots show, s."""

_UNITS = {"thrust": "N"}
"""Of actuators; the others are deflections in rad."""
_LEVELS = {"info": "INFO", "warning": "WARN", "error": "ERROR"}
_TABLE_EVERY = 10
"""Snapshots from one table to the next."""


def tracking_errors(signals: Sequence[Quantity]) -> list[Quantity]:
    """The signals that are plotted: tracking errors, which the monograph calls S1, S2, ..., else those with a bound."""
    errors = [signal for signal in signals if re.fullmatch(r"S\d+", signal.name)]
    return errors or [signal for signal in signals if signal.bound is not None]


class Plots:
    """Draws curves: one entity to a plot, one series to a UAV, so that a snapshot costs a call to the plot."""

    def __init__(
        self,
        signals: Sequence[Quantity],
        limits: Mapping[str, tuple[float, float]],
        leaders: Sequence[int],
        followers: Sequence[int],
    ) -> None:
        self._uavs = sorted([*followers, *leaders])
        self._leaders = sorted(leaders)
        self._followers = sorted(followers)
        self._colors = colors(self._uavs)
        self._errors = tracking_errors(signals)
        self._limits = {actuator: limit for actuator, limit in limits.items() if limit[0] < limit[1]}
        self._table_in = 0

    def views(self) -> list[rrb.View]:
        """One plot to a quantity, the altitude first."""
        hull = " (band: between the leaders)" if self._leaders else ""
        views = [_view("/plots/altitude", f"Altitude{hull}, m")]
        for error in self._errors:
            meaning = f"{error.meaning} {error.name}".strip()
            views.append(_view(f"/plots/errors/{error.name}", f"{meaning[0].upper()}{meaning[1:]}, {error.unit}"))
        for actuator in self._limits:
            title = f"{actuator.capitalize()}: acting, thin commanded, gray limits, {_UNITS.get(actuator, 'rad')}"
            views.append(_view(f"/plots/actuators/{actuator}", title))
        return views

    def log_view(self) -> rrb.TextLogView:
        """Events, by simulated time."""
        # The time stands in the text: Rerun's column for it is too narrow to read.
        clock = TimelineColumn("t", visible=False)
        columns = rrb.TextLogColumns(timeline_columns=[clock], text_log_columns=["loglevel", "body"])
        return rrb.TextLogView(origin="/events", name="Events", columns=columns)

    def table_view(self) -> rrb.TextDocumentView:
        """The swarm as a table."""
        return rrb.TextDocumentView(origin="/swarm", name="Swarm", titlebar=False)

    def static(self) -> list[Entry]:
        """Names, colours and widths of all series."""
        entries = [
            Entry(
                "/plots/altitude/uavs",
                None,
                _style(self._curves(self._uavs, widths=[2.5 if uav in self._leaders else 1.5 for uav in self._uavs])),
            )
        ]
        for error in self._errors:
            curves = self._curves(self._followers)
            if isinstance(error.bound, str):
                curves += self._curves(self._followers, " upper bound", [0.7] * len(self._followers))
                curves += self._curves(self._followers, " lower bound", [0.7] * len(self._followers))
            elif error.bound is not None:
                curves += [("upper bound", GRAY, 1.0), ("lower bound", GRAY, 1.0)]
            entries.append(Entry(f"/plots/errors/{error.name}", None, _style(curves)))
        for actuator in self._limits:
            curves = self._curves(self._followers)
            curves += self._curves(self._followers, " commanded", [0.7] * len(self._followers))
            curves += [("lower limit", GRAY, 1.0), ("upper limit", GRAY, 1.0)]
            entries.append(Entry(f"/plots/actuators/{actuator}", None, _style(curves)))
        return entries

    def draw(self, snapshot: Snapshot) -> list[Entry]:
        """The values of one instant, and what happened before it."""
        t = snapshot.t
        uavs = snapshot.uavs
        z = [uavs[uav].truth["z"] if uav in uavs else math.nan for uav in self._uavs]
        entries = [Entry("/plots/altitude/uavs", t, rr.Scalars(z))]
        edge = [z[self._uavs.index(uav)] for uav in self._leaders]
        if edge and all(map(math.isfinite, edge)):
            entries.append(Entry("/plots/altitude/hull", t, _band(min(edge), max(edge))))
        for error in self._errors:
            values = self._signal(snapshot, error.name)
            if isinstance(error.bound, str):
                bounds = [abs(bound) for bound in self._signal(snapshot, error.bound)]
                values += bounds + [-bound for bound in bounds]
            elif error.bound is not None:
                values += [error.bound, -error.bound]
            entries.append(Entry(f"/plots/errors/{error.name}", t, rr.Scalars(values)))
        for actuator, limit in self._limits.items():
            acting = [uavs[uav].acting.get(actuator, math.nan) if uav in uavs else math.nan for uav in self._followers]
            wanted = [uavs[uav].command.get(actuator, math.nan) if uav in uavs else math.nan for uav in self._followers]
            entries.append(Entry(f"/plots/actuators/{actuator}", t, rr.Scalars([*acting, *wanted, *limit])))
        if self._table_in == 0:
            entries.append(Entry("/swarm", t, rr.TextDocument(self._table(snapshot), media_type="text/markdown")))
        self._table_in = (self._table_in + 1) % _TABLE_EVERY
        return entries + events(snapshot.events)

    def _signal(self, snapshot: Snapshot, signal: str) -> list[float]:
        uavs = snapshot.uavs
        return [uavs[uav].signals.get(signal, math.nan) if uav in uavs else math.nan for uav in self._followers]

    def _curves(
        self, uavs: Sequence[int], suffix: str = "", widths: Sequence[float] | None = None
    ) -> list[tuple[str, Color, float]]:
        widths = widths or [1.5] * len(uavs)
        return [(f"{name(uav)}{suffix}", self._colors[uav], width) for uav, width in zip(uavs, widths, strict=True)]

    def _table(self, snapshot: Snapshot) -> str:
        rows = [
            "| UAV | altitude, m | speed, m/s | actuators | hears | late ticks |",
            "|---|---|---|---|---|---|",
        ]
        for uav in self._uavs:
            label = f"{uav} leader" if uav in self._leaders else f"{uav}"
            state = snapshot.uavs.get(uav)
            if state is None:
                rows.append(f"| {label} | | | not heard | | |")
                continue
            received = sum(link.received for link in state.links.values())
            lost = sum(link.lost for link in state.links.values())
            cut = sum(link.cut for link in state.links.values())
            heard = f"{len(state.links) - cut} of {len(state.links)}" if state.links else ""
            if lost:
                heard += f", {100.0 * lost / (received + lost):.0f} % lost"
            silent = snapshot.t - state.t > 1.0
            health = f"silent since {state.t:.0f} s" if silent else faults(state) or "healthy"
            if uav in self._leaders and not silent:
                health = ""
            z, speed = state.truth["z"], state.truth["V"]
            rows.append(f"| {label} | {z:.1f} | {speed:.2f} | {health} | {heard} | {state.late} |")
        return "\n".join(rows)


def events(happened: Iterable[Event]) -> list[Entry]:
    """Lines of the event log."""
    return [
        Entry(
            "/events",
            event.t,
            rr.TextLog(
                f"{event.t:.1f} s  " + (f"{name(event.uav)}: " if event.uav is not None else "") + event.text,
                level=_LEVELS.get(event.severity, event.severity.upper()),
            ),
        )
        for event in happened
    ]


def _view(origin: str, title: str) -> rrb.View:
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


def _style(curves: Sequence[tuple[str, Color, float]]) -> rr.SeriesLines:
    names, tints, widths = zip(*curves, strict=True)
    return rr.SeriesLines(names=names, colors=tints, widths=widths)


def _band(low: float, high: float) -> rr.Measurements:
    """A band: Rerun shades one standard deviation about a measured value."""
    half = 0.5 * (high - low)
    return rr.Measurements(
        [low + half], variances=[half * half], colors=[GRAY], widths=[0.5], names=["middle of the hull"]
    )
