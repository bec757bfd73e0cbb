"""The ground station's ear: hears all vehicles of a swarm on one port, keeps a log, and knows the swarm's state."""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

from ftcc.airside.ground import LINK_FIELDS
from ftcc.groundside.snapshot import Event, LinkState, Snapshot, UavState
from ftcc.link.mavlink import STATION, Endpoint
from ftcc.link.modes import NAMES as MODES
from ftcc.link.modes import mode_of
from ftcc.sim.plant import TRUTH
from ftcc.sim.plants import find
from ftcc.sim.process import truth_array

__all__ = ["Monitor"]


@dataclass
class _Heard:
    """Latest telemetry of one UAV."""

    t: float = 0.0
    truth: dict[str, float] = field(default_factory=dict)
    signals: dict[str, float] = field(default_factory=dict)
    links: dict[int, LinkState] = field(default_factory=dict)
    mode: str = ""
    heartbeat: float = -math.inf
    """Wall time of the last HEARTBEAT (monotonic, s)."""


class Monitor:
    """Receives the telemetry of UAVs of a ``plant`` on ``port``; writes it to ``log`` as a .tlog if given.

    It believes what comes from the ports in ``sources`` alone. Systems are UAVs' ids and ``id_offset``.
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
    ) -> None:
        self._endpoint = Endpoint(STATION, 1, port, only=sources)
        self._endpoint.enlarge_buffer()
        self._uavs = {uav: _Heard() for uav in uavs}
        self._id_offset = id_offset
        self._signals = signals
        self._truth = truth_array(plant)
        self._plant = find(plant)
        self._log = log.open("ab") if log else None
        self._events: list[Event] = []
        self.t = 0.0
        """Newest simulated time heard, s."""

    def fileno(self) -> int:
        """For ``select``."""
        return self._endpoint.fileno()

    def close(self) -> None:
        """Free the port, finish the log."""
        self._endpoint.close()
        if self._log:
            self._log.close()
            self._log = None

    def read(self) -> None:
        """Take in all telemetry that has arrived."""
        for message in self._endpoint.receive():
            self._write(message)
            heard = self._uavs.get(message.get_srcSystem() - self._id_offset)
            if heard is not None:
                self._take(heard, message)

    def _write(self, message: Any) -> None:
        if self._log:
            self._log.write(struct.pack(">Q", int(time.time() * 1e6)) + bytes(message.get_msgbuf()))

    def _take(self, heard: _Heard, message: Any) -> None:
        kind = message.get_type()
        if kind == "DEBUG_FLOAT_ARRAY":
            name = message.name.rstrip("\0")
            if name == "truth":
                heard.t = message.time_usec / 1e6
                self.t = max(self.t, heard.t)
                heard.truth = dict(zip(self._truth, message.data, strict=False))
            elif name == "signals":
                heard.signals = dict(zip(self._signals, message.data, strict=False))
            elif name == "links":
                heard.links = _links(message.data)
        elif kind == "HEARTBEAT":
            heard.heartbeat = time.monotonic()
            mode = mode_of(message.custom_mode >> 16 & 0xFF, message.custom_mode >> 24)
            heard.mode = MODES.get(mode, "") if mode is not None else ""

    @property
    def strangers(self) -> int:
        """Datagrams that came from elsewhere."""
        return self._endpoint.strangers

    @property
    def complete(self) -> bool:
        """Whether every UAV has been heard."""
        return all(heard.truth for heard in self._uavs.values())

    def note(self, event: Event) -> None:
        """Add an event to the next snapshot."""
        self._events.append(event)

    def snapshot(self) -> Snapshot:
        """The swarm as heard so far, and what happened since the last call."""
        uavs = {uav: _state(heard, self._plant) for uav, heard in self._uavs.items() if heard.truth}
        events, self._events = tuple(self._events), []
        return Snapshot(self.t, uavs, events)


def _state(heard: _Heard, plant: ModuleType) -> UavState:
    truth = heard.truth
    actuators = plant.ACTUATORS
    return UavState(
        t=heard.t,
        truth={name: truth[name] for name in TRUTH},
        command={name: truth[f"{name}_command"] for name in actuators},
        acting={name: truth[name] for name in actuators},
        effectiveness={name: truth[f"{name}_effectiveness"] for name in actuators},
        bias={name: truth[f"{name}_bias"] for name in actuators},
        disturbances={name: truth[name] for name, _ in plant.DISTURBANCES},
        signals=heard.signals,
        links=heard.links,
        mode=heard.mode,
        late=int(truth["late"]),
    )


def _links(data: Sequence[float]) -> dict[int, LinkState]:
    size = len(LINK_FIELDS)
    found = {}
    for start in range(0, len(data) - size + 1, size):
        sender, age, received, lost, cut = data[start : start + size]
        if sender > 0:
            found[int(sender)] = LinkState(age if age >= 0 else math.inf, int(received), int(lost), bool(cut))
    return found
