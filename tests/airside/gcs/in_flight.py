"""An autopilot in flight, its vehicle played by the test, and a station or a stranger that speaks with it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ftcc.groundside.swarm.registry import Entry, VehicleEntry
from ftcc.groundside.swarm.station import Station
from ftcc.link.codec import dialect
from ftcc.link.gate import EventReport
from tests.airside.autopilot_bench import Bench, forged

LEVEL = forged(1000.0, 30.0, 0.0, 0.0322, 0.0)
M = dialect


@contextmanager
def flying(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, uav: int = 1, **setting: Any
) -> Iterator[tuple[Bench, Station]]:
    """Follower 1 or leader 7 after its first tick, and a station that speaks with it."""
    monkeypatch.setenv("FTCC_RUNTIME_DIR", str(tmp_path / "runtime"))
    heard = (2, 6) if uav == 1 else ()
    with closing(Bench(tmp_path, 1000, neighbours=heard, uav=uav, **setting)) as alone, alone as bench:
        bench.answer(0, LEVEL, np.zeros(4))
        role = "follower" if uav == 1 else "leader"
        card = VehicleEntry(uav, uav, role, bench.block.of(uav).ground, heard)
        entry = Entry("bench", 1, "containment", str(tmp_path), (card,), None, (0, 0), None, 0.0)
        key = setting.get("key")
        with Station(entry, timeout=0.3, tries=2, key=key) as station:
            yield bench, station


def said(bench: Bench) -> list[EventReport]:
    """What the autopilot has had logged."""
    found = []
    while bench.launcher.poll(0.05):
        message = bench.launcher.recv()
        if isinstance(message, EventReport):
            found.append(message)
    return found


def ask(station: Station, question: Any, answer: str) -> Any:
    """The next message of the kind ``answer`` after a question."""
    (uav,) = station.uavs
    return station._ask(uav, [question], lambda message: message.get_type() == answer, answer)
