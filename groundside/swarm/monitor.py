"""The ground station's ear: hears all vehicles of a swarm on one port, keeps a log, and knows the swarm's state."""

from __future__ import annotations

import math
import operator
import struct
import time
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from ftcc.airside.gcs import LINK_FIELDS
from ftcc.groundside.dashboard import Event, LinkState, Snapshot, UavState
from ftcc.groundside.swarm.telemetry import ARRAY, HEARTBEAT, Ear, TelemetryMessage
from ftcc.link.flight_modes import NAMES as MODES
from ftcc.link.flight_modes import mode_of
from ftcc.sim.plant import TRUTH
from ftcc.sim.plants import find
from ftcc.sim.process import truth_array

__all__ = ["Monitor"]

_STAMP = struct.Struct(">Q")
"""What a .tlog has before each message: its Unix time, us."""
_LINK = 0b11
"""The bits of a stamp in which MAVProxy keeps the number of a link."""
_LONGEST_US = 10**11
"""No flight lasts longer: a later stamp is none."""


@dataclass(slots=True)
class _Heard:
    """Latest telemetry of one UAV, as numbers: names are given to them when a snapshot is wanted."""

    t: float = 0.0
    truth: tuple[float, ...] = ()
    signals: tuple[float, ...] = ()
    links: tuple[float, ...] = ()
    mode: str = ""


class Monitor:
    """Receives the telemetry of UAVs of a ``plant`` on ``port``; writes it to ``log`` as a .tlog if given.

    It believes what comes from the ports in ``sources`` alone. Systems are UAVs' ids and ``id_offset``. The log has as
    times ``started`` (Unix time, s) and the newest simulated time told: replayed, it lasts as long as the flight, as
    fast as that was flown and however long it was held, and no step of the clock reaches it.
    """

    def __init__(
        self,
        port: int,
        sources: Collection[int],
        uavs: Iterable[int],
        plant: str,
        signals: Sequence[str],
        log: Path | None = None,
        id_offset: int = 0,
        started: float | None = None,
    ) -> None:
        self._ear = Ear(port, sources)
        self._uavs = {uav: _Heard() for uav in uavs}
        self._of_system = {uav + id_offset: heard for uav, heard in self._uavs.items()}
        self._late = truth_array(plant).index("late")
        self._read_state = _state_reader(find(plant), truth_array(plant), signals)
        self._log = log.open("ab") if log else None
        self._started_us = int((time.time() if started is None else started) * 1e6)
        self._told_us = 0
        self._trouble = ""
        self._events: list[Event] = []
        self.t = 0.0
        """Newest simulated time heard, s."""

    def fileno(self) -> int:
        """For ``select``."""
        return self._ear.fileno()

    def close(self) -> None:
        """Free the port, finish the log."""
        self._ear.close()
        if self._log:
            try:
                self._log.close()
            except OSError as error:
                self._end_log(error)
            self._log = None

    def read(self) -> None:
        """Take in all telemetry that has arrived."""
        for told in self._ear.hear():
            if self._log and told:
                newest = max(one.stamp_us for one in told)
                if self._told_us < newest <= _LONGEST_US:
                    self._told_us = newest
                stamp = _STAMP.pack((self._started_us + self._told_us) & ~_LINK)
                self._write(b"".join([part for one in told for part in (stamp, one.frame)]))
            for one in told:
                heard = self._of_system.get(one.system)
                if heard is not None:
                    self._take(heard, one)

    def _write(self, frames: bytes) -> None:
        """Append to the log; one that cannot be written ends."""
        assert self._log is not None
        try:
            self._log.write(frames)
        except OSError as error:
            self._end_log(error)

    def _end_log(self, error: OSError) -> None:
        self._log = None
        self._trouble = f"telemetry is no longer logged: {error.strerror or error}"

    def take_trouble(self) -> str:
        """Why the log has ended before its time, once; else empty."""
        trouble, self._trouble = self._trouble, ""
        return trouble

    def _take(self, heard: _Heard, told: TelemetryMessage) -> None:
        if told.kind == ARRAY:
            if told.name == "truth":
                heard.t = told.stamp_us / 1e6
                self.t = max(self.t, heard.t)
                heard.truth = told.values
            elif told.name == "signals":
                heard.signals = told.values
            elif told.name == "links":
                heard.links = told.values
        elif told.kind == HEARTBEAT:
            custom = int(told.values[0])
            mode = mode_of(custom >> 16 & 0xFF, custom >> 24)
            heard.mode = MODES.get(mode, "") if mode is not None else ""

    @property
    def strangers(self) -> int:
        """Datagrams that came from elsewhere."""
        return self._ear.strangers

    @property
    def complete(self) -> bool:
        """Whether every UAV has been heard."""
        return all(heard.truth for heard in self._uavs.values())

    def note(self, event: Event) -> None:
        """Add an event to the next snapshot."""
        self._events.append(event)

    @property
    def late(self) -> int:
        """Ticks in which commands came too late, of all UAVs together, as far as was heard."""
        return sum(int(heard.truth[self._late]) for heard in self._uavs.values() if heard.truth)

    def snapshot(self) -> Snapshot:
        """The swarm as heard so far, and what happened since the last call."""
        uavs = {uav: self._read_state(heard) for uav, heard in self._uavs.items() if heard.truth}
        events, self._events = tuple(self._events), []
        return Snapshot(self.t, uavs, events)


def _state_reader(plant: ModuleType, told: Sequence[str], signals: Sequence[str]) -> Callable[[_Heard], UavState]:
    """What makes a `UavState` of what was heard: by the names of the plant's array "truth" and of the signals."""
    place = {name: i for i, name in enumerate(told)}
    names = {
        "truth": {name: place[name] for name in TRUTH},
        "command": {name: place[f"{name}_command"] for name in plant.ACTUATORS},
        "acting": {name: place[name] for name in plant.ACTUATORS},
        "effectiveness": {name: place[f"{name}_effectiveness"] for name in plant.ACTUATORS},
        "bias": {name: place[f"{name}_bias"] for name in plant.ACTUATORS},
        "disturbances": {name: place[name] for name, _ in plant.DISTURBANCES},
    }
    groups = [(group, tuple(places), _picker(list(places.values()))) for group, places in names.items()]
    late = place["late"]

    def read(heard: _Heard) -> UavState:
        truth = heard.truth
        by_name: dict[str, Any] = {group: dict(zip(keys, pick(truth), strict=True)) for group, keys, pick in groups}
        return UavState(
            t=heard.t,
            signals=dict(zip(signals, heard.signals, strict=False)),
            links=_links(heard.links),
            mode=heard.mode,
            late=int(truth[late]),
            **by_name,
        )

    return read


def _picker(places: list[int]) -> Callable[[Sequence[float]], tuple[float, ...]]:
    """What takes the numbers at ``places``, as a tuple however many they are."""
    if len(places) > 1:
        return operator.itemgetter(*places)
    return lambda values: tuple(values[place] for place in places)


def _links(data: Sequence[float]) -> dict[int, LinkState]:
    size = len(LINK_FIELDS)
    found = {}
    for start in range(0, len(data) - size + 1, size):
        if data[start] > 0:
            sender, age, received, lost, cut = data[start : start + size]
            found[int(sender)] = LinkState(age if age >= 0 else math.inf, int(received), int(lost), bool(cut))
    return found
