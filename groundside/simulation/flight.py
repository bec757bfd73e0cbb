"""A flight in memory: the same columns as a recorded run."""

from __future__ import annotations

import functools
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.results import Recording, arrow_table, in_order
from ftcc.groundside.scenario import Mission
from ftcc.groundside.simulation.columns import NotRecordedError, places_kept, places_of
from ftcc.groundside.verdict import Verdict, judge
from ftcc.link.channel import LINK_REPORT
from ftcc.link.recording import Column
from ftcc.sim.obstacles import clearance, zones_of

__all__ = ["Flight", "recorded_columns"]


def recorded_columns(mission: Mission) -> tuple[Column, ...]:
    """Return name, unit and meaning of the columns that a mission's processes record; names may repeat."""
    # These imports are slow, and only a table needs them.
    from ftcc.airside.process import columns as autopilot_columns
    from ftcc.sim.process import columns as vehicle_columns

    return (*vehicle_columns(mission.plant, bool(mission.obstacles)), *autopilot_columns(mission.signals))


@dataclass(frozen=True)
class Flight(Recording):
    """A flight, or a part of one, in memory, with the same columns as a `Run`.

    If it was flown for some columns only, its parts hold these alone, in the same order.
    """

    mission: Mission
    truth: NDArray[np.float64]
    """(n, k, 13): by recorded tick, UAV in the mission's order, and ``TRUTH``; nan after a UAV was lost."""
    command: NDArray[np.float64]
    """(n, k, 4): commands in force, by the actuators' slots."""
    acting: NDArray[np.float64]
    """(n, k, 4): actuator positions that act on the airframe, by slot."""
    conditions: NDArray[np.float64]
    """(n, k, c): what only the simulator knows, see ``sim.plants.conditions_of``."""
    signals: NDArray[np.float64]
    """(n, k, s): in the order of the scheme's ``SIGNALS``."""
    links: NDArray[np.float64]
    """(m, k, e, 6): a row per report and in-edge, by neighbour: ``link.channel.LINK_REPORT``, then trust."""
    t: NDArray[np.float64]
    """(n,): s."""
    lost: dict[int, tuple[float, str]]
    """Time (s) and cause of each loss, by UAV."""
    events: tuple[tuple[float, int, str, str], ...] = ()
    """All other events: time s, UAV, severity, text."""
    lies: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    """(l, c): what was true and what was told of those who lie, see `Mission.lie_columns`."""
    first_report: int = 0
    """Number of the first report in ``links``."""
    columns: frozenset[str] | None = None
    """Columns that were asked for; None: all."""

    @property
    def uavs(self) -> tuple[int, ...]:
        """Ids, ascending."""
        return tuple(sorted(self.mission.uavs))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns of this mission's flights, whether this one recorded them or not."""
        return (*places_of(self.mission), *(["clearance"] if self.mission.obstacles else []))

    @functools.cached_property
    def _columns(self) -> dict[str, NDArray[np.float64]]:
        """The recorded columns (n, k)."""
        kept = places_kept(self.mission, self.columns)
        return {
            name: getattr(self, place.part)[:, :, kept[place.part].index(place.number)]
            for name, place in places_of(self.mission).items()
            if place.number in kept[place.part]
        }

    def _values(self, name: str) -> NDArray[np.float64]:
        """Return a column of all UAVs (n, k)."""
        if name == "clearance" and self.mission.obstacles:
            return self.clearance
        if name not in self._columns and name in self.names:
            raise NotRecordedError(f"column {name} was not recorded; this flight has {', '.join(self._columns)}")
        return self._columns[name]

    @functools.cached_property
    def clearance(self) -> NDArray[np.float64]:
        """(n, k): height above the obstacle below, m."""
        zones = zones_of(self.mission.obstacles)
        x, z = self._values("x"), self._values("z")
        heights = [clearance(zones, *place) for place in zip(x.ravel().tolist(), z.ravel().tolist(), strict=True)]
        return np.array(heights).reshape(x.shape)

    @functools.cached_property
    def verdict(self) -> Verdict:
        """How the flight went."""
        return judge(self, self.mission, self.lost)

    @functools.cached_property
    def _flown(self) -> list[int]:
        """Number of rows of each UAV, in the mission's order."""
        return [int(rows) for rows in np.isfinite(self.truth[:, :, 0]).sum(axis=0)]

    def column(self, name: str, uav: int) -> NDArray[np.float64]:
        """Return a column of one UAV in order of time, up to its loss.

        Raises
        ------
        NotRecordedError
            If the flight was flown for other columns.
        """
        i = self.mission.uavs.index(uav)
        rows = self._flown[i]
        if name == "t":
            return self.t[:rows]
        return self._values(name)[:rows, i]

    def link_table(self) -> dict[str, NDArray[Any]]:
        """Return the columns ``link.recording.LINK_COLUMNS``: a row per report and in-edge, by time, then receiver."""
        timing = self.mission.timing
        numbers = np.arange(self.first_report, self.first_report + len(self.links))
        times = numbers * (timing.report_every * timing.period_us / 1e6)
        edges = [
            (i, edge, spec.uav, neighbour.uav)
            for i, spec in sorted(enumerate(self.mission.autopilots), key=lambda pair: pair[1].uav)
            for edge, neighbour in enumerate(spec.neighbours)
        ]
        values = [self.links[:, i, edge] for i, edge, _, _ in edges]
        rows = np.stack(values, axis=1) if values else np.empty(0)
        rows = rows.reshape(len(times) * len(edges), len(LINK_REPORT) + 1)
        table: dict[str, NDArray[Any]] = {
            "t": np.repeat(times, len(edges)),
            "uav": np.tile(np.array([edge[2] for edge in edges], np.int32), len(times)),
            "sender": np.tile(np.array([edge[3] for edge in edges], np.int32), len(times)),
        }
        table |= {name: rows[:, n] for n, name in enumerate((*LINK_REPORT, "trust"))}
        reported = np.isfinite(table["sent"])
        return {name: column[reported] for name, column in table.items()}

    def lie_table(self) -> dict[str, NDArray[Any]]:
        """Return what was true and what was told, a row per false record, by time, UAV and receiver."""
        return in_order(self.mission.lie_columns, self.lies)

    def table(self) -> dict[str, NDArray[Any]]:
        """Return all recorded columns: a row per recorded tick and UAV, by time, then UAV."""
        order = np.argsort(self.mission.uavs)
        flown = np.isfinite(self.truth[:, order, 0]).ravel()
        table: dict[str, NDArray[Any]] = {
            "t": np.repeat(self.t, len(order))[flown],
            "uav": np.tile(np.array(self.mission.uavs, np.int32)[order], len(self.t))[flown],
        }
        derived = ["clearance"] if self.mission.obstacles and {"x", "z"} <= self._columns.keys() else []
        for name in (*self._columns, *derived):
            table[name] = self._values(name)[:, order].ravel()[flown]
        return table

    def to_arrow(self) -> Any:
        """Return all columns as a ``pyarrow.Table``, as a run of the same flight has it."""
        return arrow_table(recorded_columns(self.mission), self.table())
