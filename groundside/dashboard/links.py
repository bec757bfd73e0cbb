"""Draw the communication graph: arrows from sender to receiver, coloured by the state of the link."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from ftcc.groundside.dashboard.detail import Detail
from ftcc.groundside.dashboard.labels import describe_silence
from ftcc.groundside.dashboard.shapes import arrows
from ftcc.groundside.dashboard.snapshot import LinkState, Snapshot, UavState
from ftcc.groundside.dashboard.subject import Subject
from ftcc.groundside.dashboard.viewer import Entry
from ftcc.groundside.palette import CUT, DOUBTED, FRESH, STALE, colors
from ftcc.link.graph import Graph

__all__ = ["Links"]

_FRESH, _STALE, _DOUBTED, _CUT = range(4)
_TINTS = np.array([FRESH, STALE, DOUBTED, CUT], np.uint8)
"""States of an edge, the best first, and their colours."""
_NOTES = 8
"""Largest number of notes in the graph of a big swarm."""
_NOTE_OFFSET = 0.2
"""Distance of a note from its arrow; the circle of followers has radius 1."""
_LOSSY = 0.01
"""Share of lost records from which an edge has a note."""
_LITTLE_TRUST = 0.5
"""Trust below which an edge is drawn as doubted."""
_LOSS_MEMORY = 20.0
"""Time constant over which the loss is averaged, in snapshots; it follows changes within seconds."""


class Links:
    """Draws the edges between the aircraft, and as a graph in a view of its own."""

    def __init__(self, subject: Subject, detail: Detail) -> None:
        self._subject = subject
        self._detail = detail
        self._named: list[int] = []
        graph = subject.graph
        self._uavs = sorted(graph.uavs)
        self._edges = sorted((sender, receiver) for receiver, sender in graph.weights)
        self._receivers = Counter(sender for sender, _ in self._edges)
        """How many receivers a sender has."""
        index = {uav: i for i, uav in enumerate(self._uavs)}
        self._ends = np.array([(index[j], index[i]) for j, i in self._edges], dtype=int).reshape(-1, 2)
        self._layout = _layout(graph, set(subject.leaders))
        layout = np.array([self._layout[uav] for uav in self._uavs])
        self._layout_origins, self._layout_vectors = arrows(
            layout[self._ends[:, 0]], layout[self._ends[:, 1]], 0.16, 0.035
        )
        x, y = self._layout_vectors.T / np.linalg.norm(self._layout_vectors, axis=1)
        self._layout_notes = (
            self._layout_origins + 0.62 * self._layout_vectors + _NOTE_OFFSET * np.column_stack((y, -x))
        )
        """Positions of notes, near the receiver and beside the arrow, so that both directions do not overlap."""
        self._all = np.arange(len(self._edges))
        self._states = np.full(len(self._edges), -1)
        """State of each edge in the previous snapshot, as an index of `_TINTS`."""
        self._drawn: NDArray[np.intp] = np.zeros(0, np.intp)
        """Edges drawn between the aircraft."""
        self._notes: dict[int, str] | None = None
        """Notes by edge; None before the first snapshot."""
        self._counted = np.zeros((len(self._edges), 2))
        self._recent = np.zeros((len(self._edges), 2))
        """Records received and lost on each edge, averaged over `_LOSS_MEMORY`."""

    def view(self) -> rrb.Spatial2DView:
        """Return the view of the graph."""
        return rrb.Spatial2DView(
            origin="/graph",
            name="Links (amber stale, violet distrusted, red cut; age, share lost)",
            visual_bounds=rrb.VisualBounds2D(x_range=(-1.9, 1.9), y_range=(-1.9, 1.9)),
        )

    def static(self) -> list[Entry]:
        """Return the nodes and arrows of the graph."""
        tints = colors(self._uavs)
        crowded = self._detail.crowded
        names = {} if crowded else {"labels": [self._name(uav) for uav in self._uavs], "show_labels": True}
        nodes = rr.Points2D(
            [self._layout[uav] for uav in self._uavs],
            colors=[tints[uav] for uav in self._uavs],
            radii=rr.Radius.ui_points(3.0 if crowded else 7.0),
            draw_order=20.0,
            **names,
        )
        entries = [Entry("/graph/uavs", None, nodes)]
        if self._edges:
            shafts = rr.Arrows2D.from_fields(origins=self._layout_origins, vectors=self._layout_vectors)
            entries.append(Entry("/graph/links", None, shafts))
        return entries

    def draw(self, snapshot: Snapshot, positions: NDArray[np.float64], gap: float) -> list[Entry]:
        """Return the edges between aircraft at ``positions`` (n, 3), ``gap`` (m) away from them, and in the graph."""
        if not self._edges:
            return []
        t = snapshot.t
        links = [_link(snapshot.uavs, sender, receiver) for sender, receiver in self._edges]
        states = np.array([self._state(link) for link in links])
        drawn = self._visible_edges(states)
        ends = positions[self._ends[drawn]]
        origins, vectors = arrows(ends[:, 0], ends[:, 1], gap, 0.12 * gap)
        entries = [Entry("/world/links", t, rr.Arrows3D.from_fields(origins=origins, vectors=vectors))]
        changed = (states != self._states).any()
        if changed or (drawn is not self._drawn and not np.array_equal(drawn, self._drawn)):
            tints, widths = self._style(states[drawn])
            entries.append(Entry("/world/links", t, rr.Arrows3D.from_fields(colors=tints, radii=widths)))
        if changed:
            tints, widths = self._style(states)
            entries.append(Entry("/graph/links", t, rr.Arrows2D.from_fields(colors=tints, radii=widths)))
        self._states, self._drawn = states, drawn
        return entries + self._draw_notes(snapshot, links) + self._draw_names()

    def _state(self, link: LinkState | None) -> int:
        if link is not None and link.cut:
            return _CUT
        if link is not None and link.trust < _LITTLE_TRUST:
            return _DOUBTED
        return _FRESH if link is not None and link.age <= self._subject.stale_after else _STALE

    def _style(self, states: NDArray[np.int_]) -> tuple[NDArray[np.uint8], rr.components.RadiusBatch]:
        """Return colours and widths of edges."""
        thin = 0.5 if self._detail.crowded else 1.0
        return _TINTS[states], rr.Radius.ui_points(np.where(states == _FRESH, thin, 2.0))

    def _visible_edges(self, states: NDArray[np.int_]) -> NDArray[np.intp]:
        """Return the edges to draw between aircraft: in a big swarm those of UAVs in full, and stale or cut ones."""
        if not self._detail.crowded:
            return self._all
        full = np.isin(self._uavs, self._detail.shown)
        return np.flatnonzero(full[self._ends].all(axis=1) | (states != _FRESH))

    def _draw_notes(self, snapshot: Snapshot, links: list[LinkState | None]) -> list[Entry]:
        """Return notes at stale, cut and lossy edges; in a big swarm one per receiver, and at most `_NOTES`.

        A sender whom at least half of its receivers distrust has one, at the first such edge. W-MSR leaves out
        somebody on nearly every edge: there the colour, and the table of the swarm, must do.
        """
        loss = self._loss(links)
        notes: dict[int, str] = {}
        receivers: set[int] = set()
        liars: set[int] = set()
        doubts = Counter(self._edges[edge][0] for edge in np.flatnonzero(self._states == _DOUBTED).tolist())
        wrong = np.flatnonzero((self._states != _FRESH) | (loss > _LOSSY))
        if self._detail.crowded:
            wrong = wrong[np.argsort(-self._states[wrong], kind="stable")]
        for edge in wrong.tolist():
            sender, receiver = self._edges[edge]
            if _receiver_silent(receiver, snapshot) or (self._detail.crowded and receiver in receivers):
                continue
            if self._states[edge] == _DOUBTED:
                if sender in liars or 2 * doubts[sender] < self._receivers[sender]:
                    continue
                liars.add(sender)
            notes[edge] = _note(links[edge], int(self._states[edge]), float(loss[edge]))
            receivers.add(receiver)
            if self._detail.crowded and len(notes) >= _NOTES:
                break
        if notes == self._notes:
            return []
        self._notes = notes
        which = list(notes)
        texts = rr.Points2D(
            self._layout_notes[which],
            labels=list(notes.values()),
            show_labels=True,
            colors=_TINTS[self._states[which]],
            radii=rr.Radius.ui_points(1.0),
        )
        return [Entry("/graph/notes", snapshot.t, texts)]

    def _draw_names(self) -> list[Entry]:
        """Return the names in the graph of a big swarm: those of UAVs drawn in full."""
        if not self._detail.crowded or self._named == self._detail.shown:
            return []
        self._named = list(self._detail.shown)
        tints = colors(self._uavs)
        names = rr.Points2D(
            [self._layout[uav] for uav in self._named],
            colors=[tints[uav] for uav in self._named],
            radii=rr.Radius.ui_points(6.0),
            labels=[self._name(uav) for uav in self._named],
            show_labels=True,
            draw_order=21.0,
        )
        return [Entry("/graph/names", None, names)]

    def _name(self, uav: int) -> str:
        return f"UAV {uav}" + (" leader" if uav in self._subject.leaders else "")

    def _loss(self, links: list[LinkState | None]) -> NDArray[np.float64]:
        """Return the recent share of lost records of each edge."""
        now = np.array([(link.received, link.lost) if link is not None else (0, 0) for link in links], float)
        self._recent += np.maximum(now - self._counted, 0.0) - self._recent / _LOSS_MEMORY
        self._counted = now
        total = self._recent.sum(axis=1)
        share: NDArray[np.float64] = np.divide(self._recent[:, 1], total, out=np.zeros(len(links)), where=total > 0.5)
        return share


def _link(uavs: Mapping[int, UavState], sender: int, receiver: int) -> LinkState | None:
    state = uavs.get(receiver)
    return state.links.get(sender) if state is not None else None


def _receiver_silent(receiver: int, snapshot: Snapshot) -> bool:
    """Return whether a UAV that sent telemetry has fallen silent, so that the state of its links is unknown."""
    state = snapshot.uavs.get(receiver)
    return state is not None and bool(describe_silence(state, snapshot))


def _note(link: LinkState | None, state: int, loss: float) -> str:
    """Describe the problem of an edge, rounded so that the text changes rarely."""
    if state == _FRESH:
        return f"{10 * round(10.0 * loss)} %" if loss > 0.05 else "1 %"
    if link is None or math.isinf(link.age):
        return "cut, none received" if link is not None and link.cut else "none received"
    if state == _DOUBTED:
        return f"trust {math.floor(10.0 * link.trust) / 10.0:g}"
    return ("cut, " if link.cut else "") + f"{math.floor(link.age)} s"


def _layout(graph: Graph, leaders: set[int]) -> dict[int, tuple[float, float]]:
    """Return positions in the graph: followers on a circle, leaders outside near their receivers; y is down."""
    ring = [uav for uav in sorted(graph.uavs) if uav not in leaders] or sorted(graph.uavs)
    angles = {uav: -0.5 * math.pi + 2.0 * math.pi * i / len(ring) for i, uav in enumerate(ring)}
    places = {uav: (math.cos(a), math.sin(a)) for uav, a in angles.items()}
    taken: list[float] = []
    apart = min(0.4, 0.7 * math.pi / max(1, len(leaders)))
    for leader in sorted(leaders - set(ring)):
        receivers = [places[uav] for uav in graph.receivers(leader) if uav in places]
        angle = math.atan2(sum(y for _, y in receivers), sum(x for x, _ in receivers)) if receivers else -0.5 * math.pi
        while any(abs(math.remainder(angle - other, 2.0 * math.pi)) < apart for other in taken):
            angle += 0.5 * apart
        taken.append(angle)
        places[leader] = (1.55 * math.cos(angle), 1.55 * math.sin(angle))
    return places
