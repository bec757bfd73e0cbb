"""Show what UAVs believe of their actuators beside the truth: states over time, estimates with their bands.

A tab shows the swarm, a lane per UAV. Each UAV that is drawn in full has a tab of its own, by which it is chosen: a
lane for what it believes of each actuator, one for the truth, and effectiveness and bias of each actuator. The lane of
the truth changes colour at the onset of a fault, that of the actuator at detection and at isolation.

States are sent when they change. Estimates of a healthy actuator change slowly, and are sent once in `_EVERY`
snapshots.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import rerun as rr
import rerun.blueprint as rrb

from ftcc.airside.diagnosis.beliefs import FAULTY, HEALTHY, KINDS, NO_KIND, STATES
from ftcc.groundside.dashboard.detail import Detail
from ftcc.groundside.dashboard.labels import HEALTH, believed_state, faulty_actuators, health_of, name
from ftcc.groundside.dashboard.plots import WINDOW, time_series
from ftcc.groundside.dashboard.snapshot import Snapshot, UavState
from ftcc.groundside.dashboard.subject import Subject
from ftcc.groundside.dashboard.viewer import Entry
from ftcc.groundside.palette import GRAY, HEALTH_COLORS, colors
from ftcc.groundside.verdict import SIGMAS
from ftcc.link.actuators import by_slot, unit_of

__all__ = ["DiagnosisPanel"]

_EVERY = 5
"""Snapshots from one estimate of a healthy actuator to the next."""
_QUANTITIES = ("effectiveness", "bias")
_TRUTH = "truth"


class DiagnosisPanel:
    """Draws the beliefs of all followers, and in full those of the UAVs that are drawn in full."""

    def __init__(self, subject: Subject, detail: Detail) -> None:
        self._actuators = by_slot(subject.diagnosed)
        self._followers = subject.followers
        self._detail = detail
        self._colors = colors(subject.graph.uavs)
        self._states: dict[str, str] = {}
        """Latest state of each lane, by path."""
        self._snapshots = 0

    def view(self) -> rrb.Container:
        """Return a tab for the swarm, and one for each UAV that is drawn in full."""
        swarm = _lanes("/health", "Swarm")
        return rrb.Tabs(swarm, *(self._uav_view(uav) for uav in self._shown()), name="Diagnosis")

    def _uav_view(self, uav: int) -> rrb.Container:
        plots = []
        for actuator in self._actuators:
            for quantity in _QUANTITIES:
                unit = unit_of(actuator) if quantity == "bias" else "-"
                title = f"{_words(actuator)} {quantity}{'' if unit == '-' else f', {unit}'}"
                plots.append(time_series(_path(uav, actuator, quantity), title))
        lanes = _lanes(_folder(uav), f"What {name(uav)} believes, and the truth (in plots: gray)")
        return rrb.Vertical(lanes, rrb.Grid(*plots, grid_columns=2), row_shares=[1, 1], name=name(uav))

    def static(self) -> list[Entry]:
        """Return names and colours of states and curves."""
        some = range(1, len(self._actuators) + 1)
        faulty = [_listed(names) for count in some for names in itertools.combinations(self._actuators, count)]
        faulty += [kind for n, kind in enumerate(KINDS) if n != NO_KIND]
        tints = [*HEALTH_COLORS, *[HEALTH_COLORS[FAULTY]] * len(faulty)]
        style = rr.StateConfiguration(values=[*HEALTH, *faulty], colors=tints)
        lanes = [_swarm_path(uav) for uav in self._followers]
        lanes += [f"{_folder(uav)}/{what}" for uav in self._shown() for what in (*self._actuators, _TRUTH)]
        entries = [Entry(path, None, style) for path in lanes]
        names = [f"estimated, band {SIGMAS:g} sigma", "true"]
        for uav in self._shown():
            curves = rr.Measurements.from_fields(colors=[self._colors[uav], GRAY], widths=[1.5, 1.0], names=names)
            paths = (_path(uav, actuator, quantity) for actuator in self._actuators for quantity in _QUANTITIES)
            entries += [Entry(path, None, curves) for path in paths]
        return entries

    def draw(self, snapshot: Snapshot, new: Sequence[int] = ()) -> list[Entry]:
        """Return the states that have changed, and the estimates that are due."""
        entries = self.static() if new else []
        for uav in self._followers:
            state = snapshot.uavs.get(uav)
            health = None if state is None else health_of(state)
            if health is not None:
                entries += self._change(_swarm_path(uav), HEALTH[health], snapshot.t)
        for uav in self._shown():
            state = snapshot.uavs.get(uav)
            if state is None or health_of(state) is None:
                continue
            broken = [actuator for actuator in self._actuators if actuator in faulty_actuators(state)]
            truth = self._change(f"{_folder(uav)}/{_TRUTH}", _listed(broken) or STATES[HEALTHY], snapshot.t)
            entries += truth
            for actuator in self._actuators:
                believed = believed_state(state, actuator)
                change = self._change(f"{_folder(uav)}/{actuator}", believed, snapshot.t)
                entries += change
                quiet = believed == STATES[HEALTHY] and actuator not in broken and not (change or truth)
                if not quiet or (self._snapshots + uav) % _EVERY == 0:
                    entries += self._estimates(uav, actuator, state, snapshot.t)
        self._snapshots += 1
        return entries

    def _change(self, path: str, state: str, t: float) -> list[Entry]:
        """Return the state of a lane if it is a new one."""
        if self._states.get(path) == state:
            return []
        self._states[path] = state
        return [Entry(path, t, rr.StateChange(state=state))]

    def _estimates(self, uav: int, actuator: str, state: UavState, t: float) -> list[Entry]:
        """Return effectiveness and bias as estimated, with a band, and as they are."""
        entries = []
        for quantity, truth in zip(_QUANTITIES, (state.effectiveness, state.bias), strict=True):
            estimate, sd = (state.signals.get(f"{quantity}_{what}_{actuator}", math.nan) for what in ("hat", "sd"))
            # Rerun shades one standard deviation around a value; the variance is that of the whole band.
            values = [estimate, truth.get(actuator, math.nan)]
            curves = rr.Measurements.from_fields(values=values, variances=[(SIGMAS * sd) ** 2, 0.0])
            entries.append(Entry(_path(uav, actuator, quantity), t, curves))
        return entries

    def _shown(self) -> list[int]:
        return sorted(set(self._detail.shown) & set(self._followers))


def _lanes(origin: str, title: str) -> rrb.StateTimelineView:
    """Return lanes of states over the last `WINDOW` seconds."""
    start, end = rr.TimeRangeBoundary.cursor_relative(seconds=-WINDOW), rr.TimeRangeBoundary.cursor_relative()
    axis = rrb.archetypes.TimeAxis(view_range=rr.TimeRange(start=start, end=end))
    return rrb.StateTimelineView(origin=origin, name=title, time_view=axis)


def _swarm_path(uav: int) -> str:
    return f"/health/UAV_{uav}"


def _folder(uav: int) -> str:
    """Return the folder of the lanes of a UAV; a view shows the path of a lane as its name."""
    return f"/believed/UAV_{uav}"


def _path(uav: int, actuator: str, quantity: str) -> str:
    return f"/plots/diagnosis/{uav}/{actuator}/{quantity}"


def _listed(actuators: Sequence[str]) -> str:
    return ", ".join(actuators)


def _words(actuator: str) -> str:
    return actuator.replace("_", " ").capitalize()
