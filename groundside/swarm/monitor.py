"""Receive the telemetry of all UAVs of a swarm on one port, log it, and provide snapshots of the swarm."""

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
from ftcc.groundside.swarm.telemetry import ARRAY, HEARTBEAT, TelemetryMessage, TelemetrySocket
from ftcc.link.flight_modes import NAMES as MODES
from ftcc.link.flight_modes import mode_of
from ftcc.sim.plant import TRUTH
from ftcc.sim.plants import find
from ftcc.sim.process import truth_array

__all__ = ["Monitor"]

_STAMP = struct.Struct(">Q")
"""Time stamp before each message in a .tlog: Unix time, us."""
_LINK_BITS = 0b11
"""Bits of a stamp in which MAVProxy stores the number of a link."""
_MAX_STAMP_US = 10**11
"""Stamps beyond this, longer than any flight, are ignored."""


@dataclass(slots=True)
class _UavTelemetry:
    """Latest telemetry of one UAV as plain numbers; `Monitor.snapshot` assigns the names."""

    t: float = 0.0
    truth: tuple[float, ...] = ()
    signals: tuple[float, ...] = ()
    links: tuple[float, ...] = ()
    trust: tuple[float, ...] = ()
    mode: str = ""


class Monitor:
    """Receives the telemetry of UAVs of a ``plant`` on ``port``; writes it to ``log`` as a .tlog if given.

    Only datagrams from the ports in ``sources`` are accepted. The MAVLink system id of a UAV is its id plus
    ``id_offset``. Time stamps in the log are ``started`` (Unix time, s) plus the newest simulated time received, so
    that its replay takes the simulated duration of the flight, independent of pace, pauses and changes of the clock.
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
        self._socket = TelemetrySocket(port, sources)
        self._uavs = {uav: _UavTelemetry() for uav in uavs}
        self._of_system = {uav + id_offset: latest for uav, latest in self._uavs.items()}
        self._late = truth_array(plant).index("late")
        self._read_state = _state_reader(find(plant), truth_array(plant), signals)
        self._log = log.open("ab") if log else None
        self._started_us = int((time.time() if started is None else started) * 1e6)
        self._newest_us = 0
        self._log_error = ""
        self._events: list[Event] = []
        self.t = 0.0
        """Newest simulated time received, s."""

    def fileno(self) -> int:
        """Return the descriptor for ``select``."""
        return self._socket.fileno()

    def close(self) -> None:
        """Close the socket and the log."""
        self._socket.close()
        if self._log:
            try:
                self._log.close()
            except OSError as error:
                self._end_log(error)
            self._log = None

    def read(self) -> None:
        """Read all telemetry that has arrived."""
        for messages in self._socket.receive():
            if self._log and messages:
                newest = max(message.stamp_us for message in messages)
                if self._newest_us < newest <= _MAX_STAMP_US:
                    self._newest_us = newest
                stamp = _STAMP.pack((self._started_us + self._newest_us) & ~_LINK_BITS)
                self._write(b"".join([part for message in messages for part in (stamp, message.frame)]))
            for message in messages:
                uav = self._of_system.get(message.system)
                if uav is not None:
                    self._store(uav, message)

    def _write(self, frames: bytes) -> None:
        """Append to the log; stop logging if that fails."""
        assert self._log is not None
        try:
            self._log.write(frames)
        except OSError as error:
            self._end_log(error)

    def _end_log(self, error: OSError) -> None:
        self._log = None
        self._log_error = f"telemetry is no longer logged: {error.strerror or error}"

    def take_log_error(self) -> str:
        """Return why logging stopped, once; else an empty text."""
        error, self._log_error = self._log_error, ""
        return error

    def _store(self, uav: _UavTelemetry, message: TelemetryMessage) -> None:
        if message.kind == ARRAY:
            if message.name == "truth":
                uav.t = message.stamp_us / 1e6
                self.t = max(self.t, uav.t)
                uav.truth = message.values
            elif message.name == "signals":
                uav.signals = message.values
            elif message.name == "links":
                uav.links = message.values
            elif message.name == "trust":
                uav.trust = message.values
        elif message.kind == HEARTBEAT:
            custom = int(message.values[0])
            mode = mode_of(custom >> 16 & 0xFF, custom >> 24)
            uav.mode = MODES.get(mode, "") if mode is not None else ""

    @property
    def foreign_datagrams(self) -> int:
        """Return the number of datagrams dropped because they came from other ports."""
        return self._socket.foreign_datagrams

    @property
    def complete(self) -> bool:
        """Return whether telemetry of every UAV has been received."""
        return all(uav.truth for uav in self._uavs.values())

    def add_event(self, event: Event) -> None:
        """Add an event to the next snapshot."""
        self._events.append(event)

    @property
    def late(self) -> int:
        """Return the number of ticks with late commands, summed over all UAVs that have reported."""
        return sum(int(uav.truth[self._late]) for uav in self._uavs.values() if uav.truth)

    def snapshot(self) -> Snapshot:
        """Return the latest state of the swarm, and the events since the last call."""
        uavs = {uav: self._read_state(latest) for uav, latest in self._uavs.items() if latest.truth}
        events, self._events = tuple(self._events), []
        return Snapshot(self.t, uavs, events)


def _state_reader(
    plant: ModuleType, truth_names: Sequence[str], signals: Sequence[str]
) -> Callable[[_UavTelemetry], UavState]:
    """Return a function that converts telemetry to a `UavState`.

    ``truth_names`` are the columns of the plant's array "truth", ``signals`` those of the scheme's array.
    """
    column = {name: i for i, name in enumerate(truth_names)}
    columns = {
        "truth": {name: column[name] for name in TRUTH},
        "command": {name: column[f"{name}_command"] for name in plant.ACTUATORS},
        "acting": {name: column[name] for name in plant.ACTUATORS},
        "effectiveness": {name: column[f"{name}_effectiveness"] for name in plant.ACTUATORS},
        "bias": {name: column[f"{name}_bias"] for name in plant.ACTUATORS},
        "disturbances": {name: column[name] for name, _ in plant.DISTURBANCES},
    }
    groups = [(group, tuple(places), _picker(list(places.values()))) for group, places in columns.items()]
    late = column["late"]

    def read(latest: _UavTelemetry) -> UavState:
        truth = latest.truth
        by_name: dict[str, Any] = {group: dict(zip(keys, pick(truth), strict=True)) for group, keys, pick in groups}
        return UavState(
            t=latest.t,
            signals=dict(zip(signals, latest.signals, strict=False)),
            links=_links(latest.links, latest.trust),
            mode=latest.mode,
            late=int(truth[late]),
            **by_name,
        )

    return read


def _picker(places: list[int]) -> Callable[[Sequence[float]], tuple[float, ...]]:
    """Return a function that picks the numbers at ``places`` as a tuple."""
    if len(places) > 1:
        return operator.itemgetter(*places)
    return lambda values: tuple(values[place] for place in places)


def _links(data: Sequence[float], trusts: Sequence[float]) -> dict[int, LinkState]:
    trusted = dict(zip(map(int, trusts[::2]), trusts[1::2], strict=False))
    size = len(LINK_FIELDS)
    found = {}
    for start in range(0, len(data) - size + 1, size):
        if data[start] > 0:
            sender, age, received, lost, cut = data[start : start + size]
            heard_for = age if age >= 0 else math.inf
            trust = trusted.get(int(sender), 1.0)
            found[int(sender)] = LinkState(heard_for, int(received), int(lost), bool(cut), trust)
    return found
