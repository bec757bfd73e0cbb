"""Lies that the ground asks for: accepted, refused with a reason, logged when they begin and end, and told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ftcc.airside.attacks.arrays import Row
from ftcc.groundside.swarm.conversation import RefusedError, StationError
from ftcc.groundside.swarm.station import Station
from ftcc.link.failures import KINDS, UNITS
from tests.airside.autopilot_bench import Bench
from tests.airside.gcs.in_flight import LEVEL, M, said

BEGIN, END, EDGE = (Row._fields.index(name) for name in ("begin", "end", "edge"))


def fly_on(bench: Bench, first: int, last: int) -> np.ndarray:
    """Fly ticks first..last-1; what the autopilot told its neighbours last."""
    for tick in range(first, last):
        bench.answer(tick, LEVEL, np.zeros(4))
    group = bench.process.group
    return group.exchange.values[0, (group.exchange.next_sequence[0] - 1) % group.exchange.values.shape[1]]


def in_force(bench: Bench) -> list[list[int]]:
    """Edge, begin and end (us) of each attack."""
    attacks = bench.process.group.attacks
    return attacks.rows[: attacks.clock[0], [EDGE, BEGIN, END]].tolist()


def test_a_lie_is_told_logged_and_ended(both: tuple[Bench, Station]) -> None:
    bench, station = both
    said(bench)
    assert station.attack(1, "offset", size=5.0, at=0.05, until=0.2) == 0.05
    told = fly_on(bench, 1, 12)
    true = bench.process.group.autopilots.shared[0]
    assert told[0] == true[0] + 5.0
    assert told[1] == true[1]
    told = fly_on(bench, 12, 26)
    assert np.array_equal(told, bench.process.group.autopilots.shared[0])
    logged = [(event.at_us, event.outcome, event.text) for event in said(bench) if event.outcome in ("armed", "acts")]
    assert logged == [
        (0, "armed", "lies: offset: size 5 at t = 0.05 s"),
        (0, "armed", "tells the truth again at t = 0.2 s"),
        (50_000, "acts", "lies: offset: size 5"),
        (200_000, "acts", "tells the truth again"),
    ]


def test_a_drift_of_a_size_alone_comes_there_in_ten_seconds(both: tuple[Bench, Station]) -> None:
    bench, station = both
    said(bench)
    station.attack(1, "drift", size=-2.0, at=0.05)
    station.attack(1, "drift", size=2.0, rate=0.5, at=0.05)
    texts = [event.text for event in said(bench) if event.outcome == "armed"]
    assert [text.partition(" at t")[0] for text in texts] == [
        "lies: drift: rate -0.2, size -2",
        "lies: drift: rate 0.5, size 2",
    ]


def test_a_new_lie_replaces_the_one_before_and_none_ends_it(both: tuple[Bench, Station]) -> None:
    bench, station = both
    station.attack(1, "drift", rate=-0.5)
    station.attack(1, "oscillate", size=2.0, period=4.0, at=0.1)
    assert [row[1:] for row in in_force(bench)] == [[10_000, 100_000], [100_000, in_force(bench)[1][2]]]
    assert in_force(bench)[1][2] > 10**15
    station.attack(1, "none", at=0.5)
    assert in_force(bench)[1] == [-1, 100_000, 500_000]


def test_what_a_neighbour_tells_may_be_false(both: tuple[Bench, Station]) -> None:
    """As a foreign ground station asks for it: parameters, then MAV_CMD_INJECT_FAILURE."""
    bench, station = both
    for name, value in {"ATK_KIND": 1, "ATK_SIZE": 3.0}.items():
        station.set(1, name, value)
    radio = UNITS["radio"].code
    station.command(1, M.MAV_CMD_INJECT_FAILURE, radio, KINDS["wrong"], 6)
    assert in_force(bench)[0][0] == 1
    station.set(1, "ATK_KIND", 9)
    station.set(1, "ATK_AS", 2)
    station.command(1, M.MAV_CMD_INJECT_FAILURE, radio, KINDS["wrong"], 6)
    assert in_force(bench)[1][0] == 0
    station.set(1, "ATK_KIND", 0)
    station.command(1, M.MAV_CMD_INJECT_FAILURE, radio, KINDS["wrong"], 6)
    assert all(end == 10_000 for _, _, end in in_force(bench))
    texts = [event.text for event in said(bench)]
    assert "UAV 6 lies: offset: size 3" not in texts
    fly_on(bench, 1, 3)
    texts = [event.text for event in said(bench)]
    assert [text for text in texts if "UAV 6" in text] == [
        "UAV 6 lies: offset: size 3",
        "UAV 6 speaks in the name of UAV 2",
        "UAV 6 tells the truth again",
    ]


@pytest.mark.parametrize(
    ("parameters", "instance", "why"),
    [
        ({"ATK_KIND": 1}, 3, "UAV 1 does not hear UAV 3"),
        ({"ATK_KIND": 6, "ATK_SIZE": 1.0}, 0, "an oscillation needs one"),
        ({"ATK_KIND": 4}, 0, "ATK_DELAY 0 s: 0.05 to 819.15 s"),
        ({"ATK_KIND": 1, "ATK_SIGNALS": 4}, 0, "ATK_SIGNALS 4: it shares zhat, v"),
        ({"ATK_KIND": 1, "ATK_UNTIL": 5}, 0, "not after the beginning"),
        ({"ATK_KIND": 9, "ATK_AS": 2}, 0, "ask those who hear both"),
        ({"ATK_KIND": 9, "ATK_AS": 3}, 6, "does not hear UAV 3"),
    ],
)
def test_a_lie_that_cannot_be_is_denied(
    both: tuple[Bench, Station], parameters: dict[str, float], instance: int, why: str
) -> None:
    bench, station = both
    for name, value in parameters.items():
        station.set(1, name, value)
    with pytest.raises(RefusedError, match="denied") as refused:
        station.command(1, M.MAV_CMD_INJECT_FAILURE, UNITS["radio"].code, KINDS["wrong"], instance)
    assert why in str(refused.value)
    assert not in_force(bench)


def test_signals_are_called_by_their_names(both: tuple[Bench, Station], tmp_path: Path) -> None:
    bench, station = both
    (tmp_path / "scenario.toml").write_text('scheme = "containment"\n')
    station.attack(1, "offset", signals=["v"], size=0.5)
    told = fly_on(bench, 1, 7)
    true = bench.process.group.autopilots.shared[0]
    assert np.array_equal(told - true, [0.0, 0.5, 0.0, 0.0])
    with pytest.raises(StationError, match="UAV 1, a follower, shares no altitude; it shares zhat, v"):
        station.attack(1, "offset", signals=["altitude"], size=0.5)


@pytest.mark.parametrize(
    ("kind", "fields", "why"),
    [
        ("lie", {}, "no such kind; there are offset, drift"),
        ("offset", {}, "needs size"),
        ("drift", {}, "needs rate"),
        ("freeze", {"size": 1.0}, "takes no size; its sizes: none"),
        ("freeze", {"to": 6}, "UAV 6 does not hear UAV 1; nobody does"),
        ("freeze", {"at": 2.0, "until": 1.0}, "must be later than the beginning"),
        ("sybil", {"victim": 2}, "nobody who is asked hears both"),
        ("offset", {"size": float("nan")}, "finite"),
    ],
)
def test_the_station_refuses_what_nobody_could_tell(station: Station, kind: str, fields: dict, why: str) -> None:
    with pytest.raises(StationError) as refused:
        station.attack(1, kind, **fields)
    assert not isinstance(refused.value, RefusedError)
    assert why in str(refused.value)
