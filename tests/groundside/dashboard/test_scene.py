"""The scene: aircraft, references, trails and links, at their true positions or in lanes."""

from __future__ import annotations

import collections
import dataclasses
from pathlib import Path

import numpy as np
import pytest

from ftcc.groundside.dashboard.scene import LANE
from ftcc.groundside.dashboard.snapshot import Snapshot
from ftcc.groundside.palette import CUT, DOUBTED, FRESH, GRAY, STALE, colors
from tests.groundside.dashboard.recorded import at, make, rows
from tests.groundside.dashboard.synthetic_swarm import CUT as CUT_FROM_TO
from tests.groundside.dashboard.synthetic_swarm import FOLLOWERS, GRAPH, LEADERS, snapshot

EDGES = sorted((sender, receiver) for receiver, sender in GRAPH.weights)


def test_a_reference_is_an_outline_at_the_reference_position(recording: Path) -> None:
    uavs = snapshot(21.0).uavs
    _, north, up = at(recording, "/world/reference/1", "Transform3D:translation", 21.0)[0]
    assert up == pytest.approx(uavs[1].signals["zhat"], abs=1e-3)
    assert north == pytest.approx(uavs[1].truth["x"], abs=1e-3)
    assert rows(recording, "/world/reference/7", "Transform3D:translation")[1] == []


def test_aircraft_are_drawn_at_their_true_positions_in_lanes_and_with_their_attitude(recording: Path) -> None:
    t = 10.0
    for i, uav in enumerate((*FOLLOWERS, *LEADERS)):
        truth = snapshot(t).uavs[uav].truth
        east, north, up = at(recording, f"/world/uav/{uav}", "Transform3D:translation", t)[0]
        assert (north, up) == pytest.approx((truth["x"], truth["z"]), abs=1e-3)
        assert east == pytest.approx(truth["y"] + LANE * (i - 3.5), abs=1e-3)
        x, y, z, w = at(recording, f"/world/uav/{uav}", "Transform3D:quaternion", t)[0]
        nose = (1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w))
        assert nose == pytest.approx((0.0, np.cos(truth["theta"]), np.sin(truth["theta"])), abs=1e-5)


def test_the_scene_moves_with_the_swarm(recording: Path) -> None:
    centre = at(recording, "/world/centre", "Transform3D:translation", 20.0)[0]
    assert centre[1] == pytest.approx(600.0, abs=3.0)


def test_trails_join_one_instant_to_the_next(recording: Path) -> None:
    before = at(recording, "/world/trails", "LineStrips3D:strips", 9.9)
    after = at(recording, "/world/trails", "LineStrips3D:strips", 10.0)
    np.testing.assert_allclose([strip[1] for strip in before], [strip[0] for strip in after])


@pytest.mark.parametrize(
    ("t", "edge", "color"),
    [
        (11.0, (4, 3), FRESH),
        (0.5 * sum(CUT_FROM_TO), (4, 3), CUT),
        (CUT_FROM_TO[1], (4, 3), FRESH),
        (15.2, (5, 6), FRESH),
        (16.0, (5, 6), STALE),
        (16.0, (7, 1), FRESH),
    ],
)
def test_edges_are_coloured_by_their_state(
    recording: Path, t: float, edge: tuple[int, int], color: tuple[int, int, int]
) -> None:
    rgba = np.uint32(at(recording, "/world/links", "Arrows3D:colors", t)[EDGES.index(edge)])
    assert tuple(int(rgba >> shift & 0xFF) for shift in (24, 16, 8)) == color
    assert at(recording, "/graph/links", "Arrows2D:colors", t)[EDGES.index(edge)] == rgba


def test_an_edge_whose_sender_is_distrusted_has_a_colour_and_a_note_of_its_own(tmp_path: Path) -> None:
    snap = snapshot(5.0)
    receiver, sender = 1, min(snap.uavs[1].links)
    state = snap.uavs[receiver]
    doubted = {**state.links, sender: dataclasses.replace(state.links[sender], trust=0.27)}
    uavs = {**snap.uavs, receiver: dataclasses.replace(state, links=doubted)}
    dashboard = make(tmp_path / "swarm.rrd")
    dashboard.log(Snapshot(5.0, uavs))
    dashboard.close()
    rgba = np.uint32(
        at(tmp_path / "swarm.rrd", "/graph/links", "Arrows2D:colors", 5.0)[EDGES.index((sender, receiver))]
    )
    assert tuple(int(rgba >> shift & 0xFF) for shift in (24, 16, 8)) == DOUBTED
    assert "trust 0.2" in at(tmp_path / "swarm.rrd", "/graph/notes", "Points2D:labels", 5.0)
    assert f"distrusts {sender}" in at(tmp_path / "swarm.rrd", "/swarm", "TextDocument:text", 5.0)[0]


@pytest.mark.parametrize(("doubting", "notes"), [(1, 0), (2, 1), (3, 1)])
def test_a_sender_whom_half_of_its_receivers_distrust_has_one_note(tmp_path: Path, doubting: int, notes: int) -> None:
    snap = snapshot(5.0)
    liar, times = collections.Counter(sender for sender, _ in EDGES).most_common(1)[0]
    assert times == 3
    doubtful = [receiver for sender, receiver in EDGES if sender == liar][:doubting]
    uavs = {
        uav: dataclasses.replace(
            state,
            links={
                sender: dataclasses.replace(link, trust=0.1) if sender == liar and uav in doubtful else link
                for sender, link in state.links.items()
            },
        )
        for uav, state in snap.uavs.items()
    }
    dashboard = make(tmp_path / "swarm.rrd")
    dashboard.log(Snapshot(5.0, uavs))
    dashboard.close()
    assert at(tmp_path / "swarm.rrd", "/graph/notes", "Points2D:labels", 5.0).count("trust 0.1") == notes


def test_a_formation_that_spreads_is_not_put_into_lanes(tmp_path: Path) -> None:
    snap = snapshot(0.0)
    spread = {
        uav: dataclasses.replace(state, truth={**state.truth, "y": 100.0 * uav}) for uav, state in snap.uavs.items()
    }
    dashboard = make(tmp_path / "swarm.rrd")
    dashboard.log(Snapshot(0.0, spread))
    dashboard.close()
    assert at(tmp_path / "swarm.rrd", "/world/uav/4", "Transform3D:translation", 0.0)[0][0] == 400.0


def test_colours_are_distinct_and_readable_on_white_and_on_black() -> None:
    tints = [*colors(range(1, 21)).values(), GRAY, FRESH, STALE, CUT]
    assert len(set(tints)) == len(tints)
    for tint in tints:
        channel = np.array(tint) / 255.0
        linear = np.where(channel <= 0.04045, channel / 12.92, ((channel + 0.055) / 1.055) ** 2.4)
        luminance = float(linear @ (0.2126, 0.7152, 0.0722))
        # Contrast ratio as the Web Content Accessibility Guidelines define it.
        assert 1.05 / (luminance + 0.05) > 2.0
        assert (luminance + 0.05) / 0.05 > 3.0
