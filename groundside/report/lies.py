"""Report what UAVs told their neighbours that was not true: who, to whom, when, how far off; told beside true."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np

from ftcc.groundside.canvas import Look
from ftcc.groundside.palette import colors, hexadecimal
from ftcc.groundside.report.drawing import add_legend, folded, thinned
from ftcc.groundside.report.page import Cell, Head, Section
from ftcc.groundside.report.plates import Plates

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission

__all__ = ["lies_section"]

_LEGEND = 0.4
"""Height of a legend, in."""


def lies_section(lies: dict[str, Any], mission: Mission, plates: Plates) -> Section:
    """Return a table of what was false, a row per liar, listener and value, with a figure of told beside true.

    Parameters
    ----------
    lies : columns by name, see `Run.lies`.
    """
    units = {
        column.name.removeprefix("told_"): column.unit for column in mission.lie_columns if column.name[:5] == "told_"
    }
    false = [name for name in units if _is_false(lies, name).any()]
    rows = []
    for uav, receiver in sorted(set(zip(lies["uav"].tolist(), lies["receiver"].tolist(), strict=True))):
        own = (lies["uav"] == uav) & (lies["receiver"] == receiver)
        for name in false:
            of_value = own & _is_false(lies, name)
            if of_value.any():
                error = (lies[f"told_{name}"] - lies[f"true_{name}"])[of_value]
                greatest = error[np.argmax(np.abs(error))]
                t = lies["t"][of_value]
                rows.append(
                    [
                        Cell(f"UAV {uav}"),
                        Cell(f"UAV {receiver}" if receiver else "everybody"),
                        Cell(name),
                        Cell(f"{t[0]:g}"),
                        Cell(f"{t[-1]:g}"),
                        Cell(str(len(t))),
                        Cell(f"{greatest:+.4g} {units[name]}"),
                    ]
                )
    heads = [Head("records of"), Head("heard by"), Head("value"), Head("from, s", True), Head("to, s", True)]
    heads += [Head("false records", True), Head("greatest error", True)]
    before = [
        "What UAVs told their neighbours and was not true; they themselves flew by the truth. Of a single listener, "
        "true is what the sender sent. The events say of which kind the lies were."
    ]
    return Section(
        "attacks",
        "Attacks",
        before,
        svg=_drawn_beside_truth(lies, false, units, mission, plates),
        heads=heads,
        rows=rows,
    )


def _is_false(lies: dict[str, Any], name: str) -> Any:
    """Where a value was told that was not true; nan: it is not shared."""
    told, true = lies[f"told_{name}"], lies[f"true_{name}"]
    return (told != true) & np.isfinite(true)


def _drawn_beside_truth(
    lies: dict[str, Any], false: list[str], units: dict[str, str], mission: Mission, plates: Plates
) -> str:
    """Draw each value that was false: told solid, true dotted, in the colour of the UAV."""
    if not false:
        return ""
    tints = colors(mission.uavs)
    pairs = sorted(set(zip(lies["uav"].tolist(), lies["receiver"].tolist(), strict=True)))

    def draw(look: Look) -> Any:
        with plt.rc_context(look.style):
            size = (look.width, _LEGEND + len(false) * look.row)
            figure, panels = plt.subplots(len(false), sharex=True, squeeze=False, figsize=size, layout="constrained")
            lines = {}
            for axes, name in zip(panels[:, 0], false, strict=True):
                for uav, receiver in pairs:
                    own = (lies["uav"] == uav) & (lies["receiver"] == receiver)
                    t, told, true = (lies[column][own] for column in ("t", f"told_{name}", f"true_{name}"))
                    if not np.isfinite(true).any():
                        continue
                    label = f"UAV {uav} to {receiver}" if receiver else f"UAV {uav}"
                    color = hexadecimal(tints[uav])
                    (lines[label],) = axes.plot(*thinned(t, told), color=color, label=label)
                    axes.plot(*thinned(t, true), color=color, linestyle=":")
                axes.set_ylabel(folded(f"{name}, {units[name]}", look))
                axes.margins(x=0.01)
            panels[-1, 0].set_xlabel("t, s")
            figure.align_ylabels()
            add_legend(figure, list(lines.values()), look)
        return figure

    drawn = plates.add("attacks", "Told (solid) and true (dotted)", "", draw)
    return "" if drawn is None else drawn.svg
