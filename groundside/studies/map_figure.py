"""The picture of a map: margin as colour, its boundary, and the boundaries that theory draws."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Any

import numpy as np

from ftcc.airside.scheme import quantities
from ftcc.groundside.studies.map import Map
from ftcc.groundside.studies.plan import Variation
from ftcc.link.actuators import unit_of

__all__ = ["draw_map"]

_COLOURS = "RdBu"
"""Red to blue through white: told apart by all common kinds of colour vision."""
_LINES: tuple[tuple[str, Any], ...] = (("C1", "--"), ("0.35", "-."), ("C4", ":"), ("C2", "--"))
_MOST_CURVES = 6


def draw_map(flown: Map, folder: Path) -> list[Path]:
    """Draw a map as PNG, SVG and PDF into ``folder``, and return the files."""
    from ftcc.groundside.canvas import STYLE, Line2D, plt, save

    figure, axes = plt.subplots(figsize=(6.4, 5.6), layout="constrained")
    x, y = np.array(flown.x.values), np.array(flown.y.values)
    margins = flown.margins
    axes.set_facecolor("0.85")
    shown = np.ma.masked_invalid(np.clip(margins, -1.0, 1.0))
    picture = axes.pcolormesh(x, y, shown, cmap=_COLOURS, vmin=-1.0, vmax=1.0, shading="nearest", rasterized=True)
    bar = figure.colorbar(picture, ax=axes, extend="both")
    bar.set_label(f"margin, clipped at -1 and 1; blue: holds\n{flown.question}", fontsize="small")
    handles: list[Any] = []
    known = margins[~np.isnan(margins)]
    if (known >= 0.0).any() and (known < 0.0).any():
        # A lost aircraft has no finite margin; clipped it still lies on the failing side.
        axes.contour(x, y, np.ma.masked_invalid(np.clip(margins, -1.0, 1.0)), [0.0], colors="k", linewidths=1.6)
        handles.append(Line2D([], [], color="k", linewidth=1.6, label="flown boundary: margin 0"))
    absent = {
        "lost an aircraft, or the event did not occur": (np.isneginf(margins), "x", "k"),
        "refused by the checks": (flown.refused, "s", "0.55"),
        "no number": (np.isnan(margins) & ~flown.refused, ".", "0.4"),
    }
    for label, (cells, marker, colour) in absent.items():
        rows, columns = np.nonzero(cells)
        if len(rows):
            axes.plot(x[columns], y[rows], marker, color=colour, markersize=_size(x, y), markeredgewidth=0.7)
            handles.append(Line2D([], [], color=colour, marker=marker, markersize=5, linewidth=0, label=label))
    for place, curve in enumerate(flown.curves[:_MOST_CURVES]):
        colour, dashes = _LINES[place % len(_LINES)]
        height = np.clip(np.ma.masked_invalid(curve.height), -1.0, 1.0)
        if height.min() < 0.0 < height.max():
            axes.contour(curve.x, curve.y, height, [0.0], colors=colour, linestyles=dashes, linewidths=1.8)
            label = "\n".join(textwrap.wrap(curve.label, 80))
            handles.append(Line2D([], [], color=colour, linestyle=dashes, linewidth=1.8, label=label))
    axes.set_xlabel(_label(flown, flown.x))
    axes.set_ylabel(_label(flown, flown.y))
    axes.set_title(f"{flown.plan.title}\n{flown.plan.case}", fontsize="small", wrap=True)
    if handles:
        figure.legend(handles=handles, loc="outside lower center", fontsize="small", frameon=False)
    with plt.rc_context(STYLE):
        return list(save(figure, "map", f"Where the claim holds: {flown.question}.", "", folder).files)


def _size(x: Any, y: Any) -> float:
    """Return a size of marks that leaves neighbouring cells apart, pt."""
    return float(np.clip(150.0 / max(len(x), len(y)), 1.5, 6.0))


def _label(flown: Map, axis: Variation) -> str:
    """Return the key with its unit, where that is known."""
    parts = axis.key.split(".")
    if parts[0] == "faults" and parts[-1] == "bias":
        unit = unit_of(flown.plan.documents[0][1]["faults"][int(parts[1])].get("actuator", ""))
    elif parts[0] == "gains":
        gain = quantities(flown.plan.mission.scheme.gains_type).get(parts[-1])
        unit = gain.unit if gain else ""
    else:
        unit = _UNITS.get(axis.key) or _UNITS.get(parts[-1], "")
    return f"{axis.key}, {unit}" if unit and unit != "-" else axis.key


_UNITS = {"at": "s", "until": "s", "delay": "s", "jitter": "s", "latency": "s", "duration": "s", "mission.V": "m/s",
          "wind.speed": "m/s", "effectiveness": "-", "loss": "-"}  # fmt: skip
