"""The swarm in space, and its communication graph: what the dashboard draws of a snapshot that is not a curve.

The world's axes are east, north and up, which are right-handed; x (north) and y (east) of the snapshot change places.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from ftcc.groundside.dashboard.viewer import Entry
from ftcc.groundside.palette import CUT, FRESH, GRAY, STALE, Color, colors
from ftcc.groundside.snapshot import LinkState, Snapshot, UavState
from ftcc.link.graph import Graph
from ftcc.sim.plant import TRUTH
from ftcc.sim.sensors import STATE_MESSAGE, encode_state

__all__ = ["LANE", "TRAIL", "Scene", "faults", "name"]

TRAIL = 5.0
"""Length of the trails, s."""
LANE = 12.0
"""Distance at which aircraft that fly above one another are drawn side by side, m."""

# Airframe, m: x forward, y right, z down; corners of flat parts, each a fan of triangles.
_SPAN = 3.24
_PARTS = (
    ((0.15, 0.0, 0.0), (0.02, 1.62, -0.1), (-0.3, 1.62, -0.1), (-0.4, 0.0, 0.0)),
    ((0.15, 0.0, 0.0), (-0.4, 0.0, 0.0), (-0.3, -1.62, -0.1), (0.02, -1.62, -0.1)),
    ((-0.95, 0.0, -0.05), (-1.05, 0.55, -0.05), (-1.25, 0.55, -0.05), (-1.3, 0.0, -0.05)),
    ((-0.95, 0.0, -0.05), (-1.3, 0.0, -0.05), (-1.25, -0.55, -0.05), (-1.05, -0.55, -0.05)),
    ((-0.8, 0.0, -0.05), (-1.15, 0.0, -0.55), (-1.35, 0.0, -0.55), (-1.3, 0.0, -0.05)),
)
_BODY = ((1.0, 0.0, 0.0), 0.3, 0.14, (-1.3, 0.0, -0.05))
"""Nose, station and half-width of the thickest section, tail."""

_NORTH_TO_WORLD = (0.0, math.sqrt(0.5), math.sqrt(0.5), 0.0)
"""Rotation from north-east-down to east-north-up as a quaternion, scalar first."""


def name(uav: int) -> str:
    """What a UAV is called everywhere."""
    return f"UAV {uav}"


def faults(uav: UavState) -> str:
    """The actuators that do not act as commanded, in words; empty if all do."""
    words = []
    for actuator, effectiveness in uav.effectiveness.items():
        bias = uav.bias.get(actuator, 0.0)
        if effectiveness != 1.0 or bias != 0.0:
            words.append(f"{actuator} {100.0 * effectiveness:.0f} %" + (f" {bias:+.2g}" if bias else ""))
    return ", ".join(words)


class Scene:
    """Draws the swarm around its centre, and the graph as a plan.

    The centre moves with the swarm, so that hundreds of metres of common forward flight do not carry it out of sight;
    positions in the data are the true ones, but for lanes: aircraft that share one vertical plane, as those of
    longitudinal schemes do, are moved east by `LANE` each.
    """

    def __init__(self, graph: Graph, leaders: Sequence[int], stale_after: float, first: Snapshot) -> None:
        self._uavs = sorted(graph.uavs)
        self._leaders = set(leaders)
        self._colors = colors(self._uavs)
        self._stale_after = stale_after
        self._edges = sorted((sender, receiver) for receiver, sender in graph.weights)
        self._index = {uav: i for i, uav in enumerate(self._uavs)}
        self._ends = np.array([(self._index[j], self._index[i]) for j, i in self._edges], dtype=int).reshape(-1, 2)
        self._lanes: NDArray[np.float64] = np.zeros(len(self._uavs))
        self._positions = np.full((len(self._uavs), 3), np.nan)
        self._place(first)
        if len(self._uavs) > 1 and np.nanmax(self._positions[:, 0]) - np.nanmin(self._positions[:, 0]) < 1.0:
            self._lanes += LANE * (np.arange(len(self._uavs)) - 0.5 * (len(self._uavs) - 1))
            self._place(first)
        seen = self._positions[np.isfinite(self._positions[:, 0])]
        self._centre: NDArray[np.float64] = seen.mean(axis=0) if len(seen) else np.zeros(3)
        self._radius = max(30.0, float(np.linalg.norm(seen - self._centre, axis=1).max(initial=0.0)))
        apart = np.linalg.norm(seen[:, None] - seen[None], axis=2)[~np.eye(len(seen), dtype=bool)]
        room = min(0.9 * float(apart.min(initial=np.inf)), 0.3 * self._radius)
        self._scale = max(1, round(room / _SPAN))
        self._plan = _plan(graph, self._leaders)
        plan = np.array([self._plan[uav] for uav in self._uavs])
        self._plan_origins, self._plan_vectors = _arrows(plan[self._ends[:, 0]], plan[self._ends[:, 1]], 0.16, 0.035)
        self._labels: dict[int, str] = {}
        self._tints: list[Color] = []
        self._troubles: list[str] = []
        self._message = np.zeros(len(STATE_MESSAGE))

    @property
    def title(self) -> str:
        """What the view shows, for its name."""
        notes = [f"airframes x{self._scale}"] if self._scale > 1 else []
        notes += [f"side by side at {LANE:g} m"] if self._lanes.any() else []
        notes += ["frames: lowest and highest leader"] if self._leaders else []
        return "Swarm about its moving centre" + (f" ({', '.join(notes)})" if notes else "")

    def view(self) -> rrb.Spatial3DView:
        """The swarm from behind, right and above."""
        eye = self._radius * np.array([0.5, -1.5, 0.75])
        return rrb.Spatial3DView(
            origin="/world/centre",
            contents="/world/**",
            name=self.title,
            eye_controls=rrb.EyeControls3D(
                kind=rrb.Eye3DKind.Orbital, position=eye, look_target=(0.0, 0.0, -0.05 * self._radius), eye_up=(0, 0, 1)
            ),
            line_grid=rrb.LineGrid3D(visible=False),
            overrides={
                "/world/trails": [
                    rrb.VisibleTimeRanges(
                        timeline="t",
                        start=rrb.TimeRangeBoundary.cursor_relative(seconds=-TRAIL),
                        end=rrb.TimeRangeBoundary.cursor_relative(),
                    )
                ]
            },
        )

    def plan_view(self) -> rrb.Spatial2DView:
        """Who hears whom."""
        return rrb.Spatial2DView(
            origin="/graph",
            name="Links (gray fresh, amber stale, red cut)",
            visual_bounds=rrb.VisualBounds2D(x_range=(-1.9, 1.9), y_range=(-1.9, 1.9)),
        )

    def static(self) -> list[Entry]:
        """Shapes and colours."""
        tints = [self._colors[uav] for uav in self._uavs]
        entries = [Entry("/world", None, rr.ViewCoordinates.RIGHT_HAND_Z_UP)]
        vertices, normals = _airframe(self._scale)
        for uav in self._uavs:
            shape = rr.Mesh3D(vertex_positions=vertices, vertex_normals=normals, albedo_factor=self._colors[uav])
            entries.append(Entry(f"/world/uav/{uav}/airframe", None, shape))
            above = rr.Points3D(
                (0.0, 0.0, -0.55 * self._scale * _SPAN), colors=self._colors[uav], radii=rr.Radius.ui_points(0.5)
            )
            entries.append(Entry(f"/world/uav/{uav}/label", None, above))
        width = rr.Radius.ui_points(0.75)
        entries += [
            Entry("/world/trails", None, rr.LineStrips3D.from_fields(colors=tints, radii=width)),
            Entry("/world/hull", None, rr.LineStrips3D.from_fields(colors=GRAY, radii=rr.Radius.ui_points(1.0))),
        ]
        return entries + self._static_plan(tints)

    def _static_plan(self, tints: list[Color]) -> list[Entry]:
        nodes = rr.Points2D(
            [self._plan[uav] for uav in self._uavs],
            colors=tints,
            radii=rr.Radius.ui_points(7.0),
            labels=[self._name(uav) for uav in self._uavs],
            show_labels=True,
            draw_order=20.0,
        )
        entries = [Entry("/graph/uavs", None, nodes)]
        if self._edges:
            arrows = rr.Arrows2D.from_fields(origins=self._plan_origins, vectors=self._plan_vectors)
            entries.append(Entry("/graph/links", None, arrows))
        return entries

    def draw(self, snapshot: Snapshot) -> list[Entry]:
        """Everything that moves."""
        t = snapshot.t
        before = self._positions.copy()
        self._place(snapshot)
        after = self._positions
        seen = np.isfinite(after[:, 0])
        if seen.any():
            self._centre = after[seen].mean(axis=0)
        entries = [Entry("/world/centre", t, rr.Transform3D(translation=self._centre))]
        for uav, state in snapshot.uavs.items():
            if uav in self._index and np.isfinite(self._positions[self._index[uav], 0]):
                pose = rr.Transform3D(translation=after[self._index[uav]], quaternion=self._attitude(state))
                entries.append(Entry(f"/world/uav/{uav}", t, pose))
        before = np.where(np.isfinite(before), before, after)
        entries.append(Entry("/world/trails", t, rr.LineStrips3D.from_fields(strips=np.stack([before, after], axis=1))))
        for uav in self._uavs:
            label = self._label(uav, snapshot)
            if label != self._labels.get(uav):
                self._labels[uav] = label
                text = rr.Points3D.from_fields(labels=label, show_labels=True)
                entries.append(Entry(f"/world/uav/{uav}/label", t, text))
        entries += self._hull(t)
        entries += self._links(snapshot)
        return entries

    def _place(self, snapshot: Snapshot) -> None:
        for uav, state in snapshot.uavs.items():
            if uav not in self._index:
                continue
            i = self._index[uav]
            here = (state.truth["y"] + self._lanes[i], state.truth["x"], state.truth["z"])
            if all(map(math.isfinite, here)):
                self._positions[i] = here

    def _attitude(self, state: UavState) -> rr.Quaternion:
        encode_state(np.array([state.truth.get(field, 0.0) for field in TRUTH]), self._message)
        w, x, y, z = _times(_NORTH_TO_WORLD, self._message[:4])
        return rr.Quaternion(xyzw=(x, y, z, w))

    def _name(self, uav: int) -> str:
        return name(uav) + (" leader" if uav in self._leaders else "")

    def _label(self, uav: int, snapshot: Snapshot) -> str:
        label = self._name(uav)
        state = snapshot.uavs.get(uav)
        if state is None:
            return f"{label}: not heard"
        if snapshot.t - state.t > 1.0:
            return f"{label}: silent since {state.t:.0f} s"
        broken = faults(state)
        return f"{label}: {broken}" if broken else label

    def _hull(self, t: float) -> list[Entry]:
        """The lowest and highest leader's altitude as two frames around the swarm."""
        z = [self._positions[self._index[uav], 2] for uav in self._leaders]
        seen = self._positions[np.isfinite(self._positions[:, 0])]
        if not z or not np.all(np.isfinite(z)):
            return []
        low, high = seen.min(axis=0) - 0.5 * LANE, seen.max(axis=0) + 0.5 * LANE
        frame = np.array([(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1]), (low[0], low[1])])
        strips = np.stack([np.column_stack([frame, np.full(5, level)]) for level in (min(z), max(z))])
        return [Entry("/world/hull", t, rr.LineStrips3D.from_fields(strips=strips))]

    def _links(self, snapshot: Snapshot) -> list[Entry]:
        if not self._edges:
            return []
        t = snapshot.t
        start, end = self._positions[self._ends[:, 0]], self._positions[self._ends[:, 1]]
        gap = 0.5 * self._scale * _SPAN
        origins, vectors = _arrows(start, end, gap, 0.12 * gap)
        entries = [Entry("/world/links", t, rr.Arrows3D.from_fields(origins=origins, vectors=vectors))]
        links = [_link(snapshot.uavs, sender, receiver) for sender, receiver in self._edges]
        tints = [self._color(link) for link in links]
        if tints != self._tints:
            self._tints = tints
            widths = rr.Radius.ui_points([1.0 if tint == FRESH else 2.0 for tint in tints])
            entries.append(Entry("/world/links", t, rr.Arrows3D.from_fields(colors=tints, radii=widths)))
            entries.append(Entry("/graph/links", t, rr.Arrows2D.from_fields(colors=tints, radii=widths)))
        troubles = ["" if tint == FRESH else _trouble(link) for tint, link in zip(tints, links, strict=True)]
        if troubles != self._troubles:
            self._troubles = troubles
            which = [i for i, text in enumerate(troubles) if text]
            notes = rr.Points2D(
                # Nearer to the receiver, so that the texts of two directions do not cover each other.
                (self._plan_origins + 0.6 * self._plan_vectors)[which],
                labels=[troubles[i] for i in which],
                show_labels=True,
                colors=[tints[i] for i in which],
                radii=rr.Radius.ui_points(1.0),
            )
            entries.append(Entry("/graph/troubles", t, notes))
        return entries

    def _color(self, link: LinkState | None) -> Color:
        if link is not None and link.cut:
            return CUT
        return FRESH if link is not None and link.age <= self._stale_after else STALE


def _link(uavs: Mapping[int, UavState], sender: int, receiver: int) -> LinkState | None:
    state = uavs.get(receiver)
    return state.links.get(sender) if state is not None else None


def _trouble(link: LinkState | None) -> str:
    if link is None or math.isinf(link.age):
        return "cut, never heard" if link is not None and link.cut else "not heard yet"
    # Whole seconds, so that the text changes rarely.
    return ("cut, " if link.cut else "") + f"{math.floor(link.age)} s old"


def _times(a: Sequence[float], b: Sequence[float] | NDArray[np.float64]) -> tuple[float, float, float, float]:
    """Product of two quaternions, scalar first."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


def _arrows(
    start: NDArray[np.float64], end: NDArray[np.float64], gap: float, aside: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Origins and vectors of arrows that leave room at both ends and keep to the right of the straight line."""
    along = end - start
    length = np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    ahead = along / length
    right = np.zeros_like(ahead)
    right[:, 0], right[:, 1] = ahead[:, 1], -ahead[:, 0]
    gap_here = np.minimum(gap, 0.3 * length)
    origins = start + gap_here * ahead + aside * right
    return origins, along - 2.0 * gap_here * ahead


def _airframe(scale: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Vertices and normals, shape (n, 3), three vertices to a triangle."""
    triangles = [(part[0], part[i], part[i + 1]) for part in _PARTS for i in range(1, len(part) - 1)]
    nose, station, half, tail = _BODY
    ring = [(station, half * math.cos(a), half * math.sin(a)) for a in np.arange(6) * math.pi / 3.0]
    for i in range(6):
        triangles += [(nose, ring[i], ring[(i + 1) % 6]), (tail, ring[(i + 1) % 6], ring[i])]
    corners = np.array(triangles, dtype=np.float32)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return scale * corners.reshape(-1, 3), np.repeat(normals, 3, axis=0).astype(np.float32)


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
