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

__all__ = ["links_section", "network_section"]


_SILENT = 1.0
"""Wall time without a transmission that is marked, s."""


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
        "delivered: missing in the mesh itself, which happens only on an overloaded computer or, on the wall clock, "
        "where the network between computers fails."
    ]
    return Section("links", "Links", before, svg=_ages(links, mission, plates), heads=heads, rows=rows)


def network_section(network: list[dict[str, Any]]) -> Section:
    """Return a table of what the network between computers did to each link of the mesh."""
    heads = [Head("from"), Head("to"), Head("transmissions", True), Head("missing", True), Head("mean delay, ms", True)]
    heads += [Head("longest delay, ms", True), Head("longest silence, s", True), Head("at, s", True)]
    before = [
        "The real network, in wall time; the emulated radio is counted under Links, in simulated time. A process is "
        "named by its first UAV. Delays compare the clocks of two computers. In lockstep the flight waits for the "
        "network, so nothing here changes what was flown; on the wall clock neighbours age."
    ]
    rows = []
    for sender, receiver in sorted({(one["sender"], one["receiver"]) for one in network}):
        of_link = [one for one in network if (one["sender"], one["receiver"]) == (sender, receiver)]
        received, missing = (sum(one[name] for one in of_link) for name in ("received", "missing"))
        delays = sum(one["delay"] * one["received"] for one in of_link)
        silence = max(of_link, key=lambda one: float(one["silence"]))
        rows.append(
            [
                Cell(f"UAV {sender}"),
                Cell(f"UAV {receiver}"),
                Cell(str(received)),
                Cell(str(missing), "warning" if missing else ""),
                Cell(f"{1e3 * delays / received:.2f}" if received else ""),
                Cell(f"{1e3 * max(one['longest_delay'] for one in of_link):.1f}"),
                Cell(f"{silence['silence']:.2f}", "warning" if silence["silence"] > _SILENT else ""),
                Cell(f"{silence['t']:g}"),
            ]
        )
    return Section("network", "Network between computers", before, heads=heads, rows=rows)


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
