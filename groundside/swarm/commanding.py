"""Commands of a script to the UAVs of its swarm, over MAVLink."""

from __future__ import annotations

import abc
from collections.abc import Sequence
from typing import Any

from ftcc.groundside.swarm.control import SwarmError
from ftcc.groundside.swarm.conversation import RefusedError
from ftcc.groundside.swarm.station import Station, sizes_of_fault

__all__ = ["Commanding"]


class Commanding(abc.ABC):
    """Commands that the command line has too, each acknowledged by the UAV.

    All raise `StationError`: `RefusedError` if the UAV refuses, `NoAnswerError` if there is none or it does not answer.
    """

    @property
    @abc.abstractmethod
    def station(self) -> Station:
        """The ground station that sends them."""

    def fault(self, uav: int, what: str, *, kind: str = "wrong", at: float | None = None, **sizes: float) -> float:
        """Inject a fault as ``ftcc fault`` does, and return the simulated time at which it takes effect, s.

        Parameters
        ----------
        what, kind, at : see `Station.fault`.
        sizes : ``effectiveness``, ``bias``, ``onset``, ``slew``, ``period``, ``duty`` and others; what is not given
            has no effect.

        Raises
        ------
        StationError
            `RefusedError` or `NoAnswerError` if the UAV refuses or does not answer.
        """
        return self.station.fault(uav, what, kind=kind, at=at, **sizes_of_fault(what, kind, sizes))

    def repair(self, uav: int, what: str | None = None, *, at: float | None = None) -> None:
        """Remove the fault of one actuator or of the navigation solution, or all faults."""
        self.station.repair(uav, what, at=at)

    def attack(self, uav: int, kind: str, **fields: Any) -> float:
        """Have a UAV lie to its neighbours as ``ftcc attack`` does, and return when it begins, simulated s.

        ``fields`` are those of `Station.attack`: ``to``, ``victim``, ``signals``, ``size``, ``at`` and so on.
        """
        return self.station.attack(uav, kind, **fields)

    def cut(self, *, uav: int | None = None, edge: tuple[int, int] | None = None, at: float | None = None) -> None:
        """Switch off the radio of a UAV, or cut the links between the two of an edge."""
        _require_all(self.station.cut(*_ends(uav, edge), at=at))

    def restore(self, *, uav: int | None = None, edge: tuple[int, int] | None = None, at: float | None = None) -> None:
        """Restore the radio and all links of a UAV, or the links between the two of an edge."""
        _require_all(self.station.restore(*_ends(uav, edge), at=at))

    def degrade(
        self, *, uav: int | None = None, edge: tuple[int, int] | None = None, at: float | None = None, **sizes: float
    ) -> None:
        """Degrade all links of a UAV, or those of an edge; ``sizes`` as `Station.degrade` takes them."""
        a, b = _ends(uav, edge)
        _require_all(self.station.degrade(a, b, at=at, **sizes))

    def set(self, uav: int, name: str, value: float) -> float:
        """Set a gain or another parameter of a UAV, and return its new value, which MAVLink carries as float32."""
        return self.station.set(uav, name, value)

    def get(self, uav: int, name: str) -> float:
        """Return a gain or another parameter of a UAV."""
        return self.station.get(uav, name)

    def fault_tolerance(self, uav: int, on: bool) -> None:
        """Switch the fault tolerance of a UAV's law on or off."""
        self.station.fault_tolerance(uav, on)

    def lead(
        self, uav: int, *, altitude: float | None = None, speed: float | None = None, at: float | None = None
    ) -> None:
        """Command a leader's altitude (m) or speed (m/s), at a simulated time (s) or now."""
        self.station.lead(uav, altitude=altitude, speed=speed, at=at)


def _ends(uav: int | None, edge: tuple[int, int] | None) -> tuple[int, int | None]:
    if (uav is None) == (edge is None):
        raise SwarmError("give either uav=ID or edge=(ID, ID)")
    return (uav, None) if edge is None else (edge[0], edge[1])  # type: ignore[return-value]


def _require_all(problems: Sequence[str]) -> None:
    if problems:
        raise RefusedError(f"done at one end only: {'; '.join(problems)}")
