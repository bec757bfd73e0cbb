"""Report the links of a run: a table of edges, and the age of received states."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ftcc.groundside.canvas import Look
from ftcc.groundside.palette import colors, hexadecimal
from ftcc.groundside.report.drawing import figure_of
from ftcc.groundside.report.page import Cell, Head, Section
from ftcc.groundside.report.plates import Plates

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission

__all__ = ["links_section"]


def links_section(links: dict[str, Any], mission: Mission, plates: Plates) -> Section:
    """Return a table of records sent, received and lost on each edge, and their age."""
    if not len(links["t"]):
        return Section("links", "Links", before=["The run recorded no links."])
    rows = []
    for receiver in mission.uavs:
        for sender in mission.graph.senders(receiver):
            of_edge = (links["uav"] == receiver) & (links["sender"] == sender)
            if of_edge.any():
                rows.append(_row(receiver, sender, {name: values[of_edge] for name, values in links.items()}))
    heads = [Head("from"), Head("to"), Head("sent", True), Head("received", True), Head("lost by the channel", True)]
    heads += [Head("not delivered", True), Head("mean age, s", True), Head("greatest age, s", True)]
    end = float(links["t"].max())
    before = [
        f"Counted by the receivers until {end:g} s. Lost: dropped by the emulated channel, including cuts. Not "
        "delivered: missing in the mesh itself, which happens only on an overloaded computer."
    ]
    return Section("links", "Links", before, svg=_ages(links, mission, plates), heads=heads, rows=rows)


def _row(receiver: int, sender: int, edge: dict[str, Any]) -> list[Cell]:
    sent, received, lost = (int(edge[name][-1]) for name in ("sent", "received", "lost"))
    missing = sent - received - lost
    share = f" ({100.0 * lost / sent:.1f} %)" if lost else ""
    known = np.isfinite(edge["age"])
    mean = f"{edge['age'][known].mean():.3f}" if known.any() else "none received"
    greatest = f"{edge['oldest'][known].max():.3f}" if known.any() else ""
    return [
        Cell(f"UAV {sender}"),
        Cell(f"UAV {receiver}"),
        Cell(str(sent)),
        Cell(str(received)),
        Cell(f"{lost}{share}", "warning" if lost else ""),
        Cell(str(missing), "error" if missing else ""),
        Cell(mean),
        Cell(greatest),
    ]


def _ages(links: dict[str, Any], mission: Mission, plates: Plates) -> str:
    """Draw the greatest age of neighbour states at each UAV over time."""
    tints = colors(mission.uavs)
    curves = []
    for uav in mission.uavs:
        own = links["uav"] == uav
        t = np.unique(links["t"][own])
        oldest = np.full(len(t), np.nan)
        np.fmax.at(oldest, np.searchsorted(t, links["t"][own]), links["oldest"][own])
        if np.isfinite(oldest).any():
            curves.append((f"UAV {uav}", hexadecimal(tints[uav]), t, oldest))
    if not curves:
        return ""

    def draw(look: Look) -> Any:
        return figure_of(curves, "greatest age received, s", look)

    drawn = plates.add("links", "Greatest age of received neighbour states", "", draw)
    return "" if drawn is None else drawn.svg
