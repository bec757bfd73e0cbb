"""Draw the attitudes of all aircraft side by side, each seen along its own course, with its reference as an outline."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from ftcc.groundside.dashboard.detail import Detail
from ftcc.groundside.dashboard.labels import label
from ftcc.groundside.dashboard.marks import HealthMarks
from ftcc.groundside.dashboard.shapes import SPAN, Poses, airframe, outline, stick_colors, sticks
from ftcc.groundside.dashboard.snapshot import Snapshot
from ftcc.groundside.dashboard.subject import Subject
from ftcc.groundside.dashboard.viewer import Entry
from ftcc.groundside.palette import colors
from ftcc.link.rotation import body_axes

__all__ = ["Attitudes"]

_SPACING, _RISE = 1.4 * SPAN, 0.7 * SPAN
"""Distance between aircraft of a row, and between rows, m."""
_RISE_CROWDED = 1.0 * SPAN
"""Distance between rows in a big swarm, where labels are large compared with the aircraft, m."""
_REFERENCES = {"mu": "mu_d", "alpha": "alpha_d", "beta": "beta_d"}
"""Signals that are attitude references, by the true state that they refer to."""


class Attitudes:
    """Draws the true attitude of every aircraft, with its course pointing away from the viewer.

    In attitude schemes aircraft may fly apart, so that their positions show little; what they agree on is attitude.
    Here each aircraft stands in a slot, not at its true position. Each slot is rotated with its line of sight, so that
    every aircraft is seen from straight behind and equal attitudes look equal.
    """

    title = "Attitudes, each along its own course (outlines: references; places are slots)"

    def __init__(self, subject: Subject, detail: Detail) -> None:
        self._detail = detail
        self._uavs = sorted(subject.graph.uavs)
        self._colors = colors(self._uavs)
        self._leaders = set(subject.leaders)
        rise = _RISE_CROWDED if detail.crowded else _RISE
        self._above = 0.45 * rise if detail.crowded else 0.3 * SPAN
        """Height of a label above its aircraft, m."""
        rows = math.ceil(math.sqrt(0.5 * len(self._uavs)))
        columns = math.ceil(len(self._uavs) / rows)
        self._slots = {
            uav: ((i % columns - 0.5 * (columns - 1)) * _SPACING, 0.0, (0.5 * (rows - 1) - i // columns) * rise)
            for i, uav in enumerate(self._uavs)
        }
        self._eye = 1.3 * max(rows * rise, 0.5 * columns * _SPACING) * np.array([0.0, -1.0, 0.3])
        self._turns = {
            uav: _rotation_between(-self._eye, np.array(slot) - self._eye) for uav, slot in self._slots.items()
        }
        places = {uav: np.array(slot) for uav, slot in self._slots.items() if uav not in self._leaders}
        self._places = places if subject.diagnosed else {}
        self._marks = HealthMarks("/attitudes/health", 0.12 * SPAN, 0.35 * SPAN)
        self._poses = Poses()
        self._labels: dict[int, str] = {}
        self._outlined: set[int] = set()
        """UAVs that have an outline."""
        self._others: list[int] = []
        """UAVs drawn as sticks in the previous snapshot."""

    def view(self) -> rrb.Spatial3DView:
        """Return the view of the slots, from behind and slightly above."""
        return rrb.Spatial3DView(
            origin="/attitudes",
            name=self.title,
            eye_controls=rrb.EyeControls3D(
                kind=rrb.Eye3DKind.Orbital, position=self._eye, look_target=(0.0, 0.0, 0.0), eye_up=(0, 0, 1)
            ),
            line_grid=rrb.LineGrid3D(visible=False),
        )

    def static(self) -> list[Entry]:
        """Return shapes, colours and slots."""
        return [Entry("/attitudes", None, rr.ViewCoordinates.RIGHT_HAND_Z_UP), *self._shapes(self._detail.shown)]

    def _shapes(self, uavs: Iterable[int]) -> list[Entry]:
        """Return the shapes of UAVs that are drawn in full."""
        entries = []
        vertices, normals = airframe(1.0)
        for uav in uavs:
            tint = self._colors[uav]
            shape = rr.Mesh3D(vertex_positions=vertices, vertex_normals=normals, albedo_factor=tint)
            x, y, z = self._slots[uav]
            above = rr.Points3D((x, y, z + self._above), colors=tint, radii=rr.Radius.ui_points(0.5))
            entries += [Entry(f"/attitudes/uav/{uav}", None, shape), Entry(f"/attitudes/label/{uav}", None, above)]
        return entries

    def draw(self, snapshot: Snapshot, new: Sequence[int] = ()) -> list[Entry]:
        """Return everything that moves; ``new`` are the UAVs that are drawn in full from now on."""
        entries = self._shapes(new) + self._sticks(snapshot)
        entries += self._marks.draw(snapshot, self._places, moving=False)
        for uav in self._detail.shown:
            text = label(uav, uav in self._leaders, snapshot)
            if text != self._labels.get(uav):
                self._labels[uav] = text
                entries.append(
                    Entry(f"/attitudes/label/{uav}", snapshot.t, rr.Points3D.from_fields(labels=text, show_labels=True))
                )
            state = snapshot.uavs.get(uav)
            if state is None:
                continue
            ahead = {**state.truth, "chi": 0.0}
            slot, turn = self._slots[uav], self._turns[uav]
            entries.append(Entry(f"/attitudes/uav/{uav}", snapshot.t, self._poses.of(slot, ahead, turn)))
            wanted = {name: state.signals.get(signal, math.nan) for name, signal in _REFERENCES.items()}
            if all(map(math.isfinite, wanted.values())):
                pose = self._poses.of(slot, {**ahead, **wanted}, turn)
                entries += self._draw_outline(uav)
                entries.append(Entry(f"/attitudes/reference/{uav}", snapshot.t, pose))
        return entries

    def _draw_outline(self, uav: int) -> list[Entry]:
        """Return the outline of a UAV with its first reference; before, it would have no position."""
        if uav in self._outlined:
            return []
        self._outlined.add(uav)
        shape = rr.LineStrips3D(outline(1.0), colors=self._colors[uav], radii=rr.Radius.ui_points(0.8))
        return [Entry(f"/attitudes/reference/{uav}", None, shape)]

    def _sticks(self, snapshot: Snapshot) -> list[Entry]:
        """Return all UAVs that are not drawn in full, as one entry."""
        if not self._detail.crowded:
            return []
        full = set(self._detail.shown)
        others = [uav for uav in self._uavs if uav not in full and uav in snapshot.uavs]
        places = np.array([self._slots[uav] for uav in others]).reshape(-1, 3)
        turns = np.array([body_axes(*self._turns[uav]) for uav in others]).reshape(-1, 3, 3).transpose(0, 2, 1)
        strips = sticks(places, [{**snapshot.uavs[uav].truth, "chi": 0.0} for uav in others], 1.0, turns)
        drawn = rr.LineStrips3D.from_fields(strips=strips)
        if others != self._others:
            self._others = others
            drawn = rr.LineStrips3D.from_fields(
                strips=strips, colors=stick_colors(self._colors, others), radii=rr.Radius.ui_points(1.0)
            )
        return [Entry("/attitudes/others", snapshot.t, drawn)]


def _rotation_between(before: NDArray[np.float64], after: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """Return the shortest rotation from one direction to another, not opposite one, as a quaternion."""
    a, b = before / np.linalg.norm(before), after / np.linalg.norm(after)
    q = np.array([1.0 + a @ b, *np.cross(a, b)])
    w, x, y, z = (q / np.linalg.norm(q)).tolist()
    return w, x, y, z
