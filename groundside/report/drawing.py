"""Draw figures with matplotlib in one style: SVG for the page, PDF and PNG for papers and slides."""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.references.position import Command, border
from ftcc.groundside.canvas import INK, PAGE, Line2D, Look, plt
from ftcc.groundside.claims import unwrapped
from ftcc.groundside.palette import FIRE, GRAY, colors, hexadecimal
from ftcc.groundside.report.curves import Flown, curves_of, drawable, last_time, uavs_of
from ftcc.groundside.report.definitions import Panel
from ftcc.link.actuators import SLOT

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ftcc.groundside.scenario import Mission

__all__ = ["add_legend", "anchor_of", "draw", "draw_timeline", "figure_of", "folded", "thinned"]

Array = NDArray[np.float64]

_LEGEND = 0.35
"""Height of a legend of one line, inches."""
_TALL = 2.0
"""Height of a row with equal axes, in rows."""
_TICKS_OF_A_DETAIL = 4
"""Largest number of intervals on the time axis of a detail; more labels would overlap."""
_LABEL = 22
"""Characters in a line of the label of a narrow figure's axis."""
_GAPS = 1.5
"""Between the entries of a narrow figure's legend and beside their lines, in sizes of its letters."""
_FAR = 3.0
"""Largest distance of a drawn limit from the curves, in heights of the axes."""
_COLUMNS = 700
"""Number of parts of a curve; of each the least and the greatest value are drawn."""
_FAULT = (214, 48, 48)
_FEW = 6
"""Most marks of faults with names."""
_RUN_COLORS = ((72, 126, 216), (206, 84, 60), (64, 160, 88), (138, 104, 206), (146, 140, 40), (34, 158, 166))
"""Colours of compared runs."""


def draw(
    candidates: Sequence[Panel],
    flights: Sequence[Flown],
    columns: int = 1,
    look: Look = PAGE,
    faults: Sequence[tuple[float, str]] = (),
) -> Any | None:
    """Draw panels of one flight, coloured by UAV, or of several, coloured by flight; None if no flight has the data.

    Details are placed in rows of their own, other panels in ``columns`` columns. ``faults`` (time in s, whose) are
    marked where the axis is time. In an SVG each panel has an id, see `anchor_of`.
    """
    panels = {n: panel for n, panel in enumerate(candidates) if any(drawable(panel, flight) for flight in flights)}
    if not panels:
        return None
    with plt.rc_context(look.style):
        wide = [n for n, panel in panels.items() if panel.window is None]
        details = [n for n, panel in panels.items() if panel.window is not None]
        columns = min(columns, look.columns)
        rows = [wide[i : i + columns] for i in range(0, len(wide), columns)]
        rows += [details[i : i + look.details] for i in range(0, len(details), look.details)]
        width = int(np.lcm.reduce([len(row) for row in rows]))
        heights = [_TALL if any(panels[n].equal for n in row) else 1.0 for row in rows]
        mosaic: Any = [[str(n) for n in row for _ in range(width // len(row))] for row in rows]
        size = (look.width, _LEGEND + look.row * sum(heights))
        figure, axes = plt.subplot_mosaic(mosaic, figsize=size, height_ratios=heights, layout="constrained")
        for n, panel in panels.items():
            _draw_panel(axes[str(n)], panel, flights, look)
            axes[str(n)].set_gid(_panel_id(n))
        timed = [n for n, panel in panels.items() if panel.x == "t"]
        named = len(faults) <= _FEW
        for n in timed:
            _mark_faults(axes[str(n)], faults, named and n == timed[-1])
        entries = _legend_entries(list(panels.values()), flights)
        if faults and timed and not named:
            entries.append(Line2D([], [], color=hexadecimal(_FAULT), linewidth=0.9, label="fault"))
        add_legend(figure, entries, look)
    return figure


def _panel_id(number: int) -> str:
    return f"panel{number}"


def anchor_of(figure: str, panel: int) -> str:
    """Return the id on a page of a panel, given by its place among the candidates of `draw`, of the named figure."""
    return f"{figure}-{_panel_id(panel)}"


def _draw_panel(axes: Axes, panel: Panel, flights: Sequence[Flown], look: Look) -> None:
    several = len(flights) > 1
    for n, flight in enumerate(flights):
        if not drawable(panel, flight):
            continue
        tints = colors(flight.mission.uavs)
        leaders = flight.mission.graph.leaders
        for k, curve in enumerate(curves_of(panel.y, flight, panel.uavs, panel.pairs, panel.window, panel.x)):
            color = hexadecimal(_RUN_COLORS[n % len(_RUN_COLORS)] if several else tints[curve.uav])
            if panel.pairs is not None and not several:
                color = hexadecimal(colors(range(1, len(panel.pairs) + 1))[k + 1])
            if panel.shared and not several:
                color = INK
            y = curve.y if panel.turn is None else unwrapped(curve.y, panel.turn)
            style = "--" if curve.uav in leaders and panel.pairs is None else "-"
            axes.plot(*thinned(curve.x, y), style, color=color, zorder=3 + n, linewidth=0.8 if several else 1.0)
            if panel.shared:
                break
        if n == 0:
            _draw_bounds(axes, panel, flight)
        if n == 0 and panel.surroundings is not None:
            _draw_surroundings(axes, panel.surroundings, flight)
    if panel.limits is not None:
        _draw_limits(axes, panel.limits, flights[0])
    if panel.x == "t" and not several:
        _mark_events(axes, panel, flights[0])
    unit = f", {_pretty(panel.unit)}" if panel.unit and panel.unit != "-" else ""
    axes.set(xlabel=f"{panel.x_label}, {_pretty(panel.x_unit)}", ylabel=folded(f"{panel.label}{unit}", look))
    axes.margins(x=0.01)
    if panel.window is not None:
        axes.locator_params(axis="x", nbins=_TICKS_OF_A_DETAIL - look.is_narrow)
    if panel.equal:
        axes.set_aspect("equal", adjustable="datalim")


def _draw_limits(axes: Axes, actuator: str, flight: Flown) -> None:
    """Draw an actuator's limits, unless they are too far from the curves."""
    follower = next(spec for spec in flight.mission.vehicles if spec.kind != "reference_point")
    low, high = axes.get_ylim()
    for limit in follower.limits[SLOT[actuator]]:
        if low - _FAR * (high - low) <= limit <= high + _FAR * (high - low):
            axes.axhline(limit, color=hexadecimal(GRAY), linewidth=0.8, linestyle=":")


def _draw_surroundings(axes: Axes, kind: str, flight: Flown) -> None:
    """Draw obstacles as blocks, or the fire's first front (dashed) and its last one."""
    if kind == "obstacles":
        low, _ = axes.get_ylim()
        for start, end, top in flight.mission.obstacles:
            axes.fill_between((start, end), top, low, color=hexadecimal(GRAY), alpha=0.35, linewidth=0.0)
        axes.set_ylim(bottom=low)
        return
    fire, signals, uav = flight.mission.fire, flight.signals, flight.mission.graph.followers[0]
    if fire is None or "fire_north" not in signals.names:
        return
    t, north, east = (signals.column(name, uav) for name in ("t", "fire_north", "fire_east"))
    known = np.flatnonzero(np.isfinite(north)).tolist()
    for k, style in zip((*known[:1], *known[-1:]), ("--", "-"), strict=False):
        here = Command(float(t[k]), float(north[k]), float(east[k]), 0.0, 0.0)
        x, y = border(fire, [here], float(t[k])).T
        axes.plot(y, x, style, color=hexadecimal(FIRE), linewidth=1.0, zorder=2)


def _draw_bounds(axes: Axes, panel: Panel, flight: Flown) -> None:
    """Draw positive and negative bounds dashed, true values dotted, references thin."""
    tints = colors(flight.mission.uavs)
    if panel.reference is not None:
        begins = {c.uav: c.y for c in curves_of(panel.y, flight, panel.uavs, None, panel.window, panel.x)}
        for curve in curves_of(panel.reference, flight, panel.uavs, None, panel.window, panel.x):
            y = curve.y if panel.turn is None else unwrapped(curve.y, panel.turn, begins.get(curve.uav))
            axes.plot(*thinned(curve.x, y), "--", color=hexadecimal(tints[curve.uav]), linewidth=0.5, zorder=2)
    if panel.bound is not None:
        for curve in curves_of(panel.bound, flight, panel.uavs, None, panel.window, panel.x):
            x, y = thinned(curve.x, np.abs(curve.y))
            for sign in (1.0, -1.0):
                axes.plot(x, sign * y, "--", color=hexadecimal(GRAY), linewidth=0.8, zorder=2)
    if panel.true is not None:
        for curve in curves_of(panel.true, flight, panel.uavs, None, panel.window, panel.x):
            axes.plot(*thinned(curve.x, curve.y), ":", color=INK, linewidth=0.9, zorder=5)


def _mark_events(axes: Axes, panel: Panel, flight: Flown) -> None:
    last = last_time(flight)
    low, high = panel.window or (0.0, last)
    for t in flight.event_times:
        if low < t < min(high, last):
            axes.axvline(t, color=hexadecimal(GRAY), alpha=0.45, linewidth=0.7, zorder=1)


def folded(label: str, look: Look) -> str:
    """Return the label of an axis in lines that are no longer than the axis of a narrow figure."""
    what, comma, unit = label.rpartition(", ")
    # A unit stays with the word before it.
    together = f"{what},\u00a0{unit}" if comma else label
    return textwrap.fill(together, _LABEL, break_long_words=False) if look.is_narrow else label


def add_legend(figure: Any, entries: Sequence[Line2D], look: Look, handle: float = 1.6) -> None:
    """Put a legend above a figure, in as many columns as there is room for; a narrow figure becomes higher for it."""
    columns = min(len(entries), 8)
    if look.is_narrow and entries:
        size = look.style["legend.fontsize"] / 72.0
        longest = max(len(str(entry.get_label())) for entry in entries)
        columns = max(1, min(columns, int(look.width / (size * (handle + _GAPS + 0.52 * longest)))))
        width, height = figure.get_size_inches()
        lines = -(-len(entries) // columns)
        figure.set_size_inches(width, height + 1.35 * size * (lines - 1))
    if entries:
        gaps = {"columnspacing": 1.0, "handletextpad": 0.5} if look.is_narrow else {}
        figure.legend(handles=entries, loc="outside upper center", ncols=columns, handlelength=handle, **gaps)


def _mark_faults(axes: Axes, faults: Sequence[tuple[float, str]], named: bool) -> None:
    """Mark faults with lines, and with names beside them."""
    color = hexadecimal(_FAULT)
    for t, whose in faults:
        axes.axvline(t, color=color, linewidth=0.9, zorder=6)
        if named:
            place = axes.get_xaxis_transform()
            text = f"fault, {whose} "
            axes.text(t, 1.0, text, transform=place, color=color, rotation=90, ha="right", va="top", zorder=6)


def _legend_entries(panels: Sequence[Panel], flights: Sequence[Flown]) -> list[Line2D]:
    entries: list[Line2D] = []
    if len(flights) > 1:
        entries += [
            Line2D([], [], color=hexadecimal(_RUN_COLORS[n % len(_RUN_COLORS)]), label=flight.label)
            for n, flight in enumerate(flights)
        ]
    else:
        entries += _uav_entries(panels, flights[0])
    gray = hexadecimal(GRAY)
    if any(panel.bound for panel in panels):
        entries.append(Line2D([], [], color=gray, linestyle="--", label="bound"))
    if any(panel.limits for panel in panels):
        entries.append(Line2D([], [], color=gray, linestyle=":", label="limit"))
    if any(panel.reference for panel in panels):
        entries.append(Line2D([], [], color=INK, linestyle="--", linewidth=0.5, label="reference"))
    shown = {panel.surroundings for panel in panels}
    if "obstacles" in shown and flights[0].mission.obstacles:
        entries.append(Line2D([], [], color=gray, linewidth=5.0, alpha=0.35, label="obstacle"))
    if "fire" in shown:
        red = hexadecimal(FIRE)
        entries.append(Line2D([], [], color=red, linestyle="--", label="fire, first"))
        entries.append(Line2D([], [], color=red, label="fire, last"))
    if any(panel.true for panel in panels):
        entries.append(Line2D([], [], color=INK, linestyle=":", label="true value"))
    return entries


def _uav_entries(panels: Sequence[Panel], flight: Flown) -> list[Line2D]:
    pairs = next((panel.pairs for panel in panels if panel.pairs is not None), None)
    if pairs is not None:
        tints = colors(range(1, len(pairs) + 1))
        return [
            Line2D([], [], color=hexadecimal(tints[k]), label=f"UAV {a} less UAV {b}")
            for k, (a, b) in enumerate(pairs, 1)
        ]
    shown = sorted({uav for panel in panels if not panel.shared for uav in uavs_of(panel.uavs, flight.mission)})
    tints = colors(flight.mission.uavs)
    leaders = flight.mission.graph.leaders
    return [
        Line2D(
            [],
            [],
            color=hexadecimal(tints[uav]),
            linestyle="--" if uav in leaders else "-",
            label=f"UAV {uav}" + (" (leader)" if uav in leaders else ""),
        )
        for uav in shown
    ]


def draw_timeline(events: Sequence[dict[str, Any]], mission: Mission, last: float, look: Look = PAGE) -> Any | None:
    """Draw events over time, a row per UAV and one for the whole swarm; None if there are no events."""
    marked = [event for event in events if 0.0 <= float(event["t"]) <= max(last, 0.0)]
    if not marked:
        return None
    rows = [None, *mission.uavs]
    places = {uav: -i for i, uav in enumerate(rows)}
    tints = {"info": GRAY, "warning": (214, 140, 20), "error": (214, 48, 48)}
    shapes = {"info": "o", "warning": "D", "error": "X"}
    with plt.rc_context(look.style):
        figure, axes = plt.subplots(figsize=(look.width, 0.55 + 0.2 * len(rows)), layout="constrained")
        for event in marked:
            uav = event.get("uav")
            severity = str(event.get("severity", "info"))
            axes.plot(
                [float(event["t"])],
                [places.get(int(uav) if uav is not None else None, 0)],
                shapes.get(severity, "o"),
                color=hexadecimal(tints.get(severity, GRAY)),
                markersize=5.5,
                zorder=3,
            )
        axes.set_yticks([-i for i in range(len(rows))], ["swarm", *(f"UAV {uav}" for uav in mission.uavs)])
        axes.set(xlabel="t, s", xlim=(-0.01 * last, 1.01 * last), ylim=(0.6 - len(rows), 0.6))
        axes.spines["left"].set_visible(False)
        axes.tick_params(left=False)
    return figure


def figure_of(curves: Sequence[tuple[str, str, Array, Array]], label: str, look: Look = PAGE) -> Any:
    """Draw curves (name, colour, times, values) of non-negative quantities over time, with the axis from zero."""
    with plt.rc_context(look.style):
        figure, axes = plt.subplots(figsize=(look.width, _LEGEND + look.row), layout="constrained")
        lines = [axes.plot(*thinned(t, y), color=color, label=name)[0] for name, color, t, y in curves]
        axes.set(xlabel="t, s", ylabel=folded(label, look))
        axes.margins(x=0.01)
        axes.set_ylim(bottom=0.0)
        add_legend(figure, lines, look)
    return figure


def thinned(x: Array, y: Array) -> tuple[Array, Array]:
    """Keep a curve's least and greatest value in each of `_COLUMNS` parts, which looks the same but is smaller."""
    if len(y) <= 2 * _COLUMNS:
        return x, y
    edges = np.linspace(0, len(y), _COLUMNS + 1).astype(int)
    kept = []
    for a, b in itertools.pairwise(edges):
        part = y[a:b]
        if np.isfinite(part).any():
            low, high = a + int(np.nanargmin(part)), a + int(np.nanargmax(part))
            kept += [min(low, high), max(low, high)] if low != high else [low]
        else:
            kept.append(a)
    kept = sorted({0, *kept, len(y) - 1})
    return x[kept], y[kept]


def _pretty(unit: str) -> str:
    return unit.replace("^2", "\u00b2")
