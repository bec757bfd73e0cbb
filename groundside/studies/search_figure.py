"""The figure of a search: how it came nearer, margin over distance, and where flights failed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ftcc.groundside.studies.search import Flown
from ftcc.groundside.studies.searching import Found

__all__ = ["draw_search"]

_HOLDS, _FAILS, _UNKNOWN = "#4878cf", "#e23030", "#80848a"
_LEAST_MARGIN = -2.0
"""Margins below are drawn here."""
_MOST = 60
"""Largest number of flights that hold among the lines."""


def draw_search(found: Found, folder: Path, kinds: Sequence[str] = ("png", "svg", "pdf")) -> list[Path]:
    """Draw the search as ``search.png``, ``.svg`` and ``.pdf`` into ``folder``, and return the files."""
    from ftcc.groundside.canvas import plt

    figure, (left, middle, right) = plt.subplots(
        1, 3, figsize=(11.0, 3.4), layout="constrained", width_ratios=(1.0, 1.0, 1.3)
    )
    _draw_progress(left, found)
    _draw_margins(middle, found)
    _draw_values(right, found)
    for axes in (left, middle, right):
        axes.tick_params(labelsize="small")
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, fontsize="small", frameon=False)
    search = found.search
    figure.suptitle(f"{search.study.name} {search.study.case}: {search.goal}", fontsize="small", wrap=True)
    files = [folder / f"search.{kind}" for kind in kinds]
    for file in files:  # without dates, so that equal searches give equal files
        undated: dict[str, Any] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(file.suffix[1:], {})
        figure.savefig(file, dpi=110, metadata=undated)
    plt.close(figure)
    return files


def _groups(found: Found) -> list[tuple[str, str, list[Flown]]]:
    """Return the flights that hold, fail and cannot be judged, with their colours."""
    named = ((_HOLDS, "holds", False), (_FAILS, "fails", True), (_UNKNOWN, "cannot be judged", None))
    groups = [(color, label, [one for one in found.flights if one.fails is fails]) for color, label, fails in named]
    return [group for group in groups if group[2]]


def _draw_progress(axes: Any, found: Found) -> None:
    for color, label, flights in _groups(found):
        axes.scatter([one.number for one in flights], [one.distance for one in flights], s=9, color=color, label=label)
    best, least = [], np.inf
    for one in found.flights:
        least = min(least, one.distance) if one.fails else least
        best.append(least if np.isfinite(least) else np.nan)
    if np.isfinite(least):
        axes.step(range(len(best)), best, where="post", color="black", linewidth=1.0, label="mildest failure so far")
    axes.axvline(
        found.search.budget - 0.5, color="#80848a", linewidth=0.8, linestyle=":", label="begin of the refinement"
    )
    axes.set_xlabel("flight", fontsize="small")
    axes.set_ylabel("distance", fontsize="small")
    axes.set_ylim(bottom=0.0)


def _draw_margins(axes: Any, found: Found) -> None:
    for color, _, flights in _groups(found):
        known = [one for one in flights if one.margin is not None]
        axes.scatter(
            [one.distance for one in known], [max(one.margin or 0.0, _LEAST_MARGIN) for one in known], s=9, color=color
        )
    axes.axhline(0.0, color="#80848a", linewidth=0.8)
    axes.set_xlim(left=0.0)
    axes.set_xlabel("distance", fontsize="small")
    axes.set_ylabel(f"margin (below {_LEAST_MARGIN:g}: drawn there)", fontsize="small")


def _draw_values(axes: Any, found: Found) -> None:
    """Draw a line per flight through the place of each value in its distribution."""
    search = found.search
    rows = range(len(search.quantities))
    for color, _, flights in _groups(found):
        for one in flights[:: max(1, len(flights) // _MOST)]:
            axes.plot(search.places(one.values), rows, color=color, alpha=0.18, linewidth=0.8, marker=".", markersize=3)
    axes.plot(search.own_point, rows, color="black", linewidth=1.4, linestyle="--", marker="o", markersize=4)
    if found.failing:
        axes.plot(search.places(found.failing[0].values), rows, color=_FAILS, linewidth=2.0, marker="o", markersize=5)
    axes.set_yticks(rows, [one.key for one in search.quantities], fontsize="small")
    axes.set_xlim(-0.02, 1.02)
    axes.set_ylim(len(search.quantities) - 0.5, -0.5)
    axes.set_xlabel("place in its distribution\n(dashed: the scenario; bold: mildest failure)", fontsize="small")
