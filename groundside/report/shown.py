"""Find the figure that shows the signal of a claim; draw those that no other figure shows."""

from __future__ import annotations

import ast
import math
import textwrap
from collections.abc import Iterator, Sequence

from ftcc.groundside.claims import Result
from ftcc.groundside.report.curves import Flown, drawable, last_time, uavs_of
from ftcc.groundside.report.definitions import Figure, Panel
from ftcc.groundside.report.drawing import anchor_of
from ftcc.groundside.report.page import Cell

__all__ = ["figure_of_claims", "links_of_claims"]

_IN_UNIT_OF_SIGNAL = (
    *("value_at", "max_abs", "max", "min", "mean", "std", "peak_to_peak", "rms", "departure", "rms_change"),
    "mean_change",
)
"""Metrics whose number has the unit of the signal."""
_SHORT = 0.2
"""Longest window that has a detail, as a share of the flight."""
_MARGIN = 0.1
"""What a detail shows on either side of the window, as a share of it."""
_LONGEST = 26
"""Characters of a signal that labels its axis; instead of a longer one stands the name of its first claim."""


def links_of_claims(results: Sequence[Result], figures: Sequence[Figure], flight: Flown) -> dict[int, Cell]:
    """Return for each claim, by its place, a link to the panel that shows its signal, with its window.

    Among the panels that show it, the one with the shortest window is preferred: it is the closest view. A claim about
    time alone, such as how long a UAV flew, is shown by the events.
    """
    found = {}
    for n, result in enumerate(results):
        start, end = result.claim.window
        when = f"at {start:g} s" if start == end else f"{start:g} - {end:g} s"
        best = _best(result, figures, flight)
        if best is not None:
            figure, panel = best
            name = f"figure {figure.number}" if figure.number else figure.title.lower()
            found[n] = Cell(f"{name}, {when}", anchor=anchor_of(figure.name, panel))
        elif _bare(result.claim.signal) == "t":
            found[n] = Cell(f"events, {when}", anchor="events")
    return found


def figure_of_claims(results: Sequence[Result], figures: Sequence[Figure], flight: Flown) -> Figure | None:
    """Return a figure of the signals of claims that no other figure shows, with details of short windows.

    None if there are no such claims.
    """
    missing: dict[str, list[Result]] = {}
    for result in results:
        signal = _bare(result.claim.signal)
        if signal != "t" and _best(result, figures, flight) is None:
            missing.setdefault(signal, []).append(result)
    panels = [panel for signal, those in missing.items() for panel in _panels(signal, those, flight)]
    if not panels:
        return None
    return Figure(name="claims_signals", title="Other signals", panels=panels, columns=2)


def _panels(signal: str, results: Sequence[Result], flight: Flown) -> Iterator[Panel]:
    """Yield a signal over the whole flight, and in the windows of claims that are short in it."""
    label = signal if len(signal) <= _LONGEST else textwrap.fill(results[0].claim.name, _LONGEST)
    unit = next((result.claim.unit for result in results if result.claim.metric in _IN_UNIT_OF_SIGNAL), "")
    uavs = sorted({uav for result in results for uav in result.uavs})
    whole = Panel(y=signal, label=label, unit=unit, uavs=uavs)
    if not drawable(whole, flight):
        return
    yield whole
    windows: list[tuple[float, float]] = []
    for start, end in sorted({result.claim.window for result in results}, key=lambda window: window[1] - window[0]):
        span = end - start
        if not 0.0 < span <= _SHORT * last_time(flight) or end > last_time(flight):
            continue
        if not any(low <= start and end <= high for low, high in windows):
            windows.append((max(0.0, start - _MARGIN * span), end + _MARGIN * span))
    for window in sorted(windows):
        yield whole.model_copy(update={"window": window})


def _best(result: Result, figures: Sequence[Figure], flight: Flown) -> tuple[Figure, int] | None:
    """Return the figure and the place of the panel that show a claim best."""
    shown = [
        (math.inf if panel.window is None else panel.window[1] - panel.window[0], figure, n)
        for figure in figures
        for n, panel in enumerate(figure.panels)
        if _shows(panel, result, flight)
    ]
    return min(shown, key=lambda one: one[0])[1:] if shown else None


def _shows(panel: Panel, result: Result, flight: Flown) -> bool:
    """Return whether a panel draws the signal of a claim over time, for all its UAVs and all its window."""
    start, end = result.claim.window
    return (
        panel.x == "t"
        and panel.pairs is None
        and not panel.shared
        and _quantity(panel.y) == _quantity(result.claim.signal)
        and set(result.uavs) <= set(uavs_of(panel.uavs, flight.mission))
        and (panel.window is None or (panel.window[0] <= start and end <= panel.window[1]))
        and drawable(panel, flight)
    )


def _bare(expression: str, without: Sequence[str] = ("abs", "round")) -> str:
    """Return an expression without sign and the functions around it that do not change what its picture shows."""
    node = ast.parse(expression.strip(), mode="eval").body
    while True:
        if isinstance(node, ast.UnaryOp):
            node = node.operand
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in without:
            node = node.args[0]
        else:
            return ast.unparse(node)


def _quantity(expression: str) -> str:
    """Return an expression also without its conversion to degrees."""
    return _bare(expression, ("abs", "round", "degrees"))
