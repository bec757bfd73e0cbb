"""Big swarms in the dashboard: a few aircraft in full, all others in one call, whatever their number."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import Any

import numpy as np
import pytest

from ftcc.groundside.dashboard.artists import Artists
from ftcc.groundside.dashboard.detail import FULL, TROUBLED, Detail
from ftcc.groundside.dashboard.links import Links
from ftcc.groundside.dashboard.shapes import Poses, sticks
from ftcc.groundside.dashboard.snapshot import Pace, Snapshot, UavState
from ftcc.groundside.dashboard.viewer import Entry
from ftcc.groundside.palette import CUT
from tests.groundside.dashboard.synthetic_crowd import BROKEN, DEAF, SILENT, flight, graph, snapshot, subject

DURATION = 60.0
Flown = tuple[Artists, dict[str, list[Any]]]
ORDINARY = 80
"""A UAV without faults or silence."""


def drawn(n: int, family: Any = "containment") -> list[Entry]:
    """A snapshot in the middle of an uneventful flight."""
    artists = Artists(dataclasses.replace(subject(n), family=family), snapshot(n, 2.0))
    artists.draw(snapshot(n, 2.0))
    return artists.draw(snapshot(n, 3.0))


def values(what: Any, name: str) -> Any:
    return getattr(what, name).as_arrow_array().to_pylist()


@pytest.fixture(scope="module")
def flown() -> Flown:
    """A flight of a hundred UAVs: its artists, and all entries by entity."""
    artists: Artists | None = None
    entries: list[Entry] = []
    for snap in flight(100, DURATION, rate=2.0):
        if artists is None:
            artists = Artists(subject(100), snap)
            entries += artists.static()
        entries += artists.draw(snap)
    by_path: dict[str, list[Any]] = {}
    for entry in entries:
        by_path.setdefault(entry.path, []).append(entry.what)
    assert artists is not None
    return artists, by_path


@pytest.mark.parametrize("family", ["containment", "attitude"])
def test_a_picture_takes_as_many_calls_whatever_the_size_of_the_swarm(family: str) -> None:
    counts = {n: len(drawn(n, family)) for n in (20, 60, 150)}
    assert len(set(counts.values())) == 1
    assert counts[150] <= len(drawn(FULL, family))


def test_a_small_swarm_is_drawn_in_full() -> None:
    crew = subject(FULL)
    detail = Detail(crew)
    assert not detail.crowded
    assert detail.shown == sorted(crew.graph.uavs)
    paths = {entry.path for entry in drawn(FULL)}
    assert {f"/world/uav/{uav}" for uav in crew.graph.uavs} <= paths
    assert "/world/others" not in paths


def test_all_others_are_drawn_where_they_are() -> None:
    others = next(entry.what for entry in drawn(100) if entry.path == "/world/others")
    strips = np.array(values(others, "strips"))
    assert len(strips) == 3 * (100 - len(Detail(subject(100)).shown))
    uavs = snapshot(100, 3.0).uavs
    full = Detail(subject(100)).shown
    true = [uavs[uav].truth for uav in sorted(uavs) if uav not in full]
    wings = strips[1::3].mean(axis=1)
    np.testing.assert_allclose(wings, [(state["y"], state["x"], state["z"]) for state in true], atol=0.01)


def test_a_stick_has_the_attitude_of_its_aircraft() -> None:
    truth = {"chi": 0.4, "gamma": 0.1, "mu": -0.3, "alpha": 0.05, "beta": 0.02}
    place = np.array([10.0, 20.0, 30.0])
    x, y, z, w = values(Poses().of(place, truth), "quaternion")[0]
    axes = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z)],
            [2 * (x * z - w * y), 2 * (y * z + w * x)],
        ]
    )
    fuselage, wing, _ = sticks(place[None], [truth], 2.0)
    for line, axis in ((fuselage, axes[:, 0]), (wing, axes[:, 1])):
        along = (line[1] - line[0]) / np.linalg.norm(line[1] - line[0])
        np.testing.assert_allclose(along, axis, atol=1e-6)


def test_who_gets_into_trouble_comes_into_view(flown: Flown) -> None:
    artists, entries = flown
    first = Detail(subject(100)).shown
    troubled = [uav for uav, _ in BROKEN.values()]
    assert set(artists._detail.shown) - set(first) == {*troubled, SILENT[0]}
    label = values(entries[f"/world/uav/{troubled[0]}/label"][-1], "labels")
    assert label == [f"UAV {troubled[0]}: fault"]
    assert f"/world/uav/{troubled[0]}" in entries
    assert f"/world/uav/{ORDINARY}" not in entries


def test_curves_keep_their_places_as_uavs_come_into_view(
    flown: Flown,
) -> None:
    artists, entries = flown
    lines = [what for what in entries["/plots/errors/S1"] if hasattr(what, "names")]
    names = [values(line, "names") for line in lines]
    assert len(names) > 1, "they are named anew when somebody comes into view"
    followers = [uav for uav in artists._detail.shown if uav not in subject(100).leaders]
    assert names[-1][2 : 2 + len(followers)] == [f"UAV {uav}" for uav in followers]
    numbers = [values(what, "scalars") for what in entries["/plots/errors/S1"] if hasattr(what, "scalars")]
    assert {len(row) for row in numbers} == {len(names[0])}
    for before, after in itertools.pairwise(names):
        assert all(old in ("", new) for old, new in zip(before, after, strict=True))
    lowest, highest = numbers[-1][:2]
    errors = [s.signals["S1"] for s in snapshot(100, DURATION, DURATION).uavs.values() if s.signals]
    assert (lowest, highest) == (min(errors), max(errors))


def test_no_more_than_a_few_are_drawn_in_full_if_all_have_faults() -> None:
    crew = subject(100)
    detail = Detail(crew)
    calm = snapshot(100, 1.0)
    assert detail.update(calm) == []
    broken = {
        uav: dataclasses.replace(state, effectiveness={"elevator": 0.5}) if state.signals else state
        for uav, state in calm.uavs.items()
    }
    assert len(detail.update(Snapshot(1.1, broken))) == TROUBLED
    assert len(detail.shown) == FULL
    assert detail.update(Snapshot(1.2, broken)) == []


def test_edges_without_news_are_drawn_among_the_aircraft(
    flown: Flown,
) -> None:
    _, entries = flown
    tints = [what for what in entries["/world/links"] if what.colors is not None][-1]
    cut = (CUT[0] << 24) + (CUT[1] << 16) + (CUT[2] << 8) + 255
    assert values(tints, "colors").count(cut) == len(graph(100).senders(DEAF[0]))
    notes = values(entries["/graph/notes"][-1], "labels")
    assert len([note for note in notes if note.startswith("cut")]) == 1, "one to a receiver"


def test_the_table_lists_uavs_in_trouble_first(flown: Flown) -> None:
    _, entries = flown
    lines = values(entries["/swarm"][-1], "text")[0].splitlines()
    assert lines[0] == "10 x real time"
    assert lines[2].startswith("100 UAVs, 1 silent, 3 with faults")
    rows = [line.split("|")[1].strip() for line in lines if line.startswith("|")][2:]
    assert rows[:4] == ["17", "41", "58", "83"]
    assert len(rows) <= FULL


@pytest.mark.parametrize(
    ("pace", "silent"),
    [
        (None, [9]),
        (Pace(1.0, 1.0), [9]),
        (Pace(0.5, 1.0), [9]),
        (Pace(20.0, None), []),
        (Pace(math.nan, None), []),
        (Pace(math.nan, 5.0), []),
        (Pace(1.1, 5.0), []),
    ],
)
def test_a_swarm_that_flies_fast_is_not_taken_for_silent(pace: Pace | None, silent: list[int]) -> None:
    late = snapshot(100, 3.0)
    uavs: dict[int, UavState] = dict(late.uavs)
    uavs[9] = dataclasses.replace(uavs[9], t=1.0)
    assert Detail(subject(100)).update(Snapshot(3.0, uavs, pace=pace)) == silent


@pytest.mark.parametrize("apart", [0.0, 30.0])
def test_those_who_fly_abreast_stand_in_ranks(apart: float) -> None:
    plane = snapshot(100, 0.0, abreast=True)
    line = {uav: dataclasses.replace(s, truth={**s.truth, "y": apart * uav}) for uav, s in plane.uavs.items()}
    artists = Artists(subject(100), Snapshot(0.0, line))
    assert "ranks" in artists._scene.title
    assert "frames" in artists._scene.title
    spread = np.ptp(artists._scene._positions, axis=0)
    assert spread[0] < 250.0
    assert spread[1] < 250.0


def test_the_frame_leaves_out_who_has_been_left_behind(
    flown: Flown,
) -> None:
    _, entries = flown
    corners = np.vstack(values(entries["/world/hull"][-1], "strips"))
    assert np.ptp(corners[:, 1]) < 500.0, f"UAV {SILENT[0]} is 720 m behind"


@pytest.mark.parametrize("leaders", [1, 8, 30])
def test_leaders_have_separate_positions_in_the_graph(leaders: int) -> None:
    swarm = dataclasses.replace(subject(100), graph=graph(100, leaders))
    layout = Links(swarm, Detail(swarm))._layout
    places = [layout[uav] for uav in swarm.leaders]
    apart = [math.dist(a, b) for i, a in enumerate(places) for b in places[:i]]
    assert min(apart, default=1.0) > 0.05
