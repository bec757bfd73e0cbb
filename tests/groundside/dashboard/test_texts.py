"""Texts: labels, table, events, titles, pace."""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path

import numpy as np
import pytest
import rerun as rr

from ftcc.groundside.dashboard.pace import describe_pace
from ftcc.groundside.dashboard.snapshot import Pace, Snapshot, UavState
from tests.groundside.dashboard.recorded import DURATION, at, make, rows
from tests.groundside.dashboard.synthetic_swarm import EVENTS, FAULT_AT, GRAPH, flight


def test_a_fault_is_written_at_its_aircraft_and_in_the_table(recording: Path) -> None:
    label = at(recording, "/world/uav/1/label", "Points3D:labels", FAULT_AT - 0.1)
    assert label == ["UAV 1"]
    label = at(recording, "/world/uav/1/label", "Points3D:labels", FAULT_AT)
    assert label == ["UAV 1: elevator 70 % +0.35"]
    table = at(recording, "/swarm", "TextDocument:text", DURATION)[0]
    assert re.search(r"\| 2 \|.*\| mission \|", table)
    assert "elevator 70 %" in next(line for line in table.splitlines() if line.startswith("| 1 |"))


def test_events_are_logged_at_their_times(recording: Path) -> None:
    times, texts = rows(recording, "/events", "TextLog:text")
    np.testing.assert_allclose(times, [event.t for event in EVENTS])
    assert texts[2] == [f"{FAULT_AT:.1f} s  UAV 1: elevator fault: effectiveness 70 %, bias +0.35 rad"]
    _, levels = rows(recording, "/events", "TextLog:level")
    assert levels == [["INFO"], ["WARN"], ["ERROR"], ["INFO"]]


def test_the_recording_carries_its_blueprint(recording: Path) -> None:
    reader = rr.chunk.RrdReader(recording)
    (blueprint,) = reader.blueprints()
    shown = [chunk.to_record_batch() for chunk in reader.stream(store=blueprint).to_chunks()]
    texts = {str(value) for batch in shown for name in batch.schema.names if ":" in name for value in batch[name]}
    for title in (
        "Altitude, m (band: hull, thin: reference)",
        "Altitude tracking error S1, m",
        "Events",
    ):
        assert any(title in text for text in texts)


def test_a_uav_that_falls_silent_is_labelled_so(tmp_path: Path) -> None:
    dashboard = make(tmp_path / "swarm.rrd")
    silent: UavState | None = None
    for snap in flight(4.0):
        uavs = dict(snap.uavs)
        silent = dataclasses.replace(uavs[5], links={}) if snap.t <= 1.0 else silent
        del uavs[6]
        assert silent is not None
        dashboard.log(Snapshot(snap.t, uavs | {5: silent}, snap.events))
    dashboard.close()
    assert at(tmp_path / "swarm.rrd", "/world/uav/5/label", "Points3D:labels", 4.0) == ["UAV 5: silent since 1 s"]
    assert at(tmp_path / "swarm.rrd", "/world/uav/6/label", "Points3D:labels", 4.0) == ["UAV 6: no telemetry"]
    notes = at(tmp_path / "swarm.rrd", "/graph/notes", "Points2D:labels", 4.0)
    assert notes == ["none received"] * len(GRAPH.senders(6)), "the links to UAV 5 are unknown"
    assert np.isnan(at(tmp_path / "swarm.rrd", "/plots/motion/z/uavs", "Scalars:scalars", 4.0)[5])


@pytest.mark.parametrize("measured_from", [0.0, 2.0])
def test_the_pace_is_written_and_drawn_from_its_first_measurement(tmp_path: Path, measured_from: float) -> None:
    pace = Pace(5.2, 10.0, "both cores busy", "try --pack auto")
    dashboard = make(tmp_path / "swarm.rrd")
    for snap in flight(4.0):
        dashboard.log(dataclasses.replace(snap, pace=pace if snap.t >= measured_from else None))
    dashboard.close()
    times, values = rows(tmp_path / "swarm.rrd", "/plots/pace", "Scalars:scalars")
    assert times[0] == measured_from
    assert values[-1] == [5.2, 10.0]
    shown = at(tmp_path / "swarm.rrd", "/swarm", "TextDocument:text", 3.0)[0]
    assert shown.startswith("5.2 x real time (asked: 10): both cores busy, try --pack auto\n")


@pytest.mark.parametrize(
    ("pace", "words"),
    [
        (Pace(1.0, 1.0), "1 x real time"),
        (Pace(12.4, None), "12 x real time (as fast as possible)"),
        (Pace(math.nan, 2.0), "- x real time (asked: 2)"),
    ],
)
def test_the_pace_in_words(pace: Pace, words: str) -> None:
    assert describe_pace(pace) == words
