"""What ground stations see and set of a UAV's defences: the array "trust", texts, and settings by name."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from ftcc.airside.defence.arrays import Edge
from ftcc.airside.defence.gains import DefenceGains, defence_gains
from ftcc.airside.gcs.parameters import defence_parameter
from ftcc.airside.spec import DefenceSpec
from ftcc.groundside.swarm.conversation import RefusedError
from ftcc.groundside.swarm.station import Station
from tests.airside.autopilot_bench import Bench
from tests.airside.gcs.in_flight import flying
from tests.airside.gcs.test_beliefs import array

ON = DefenceSpec(on=True, gains=tuple(defence_gains({"F": 1})), leaders=(6,))


@pytest.fixture
def pair(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Bench, Station]]:
    with flying(tmp_path, monkeypatch, defence=ON) as both:
        yield both


def test_trust_travels_by_sender(pair: tuple[Bench, Station]) -> None:
    bench, station = pair
    edges = bench.process.group.autopilots.defence.edges[0]
    edges[:, Edge._fields.index("standing")] = 0.25, 1.0
    assert array(station, "trust")[:5] == [2.0, 0.25, 6.0, 1.0, 0.0]


def test_settings_are_parameters_with_their_ranges(pair: tuple[Bench, Station]) -> None:
    bench, station = pair
    values = station.parameters(1)
    for name, value in defence_gains({"F": 1})._asdict().items():
        assert values[defence_parameter(name)] == value
        assert len(defence_parameter(name)) <= 16
    gains = bench.process.group.autopilots.defence.gains[0]
    assert station.set(1, "DEF_F", 2) == 2.0
    assert gains[DefenceGains._fields.index("F")] == 2.0
    for refused in (-1.0, 1.5):
        with pytest.raises(RefusedError):
            station.set(1, "DEF_F", refused)
    assert gains[DefenceGains._fields.index("F")] == 2.0


def test_without_defences_there_are_no_settings_of_them(station: Station) -> None:
    assert not [name for name in station.parameters(1) if name.startswith("DEF_") or name == "SR_TRUST"]
