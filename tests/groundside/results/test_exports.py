"""A run as other people's programs read it: KML, GPX and ULog against what was recorded."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from pyulog import ULog

from ftcc.groundside import Run, export
from ftcc.link.home import Home

KML = {"k": "http://www.opengis.net/kml/2.2", "gx": "http://www.google.com/kml/ext/2.2"}
GPX = {"g": "http://www.topografix.com/GPX/1/1"}
METRES = math.radians(1.0) * 6_378_137.0
"""In a degree of latitude."""


def places(run: Run, uav: int, row: int) -> tuple[float, float, float]:
    """Latitude and longitude (deg) and altitude (m) of a recorded row."""
    x, y, z = (float(run.column(name, uav)[row]) for name in ("x", "y", "z"))
    latitude, longitude, altitude = run.mission.home
    return latitude + x / METRES, longitude + y / METRES / math.cos(math.radians(latitude)), altitude + z


def test_gpx_and_kml_have_a_track_of_every_uav(demo_run: Run, tmp_path: Path) -> None:
    export(demo_run, "kml", tmp_path / "tracks.kml")
    export(demo_run, "gpx", tmp_path / "tracks.gpx")
    marks = ET.parse(tmp_path / "tracks.kml").findall("k:Document/k:Placemark", KML)
    tracks = ET.parse(tmp_path / "tracks.gpx").findall("g:trk", GPX)
    names = [f"UAV {uav}" for uav in range(1, 9)]
    assert [mark.findtext("k:name", "", KML) for mark in marks] == names
    assert [track.findtext("g:name", "", GPX) for track in tracks] == names
    for uav, mark, track in zip(range(1, 9), marks, tracks, strict=True):
        whens = [when.text or "" for when in mark.findall("gx:Track/k:when", KML)]
        coordinates = [tuple(map(float, (c.text or "").split())) for c in mark.findall("gx:Track/gx:coord", KML)]
        points = track.findall("g:trkseg/g:trkpt", GPX)
        # 120 s at 10 Hz, both ends included.
        assert len(whens) == len(coordinates) == len(points) == 1201
        times = [datetime.fromisoformat(when).timestamp() - demo_run.started for when in whens]
        assert times == pytest.approx(np.arange(1201) / 10.0, abs=2e-3)
        assert [point.findtext("g:time", "", GPX) for point in points] == whens
        for n, row in ((0, 0), (600, 6000), (1200, 12000)):
            latitude, longitude, altitude = places(demo_run, uav, row)
            assert coordinates[n] == pytest.approx((longitude, latitude, altitude), abs=1e-3)
            assert coordinates[n][:2] == pytest.approx((longitude, latitude), abs=1e-7)
            point = points[n]
            told = (float(point.get("lon", "nan")), float(point.get("lat", "nan")))
            assert (*told, float(point.findtext("g:ele", "nan", GPX))) == coordinates[n]


def test_ulog_holds_the_recording_and_what_px4_would_tell(demo_run: Run, tmp_path: Path) -> None:
    files = export(demo_run, "ulog", tmp_path / "logs")
    assert [file.name for file in files] == [f"uav{uav}.ulg" for uav in range(1, 9)]
    log = ULog(str(files[3]))
    assert not log.file_corruption
    recording = log.get_dataset("ftcc_recording").data
    assert recording["timestamp"].tolist() == np.rint(demo_run.column("t", 4) * 1e6).tolist()
    for name in ("z", "V", "elevator_command", "S1"):
        np.testing.assert_array_equal(recording[name], demo_run.column(name, 4))
    place = log.get_dataset("vehicle_gps_position").data
    assert len(place["lat"]) == 1201
    latitude, longitude, altitude = places(demo_run, 4, 12000)
    assert place["lat"][-1] == pytest.approx(latitude * 1e7, abs=2)
    assert place["lon"][-1] == pytest.approx(longitude * 1e7, abs=2)
    assert place["alt"][-1] == pytest.approx(altitude * 1e3, abs=1)
    assert place["time_utc_usec"][-1] / 1e6 == pytest.approx(demo_run.started + 120.0, abs=1e-3)
    pose = log.get_dataset("vehicle_attitude").data
    pitch = 2.0 * math.asin(float(pose["q[2]"][0]))
    assert pitch == pytest.approx(float(demo_run.column("theta", 4)[0]), abs=1e-6)
    local = log.get_dataset("vehicle_local_position").data
    assert local["z"][0] == -demo_run.column("z", 4)[0]
    assert local["vx"][0] == pytest.approx(30.0, abs=1e-6)
    assert log.initial_parameters["k11"] == np.float32(demo_run.scenario.plan.gains.common["k11"])
    assert "link 8 - 4 cut" in [message.message for message in log.logged_messages]
    # A leader has no law.
    leader = ULog(str(files[7]))
    assert "S1" not in leader.get_dataset("ftcc_recording").data
    assert leader.initial_parameters == {}


def test_a_longitude_beyond_half_a_turn_comes_in_from_the_other_side() -> None:
    assert Home(0.0, 180.0, 0.0).place(0.0, 0.0) == (0, -1_800_000_000)
    assert Home(0.0, 179.9999, 0.0).place(0.0, 20.0)[1] == pytest.approx(-1_799_999_203, abs=1)
    assert Home(0.0, -180.0, 0.0).place(0.0, -1e-9) == (0, -1_800_000_000)
