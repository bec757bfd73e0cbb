"""Report who distrusted whom: a table of edges, and the trust in their senders over time."""

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

__all__ = ["trust_sections"]

_LITTLE = 0.5
"""Trust below which a sender counts as distrusted."""
_MOST_CURVES = 12


def trust_sections(links: dict[str, Any], mission: Mission, plates: Plates) -> list[Section]:
    """Return the section on trust, where the run has defences: every edge of which less than all is left."""
    if "trust" not in links or not any(spec.defence.on for spec in mission.autopilots):
        return []
    edges = []
    for receiver in mission.graph.followers:
        for sender in mission.graph.senders(receiver):
            of_edge = (links["uav"] == receiver) & (links["sender"] == sender)
            t, trust = links["t"][of_edge], links["trust"][of_edge]
            if len(t) and trust.min() < 1.0:
                edges.append((receiver, sender, t, trust))
    before = [
        "Share of its weight that the receiver's defences left a neighbour: what the gate and its credit leave it, and "
        "0 while its values are among the most extreme that W-MSR leaves out, averaged over some seconds. The most "
        "extreme of honest neighbours are left out as well."
    ]
    if not edges:
        return [Section("trust", "Trust", [*before, "Nobody was doubted."])]
    edges.sort(key=lambda edge: (float(edge[3].mean()), edge[:2]))
    heads = [Head("UAV"), Head("doubts"), Head("least trust", True), Head("mean trust", True)]
    heads += [Head("distrusted, % of the time", True), Head("first, s", True)]
    rows = [_row(*edge) for edge in edges]
    return [Section("trust", "Trust", before, svg=_curves(edges, mission, plates), heads=heads, rows=rows)]


def _row(receiver: int, sender: int, t: Any, trust: Any) -> list[Cell]:
    little = trust < _LITTLE
    first = f"{t[little][0]:g}" if little.any() else ""
    return [
        Cell(f"UAV {receiver}"),
        Cell(f"UAV {sender}"),
        Cell(f"{trust.min():.2f}", "warning" if little.any() else ""),
        Cell(f"{trust.mean():.2f}"),
        Cell(f"{100.0 * little.mean():.0f}"),
        Cell(first),
    ]


def _curves(edges: list[Any], mission: Mission, plates: Plates) -> str:
    """Draw the trust in the least trusted edges, in the colour of the sender."""
    tints = colors(mission.uavs)
    shown = [edge for edge in edges if edge[3].min() < _LITTLE][:_MOST_CURVES]
    curves = [
        (f"{receiver} in {sender}", hexadecimal(tints[sender]), t, np.asarray(trust))
        for receiver, sender, t, trust in shown
    ]
    if not curves:
        return ""

    def draw(look: Look) -> Any:
        return figure_of(curves, "trust", look)

    drawn = plates.add("trust", "Trust in neighbours", "", draw)
    return "" if drawn is None else drawn.svg
