"""The communication graph: arrows from whom is heard to who hears, coloured by what comes through."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from ftcc.groundside.dashboard.shapes import arrows
from ftcc.groundside.dashboard.subject import Subject
from ftcc.groundside.dashboard.viewer import Entry
from ftcc.groundside.dashboard.words import silent_since
from ftcc.groundside.palette import CUT, FRESH, STALE, Color, colors
from ftcc.groundside.snapshot import LinkState, Snapshot, UavState
from ftcc.link.graph import Graph

__all__ = ["Links"]

_ASIDE = 0.2
"""Distance of a note from its arrow; the circle of followers has radius 1."""
_LOSSY = 0.01
"""Share of lost records from which it is written at an edge."""
_FORGET = 20.0
"""Memory of the loss that is written, in snapshots: it follows changes within seconds."""


class Links:
    """Draws the edges among the aircraft and in a plan of their own."""

    def __init__(self, subject: Subject) -> None:
        self._subject = subject
        graph = subject.graph
        self._uavs = sorted(graph.uavs)
        self._edges = sorted((sender, receiver) for receiver, sender in graph.weights)
        index = {uav: i for i, uav in enumerate(self._uavs)}
        self._ends = np.array([(index[j], index[i]) for j, i in self._edges], dtype=int).reshape(-1, 2)
        self._plan = _plan(graph, set(subject.leaders))
        plan = np.array([self._plan[uav] for uav in self._uavs])
        self._plan_origins, self._plan_vectors = arrows(plan[self._ends[:, 0]], plan[self._ends[:, 1]], 0.16, 0.035)
        x, y = self._plan_vectors.T / np.linalg.norm(self._plan_vectors, axis=1)
        self._plan_notes = self._plan_origins + 0.62 * self._plan_vectors + _ASIDE * np.column_stack((y, -x))
        """Nearer to who hears, and beside the arrow: those of the two directions stand apart."""
        self._tints: list[Color] = []
        self._notes: list[str] = []
        self._counted = np.zeros((len(self._edges), 2))
        self._recent = np.zeros((len(self._edges), 2))
        """Records received and lost of late, of each edge."""

    def view(self) -> rrb.Spatial2DView:
        """Who hears whom."""
        return rrb.Spatial2DView(
            origin="/graph",
            name="Links (amber stale, red cut; age, share lost)",
            visual_bounds=rrb.VisualBounds2D(x_range=(-1.9, 1.9), y_range=(-1.9, 1.9)),
        )

    def static(self) -> list[Entry]:
        """The plan: who stands where."""
        tints = colors(self._uavs)
        leaders = self._subject.leaders
        nodes = rr.Points2D(
            [self._plan[uav] for uav in self._uavs],
            colors=[tints[uav] for uav in self._uavs],
            radii=rr.Radius.ui_points(7.0),
            labels=[f"UAV {uav}" + (" leader" if uav in leaders else "") for uav in self._uavs],
            show_labels=True,
            draw_order=20.0,
        )
        entries = [Entry("/graph/uavs", None, nodes)]
        if self._edges:
            shafts = rr.Arrows2D.from_fields(origins=self._plan_origins, vectors=self._plan_vectors)
            entries.append(Entry("/graph/links", None, shafts))
        return entries

    def draw(self, snapshot: Snapshot, positions: NDArray[np.float64], gap: float) -> list[Entry]:
        """The edges between aircraft at ``positions`` (n, 3), ``gap`` away from them, and their state in the plan."""
        if not self._edges:
            return []
        t = snapshot.t
        origins, vectors = arrows(positions[self._ends[:, 0]], positions[self._ends[:, 1]], gap, 0.12 * gap)
        entries = [Entry("/world/links", t, rr.Arrows3D.from_fields(origins=origins, vectors=vectors))]
        links = [_link(snapshot.uavs, sender, receiver) for sender, receiver in self._edges]
        tints = [self._color(link) for link in links]
        if tints != self._tints:
            self._tints = tints
            widths = rr.Radius.ui_points([1.0 if tint == FRESH else 2.0 for tint in tints])
            entries.append(Entry("/world/links", t, rr.Arrows3D.from_fields(colors=tints, radii=widths)))
            entries.append(Entry("/graph/links", t, rr.Arrows2D.from_fields(colors=tints, radii=widths)))
        loss = self._loss(links)
        notes = [
            "" if _silent(receiver, snapshot) else _note(link, tint, share)
            for (_, receiver), link, tint, share in zip(self._edges, links, tints, loss, strict=True)
        ]
        if notes != self._notes:
            self._notes = notes
            which = [i for i, text in enumerate(notes) if text]
            texts = rr.Points2D(
                self._plan_notes[which],
                labels=[notes[i] for i in which],
                show_labels=True,
                colors=[tints[i] for i in which],
                radii=rr.Radius.ui_points(1.0),
            )
            entries.append(Entry("/graph/notes", t, texts))
        return entries

    def _color(self, link: LinkState | None) -> Color:
        if link is not None and link.cut:
            return CUT
        return FRESH if link is not None and link.age <= self._subject.stale_after else STALE

    def _loss(self, links: list[LinkState | None]) -> list[float]:
        """Share of the records of each edge that were lost of late."""
        now = np.array([(link.received, link.lost) if link is not None else (0, 0) for link in links], float)
        self._recent += np.maximum(now - self._counted, 0.0) - self._recent / _FORGET
        self._counted = now
        total = self._recent.sum(axis=1)
        return np.divide(self._recent[:, 1], total, out=np.zeros(len(links)), where=total > 0.5).tolist()  # type: ignore[no-any-return]


def _link(uavs: Mapping[int, UavState], sender: int, receiver: int) -> LinkState | None:
    state = uavs.get(receiver)
    return state.links.get(sender) if state is not None else None


def _silent(receiver: int, snapshot: Snapshot) -> bool:
    """Whether a UAV that was heard tells no more, so that nobody knows what it hears."""
    state = snapshot.uavs.get(receiver)
    return state is not None and bool(silent_since(state, snapshot))


def _note(link: LinkState | None, tint: Color, loss: float) -> str:
    """What is wrong with an edge. Rounded, so that the text changes rarely."""
    if tint == FRESH:
        return f"{10 * round(10.0 * loss)} %" if loss > 0.05 else ("1 %" if loss > _LOSSY else "")
    if link is None or math.isinf(link.age):
        return "cut, never heard" if link is not None and link.cut else "not heard yet"
    return ("cut, " if link.cut else "") + f"{math.floor(link.age)} s"


def _plan(graph: Graph, leaders: set[int]) -> dict[int, tuple[float, float]]:
    """Followers on a circle, leaders outside it near those who hear them; y is down."""
    ring = [uav for uav in sorted(graph.uavs) if uav not in leaders] or sorted(graph.uavs)
    angles = {uav: -0.5 * math.pi + 2.0 * math.pi * i / len(ring) for i, uav in enumerate(ring)}
    places = {uav: (math.cos(a), math.sin(a)) for uav, a in angles.items()}
    taken: list[float] = []
    for leader in sorted(leaders - set(ring)):
        heard_at = [places[uav] for uav in graph.receivers(leader) if uav in places]
        angle = math.atan2(sum(y for _, y in heard_at), sum(x for x, _ in heard_at)) if heard_at else -0.5 * math.pi
        while any(abs(math.remainder(angle - other, 2.0 * math.pi)) < 0.4 for other in taken):
            angle += 0.2
        taken.append(angle)
        places[leader] = (1.55 * math.cos(angle), 1.55 * math.sin(angle))
    return places
