"""An autopilot in flight and who speaks with it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from ftcc.groundside.swarm.station import Station
from tests.airside.autopilot_bench import Bench
from tests.airside.gcs.in_flight import flying


@pytest.fixture
def both(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Bench, Station]]:
    with flying(tmp_path, monkeypatch) as pair:
        yield pair


@pytest.fixture
def station(both: tuple[Bench, Station]) -> Station:
    return both[1]


@pytest.fixture
def bench(both: tuple[Bench, Station]) -> Bench:
    return both[0]
