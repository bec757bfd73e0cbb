"""Link events of a scenario, as changes of each directed edge and each radio."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence

from ftcc.airside.spec import LinkEvent
from ftcc.groundside.schema import LinkEventFields
from ftcc.link.channel import Channel
from ftcc.link.graph import Graph

__all__ = ["link_changes", "link_texts"]


def _name(event: LinkEventFields) -> str:
    if event.edge is None:
        return "radio" if event.kind == "cut" else "all links"
    return f"link {event.edge[0]} {'->' if event.directed else '-'} {event.edge[1]}"


def link_texts(events: Sequence[LinkEventFields]) -> list[tuple[float, int | None, str]]:
    """Return begin and end of each event as (time s, UAV, text)."""
    texts: list[tuple[float, int | None, str]] = []
    for event in events:
        name = _name(event)
        if event.kind == "cut":
            begin, end = (
                (f"{name} off", f"{name} on again") if event.edge is None else (f"{name} cut", f"{name} restored")
            )
        else:
            changes = ", ".join(f"{key} {value:g}" for key, value in event.changes.items())
            begin, end = f"{name} degraded: {changes}", f"{name} as before"
        texts.append((event.at, event.uav, begin))
        if event.until is not None:
            texts.append((event.until, event.uav, end))
    return texts


def _edges(
    event: LinkEventFields,
    graph: Graph,
    pairs: Collection[tuple[int, int]],
    where: str,
    refuse: Callable[[str], None],
) -> list[tuple[int, int]]:
    """Return the directed edges (receiver, sender) that an event changes; [] for a radio that is off."""
    if event.uav is not None:
        if event.uav not in graph.uavs:
            refuse(f"{where}.uav = {event.uav}: there is no such UAV; UAVs are {', '.join(map(str, graph.uavs))}")
        return [pair for pair in pairs if event.uav in pair] if event.kind == "degrade" else []
    assert event.edge is not None
    sender, receiver = event.edge
    asked = [(receiver, sender)] if event.directed else [(receiver, sender), (sender, receiver)]
    found = [pair for pair in asked if pair in pairs]
    if not found:
        refuse(f"{where}.edge = {list(event.edge)}: there is no such edge in the graph")
    return found


def link_changes(
    events: Sequence[LinkEventFields],
    graph: Graph,
    more: Iterable[tuple[int, int]],
    base: Channel,
    refuse: Callable[[str], None],
) -> dict[int, list[LinkEvent]]:
    """Return the changes that each UAV applies to its radio and its in-edges, in order of time.

    Events may overlap. The quality of an edge is then the base quality, changed by all events that last at that time,
    in the order of the file. An edge is blocked while any cut lasts. ``more`` are edges (receiver, sender) beside those
    of the graph.
    """
    pairs = dict.fromkeys((*graph.weights, *more))
    touched: dict[tuple[int, int | None], list[LinkEventFields]] = {}
    for n, event in enumerate(events):
        edges = _edges(event, graph, pairs, f"link_events.{n}", refuse)
        if event.uav is not None and event.kind == "cut":
            touched.setdefault((event.uav, None), []).append(event)
        for receiver, sender in edges:
            touched.setdefault((receiver, sender), []).append(event)
    changes: dict[int, list[LinkEvent]] = {}
    for (uav, edge), own in touched.items():
        start = base if edge is not None else Channel()
        before = start
        for at in sorted({e.at for e in own} | {e.until for e in own if e.until is not None}):
            quality = start
            for event in own:
                if event.at <= at < (math.inf if event.until is None else event.until):
                    quality = quality._replace(**({"blocked": 1.0} if event.kind == "cut" else event.changes))
            if quality != before:
                changes.setdefault(uav, []).append(LinkEvent(round(at * 1e6), edge, quality))
                before = quality
    return {uav: sorted(own, key=lambda change: change.at_us) for uav, own in changes.items()}
