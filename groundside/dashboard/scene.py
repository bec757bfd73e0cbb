"""Draw the swarm in space: aircraft with their attitudes, trails, references and labels.

The axes of the world are east, north and up (right-handed); x (north) and y (east) of a snapshot are swapped.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from ftcc.groundside.dashboard.detail import Detail
from ftcc.groundside.dashboard.labels import is_silent, label
from ftcc.groundside.dashboard.links import Links
from ftcc.groundside.dashboard.marks import MARKS_NOTE, HealthMarks
from ftcc.groundside.dashboard.shapes import SPAN, Poses, airframe, outline, stick_colors, sticks
from ftcc.groundside.dashboard.snapshot import Snapshot, UavState
from ftcc.groundside.dashboard.subject import Subject
from ftcc.groundside.dashboard.surroundings import Surroundings
from ftcc.groundside.dashboard.viewer import Entry
from ftcc.groundside.palette import Color, colors

__all__ = ["LANE", "TRAIL", "Scene"]

TRAIL = {"containment": 5.0, "formation": 5.0, "attitude": 5.0, "fire": 40.0}
"""Length of the trails, s, by family."""
_LONG_TRAIL = 30.0
"""Likewise in the view from the side, where paths show climbs and descents."""
LANE = 12.0
"""Sideways distance at which aircraft of one vertical plane are drawn, m."""

_RANK = 24.0
"""Distance between the ranks in which a big swarm in line abreast is drawn, m."""

_REFERENCES: dict[str, dict[str, tuple[str, ...]]] = {
    "containment": {"x": ("x_hat",), "z": ("z_r", "zhat", "z_hat")},
    "formation": {"z": ("z_r", "z_d", "zhat", "z_id")},
    "attitude": {"mu": ("mu_d",), "alpha": ("alpha_d",), "beta": ("beta_d",)},
    "fire": {"x": ("x_ref",), "y": ("y_ref",), "z": ("z_ref",)},
}
"""Signals that are references of position or attitude, by the true state that they refer to."""


class Scene:
    """Draws the swarm around its centre.

    The view follows the centre of the swarm, so that the swarm does not fly out of sight. Positions are the true ones,
    with two exceptions. Aircraft in one vertical plane, as in longitudinal schemes, are drawn side by side, `LANE`
    apart. A big swarm in line abreast, which would be kilometres wide, is drawn in ranks.
    """

    def __init__(self, subject: Subject, first: Snapshot, detail: Detail) -> None:
        self._subject = subject
        self._detail = detail
        self._uavs = sorted(subject.graph.uavs)
        self._leaders = set(subject.leaders)
        self._colors = colors(self._uavs)
        self._index = {uav: i for i, uav in enumerate(self._uavs)}
        self._lanes: NDArray[np.float64] = np.zeros((len(self._uavs), 2))
        """Offset between drawn and true position of each UAV, east and north, m."""
        self._ranks = 1
        self._positions = np.full((len(self._uavs), 3), np.nan)
        self._update_positions(first)
        self._assign_lanes()
        self._update_positions(first)
        known = self._known_positions()
        self._centre: NDArray[np.float64] = known.mean(axis=0) if len(known) else np.zeros(3)
        self._radius = max(30.0, float(np.linalg.norm(known - self._centre, axis=1).max(initial=0.0)))
        apart = np.linalg.norm(known[:, None] - known[None], axis=2)[~np.eye(len(known), dtype=bool)]
        room = min(0.9 * float(apart.min(initial=np.inf)), 0.3 * self._radius)
        self._scale = max(1, round(room / SPAN))
        names = {signal.name for signal in subject.signals}
        wanted = _REFERENCES[subject.family]
        self._references = {
            state: next(signal for signal in signals if signal in names)
            for state, signals in wanted.items()
            if names & set(signals)
        }
        self._surroundings = Surroundings(subject, self._positions, in_ranks=self._ranks > 1)
        self.links = Links(subject, detail)
        self._others: list[int] = []
        """UAVs drawn as sticks in the previous snapshot."""
        self._labels: dict[int, str] = {}
        size = 0.25 * self._scale * SPAN
        self._marks = HealthMarks("/world/health", size, 2.2 * size) if subject.diagnosed else None
        self._poses = Poses()

    @property
    def title(self) -> str:
        """Return the title of the view, with hints how to read it."""
        notes = [f"airframes x{self._scale}"] if self._scale > 1 else []
        ranks = f" in {self._ranks} ranks, truly abreast" if self._ranks > 1 else ""
        notes += [f"side by side at {LANE:g} m{ranks}"] if self._lanes.any() else []
        notes += ["outlines: references"] if self._references else []
        notes += self._surroundings.notes
        notes += [MARKS_NOTE] if self._marks is not None else []
        return "Swarm" + (f" ({', '.join(notes)})" if notes else "")

    @property
    def is_longitudinal(self) -> bool:
        """Whether the swarm moves in a vertical plane."""
        return self._subject.family in ("containment", "formation")

    def view(self) -> rrb.Spatial3DView:
        """Return the view of the swarm, from behind, right and above."""
        eye = self._radius * np.array([0.45, -1.6, 1.05])
        return self._seen_from(eye, -0.05 * self._radius, TRAIL[self._subject.family], self.title)

    def side_view(self) -> rrb.Spatial3DView:
        """Return the vertical plane in which the swarm moves, with the paths of the last `_LONG_TRAIL` seconds."""
        eye = self._radius * np.array([1.7, -0.8, 0.12])
        return self._seen_from(eye, 0.0, _LONG_TRAIL, "Vertical plane")

    def _seen_from(self, eye: NDArray[np.float64], target: float, trail: float, name: str) -> rrb.Spatial3DView:
        """Return a view of the swarm from ``eye``, m from its centre, with trails of so many seconds."""
        return rrb.Spatial3DView(
            origin="/world/centre",
            contents="/world/**",
            name=name,
            eye_controls=rrb.EyeControls3D(
                kind=rrb.Eye3DKind.Orbital, position=eye, look_target=(0.0, 0.0, target), eye_up=(0, 0, 1)
            ),
            line_grid=rrb.LineGrid3D(visible=False),
            overrides={
                "/world/trails": [
                    rrb.VisibleTimeRanges(
                        timeline="t",
                        start=rrb.TimeRangeBoundary.cursor_relative(seconds=-trail),
                        end=rrb.TimeRangeBoundary.cursor_relative(),
                    )
                ]
            },
        )

    def static(self) -> list[Entry]:
        """Return shapes and colours."""
        width = rr.Radius.ui_points(0.75)
        trails = rr.LineStrips3D.from_fields(colors=self._trail_colors(), radii=width)
        entries = [Entry("/world", None, rr.ViewCoordinates.RIGHT_HAND_Z_UP), *self._shapes(self._detail.shown)]
        entries.append(Entry("/world/trails", None, trails))
        return entries + self._surroundings.static() + self.links.static()

    def _shapes(self, uavs: Iterable[int]) -> list[Entry]:
        """Return the shapes of UAVs that are drawn in full."""
        entries = []
        vertices, normals = airframe(self._scale)
        strips = outline(self._scale)
        for uav in uavs:
            shape = rr.Mesh3D(vertex_positions=vertices, vertex_normals=normals, albedo_factor=self._colors[uav])
            entries.append(Entry(f"/world/uav/{uav}/airframe", None, shape))
            above = rr.Points3D(
                (0.0, 0.0, -0.55 * self._scale * SPAN), colors=self._colors[uav], radii=rr.Radius.ui_points(0.5)
            )
            entries.append(Entry(f"/world/uav/{uav}/label", None, above))
            if self._references and uav not in self._leaders:
                ghost = rr.LineStrips3D(strips, colors=self._colors[uav], radii=rr.Radius.ui_points(0.6))
                entries.append(Entry(f"/world/reference/{uav}/outline", None, ghost))
        return entries

    def draw(self, snapshot: Snapshot, new: Sequence[int] = ()) -> list[Entry]:
        """Return everything that moves; ``new`` are the UAVs that are drawn in full from now on."""
        t = snapshot.t
        before = self._positions.copy()
        self._update_positions(snapshot)
        after = self._positions
        known = np.isfinite(after[:, 0])
        if known.any():
            # The median, because UAVs that a big swarm leaves behind must not move the centre.
            middle = np.median if self._detail.crowded else np.mean
            self._centre = middle(after[known], axis=0)
        entries = [Entry("/world/centre", t, rr.Transform3D(translation=self._centre))]
        if new:
            entries += self._shapes(new)
            entries.append(Entry("/world/trails", t, rr.LineStrips3D.from_fields(colors=self._trail_colors())))
        for uav in self._detail.shown:
            state = snapshot.uavs.get(uav)
            place = after[self._index[uav]]
            if state is not None and math.isfinite(place[0]):
                entries.append(Entry(f"/world/uav/{uav}", t, self._poses.of(place, state.truth)))
                entries += self._reference(t, uav, state)
        before = np.where(np.isfinite(before), before, after)
        entries += self._trails(t, before, after) + self._sticks(snapshot)
        for uav in self._detail.shown:
            text = label(uav, uav in self._leaders, snapshot, brief=self._detail.crowded)
            if text != self._labels.get(uav):
                self._labels[uav] = text
                shown = rr.Points3D.from_fields(labels=text, show_labels=True)
                entries.append(Entry(f"/world/uav/{uav}/label", t, shown))
        if self._marks is not None:
            places = {uav: after[row] for uav, row in self._index.items() if known[row] and uav not in self._leaders}
            entries += self._marks.draw(snapshot, places)
        entries += self._surroundings.draw(snapshot, self._framed_positions(snapshot))
        return entries + self.links.draw(snapshot, after, 0.5 * self._scale * SPAN)

    def _trail_colors(self) -> list[Color]:
        return [self._colors[uav] for uav in self._detail.shown]

    def _trails(self, t: float, before: NDArray[np.float64], after: NDArray[np.float64]) -> list[Entry]:
        """Return the paths of UAVs drawn in full since the previous snapshot."""
        rows = [self._index[uav] for uav in self._detail.shown]
        ways = np.stack([before[rows], after[rows]], axis=1)
        return [Entry("/world/trails", t, rr.LineStrips3D.from_fields(strips=ways))]

    def _sticks(self, snapshot: Snapshot) -> list[Entry]:
        """Return all other UAVs, as one entry."""
        if not self._detail.crowded:
            return []
        full = set(self._detail.shown)
        others = [
            uav for uav, row in self._index.items()
            if uav not in full and uav in snapshot.uavs and math.isfinite(self._positions[row, 0])
        ]  # fmt: skip
        places = self._positions[[self._index[uav] for uav in others]]
        strips = sticks(places, [snapshot.uavs[uav].truth for uav in others], self._scale)
        drawn = rr.LineStrips3D.from_fields(strips=strips)
        if others != self._others:
            self._others = others
            drawn = rr.LineStrips3D.from_fields(
                strips=strips, colors=stick_colors(self._colors, others), radii=rr.Radius.ui_points(1.0)
            )
        return [Entry("/world/others", snapshot.t, drawn)]

    def _update_positions(self, snapshot: Snapshot) -> None:
        positions = [
            (self._index[uav], state.truth["y"], state.truth["x"], state.truth["z"])
            for uav, state in snapshot.uavs.items()
            if uav in self._index
        ]
        values = np.array(positions, dtype=np.float64).reshape(-1, 4)
        values = values[np.isfinite(values).all(axis=1)]
        rows = values[:, 0].astype(int)
        self._positions[rows] = values[:, 1:]
        self._positions[rows, :2] += self._lanes[rows]

    def _drawn_position(self, uav: int, truth: Mapping[str, float]) -> NDArray[np.float64]:
        east, north = self._lanes[self._index[uav]]
        return np.array((truth["y"] + east, truth["x"] + north, truth["z"]))

    def _assign_lanes(self) -> None:
        """Draw aircraft in one vertical plane side by side, and a big swarm in line abreast in ranks."""
        n, known = len(self._uavs), self._known_positions()
        if n < 2 or not len(known):
            return
        in_plane, abreast = (np.ptp(known[:, :2], axis=0) < 1.0).tolist()
        # Ranks only for longitudinal schemes without obstacles, where horizontal positions carry no information.
        in_ranks = self._detail.crowded and abreast and self.is_longitudinal and not self._subject.obstacles
        if not (in_plane or in_ranks):
            return
        width = math.ceil(math.sqrt(2 * n)) if in_ranks else n
        places = np.argsort(np.argsort(self._positions[:, 0], kind="stable")) if in_ranks else np.arange(n)
        rank, lane = np.divmod(places, width)
        self._ranks = int(rank.max()) + 1
        self._lanes[:, 0] = LANE * (lane - 0.5 * (width - 1))
        if in_ranks:
            self._lanes[:, 0] -= np.nan_to_num(self._positions[:, 0])
            self._lanes[:, 1] = -_RANK * rank

    def _framed_positions(self, snapshot: Snapshot) -> NDArray[np.float64]:
        """Return positions for the hull's frame; nan for silent followers of a big swarm, which are left behind."""
        if not self._detail.crowded:
            return self._positions
        left = [
            self._index[uav] for uav, state in snapshot.uavs.items()
            if uav in self._index and uav not in self._leaders and is_silent(state, snapshot)
        ]  # fmt: skip
        company = self._positions.copy()
        company[left] = np.nan
        return company

    def _known_positions(self) -> NDArray[np.float64]:
        known: NDArray[np.float64] = self._positions[np.isfinite(self._positions[:, 0])]
        return known

    def _reference(self, t: float, uav: int, state: UavState) -> list[Entry]:
        """Return the outline of an aircraft at its reference position or attitude."""
        if not self._references or uav in self._leaders:
            return []
        wanted = {name: state.signals.get(signal, math.nan) for name, signal in self._references.items()}
        if not all(map(math.isfinite, wanted.values())):
            return []
        truth = {**state.truth, **wanted}
        return [Entry(f"/world/reference/{uav}", t, self._poses.of(self._drawn_position(uav, truth), truth))]
