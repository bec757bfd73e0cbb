"""A run as other people's programs read it, each export against what was recorded."""

from __future__ import annotations

import json
import math
import sys
import xml.etree.ElementTree as ET
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.csv as pc
import pyarrow.parquet as pq
import pytest
from pyulog import ULog
from scipy.io import loadmat
from scipy.spatial.transform import Rotation

from ftcc.groundside import MissingPackageError, Run, RunError, export, simulate
from ftcc.groundside.cli.app import main
from ftcc.groundside.results import FORMATS
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


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """The first 1.2 s of the demo, with a fault of UAV 1 at 0.5 s."""
    folder = tmp_path_factory.mktemp("runs") / "short"
    return simulate("demo", folder, duration=1.2, settings={"faults.0": {"at": 0.5, "effectiveness": 0.9, "bias": 0.0}})


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


def numbers(run: Run, uav: int, row: int) -> dict[str, float]:
    """The finite numbers of a recorded row."""
    found = {name: float(run.column(name, uav)[row]) for name in run.names if name != "uav"}
    return {name: x for name, x in found.items() if math.isfinite(x)}


def test_csv_parquet_and_mat_have_the_recorded_values(short: Run, tmp_path: Path) -> None:
    for name in ("csv", "parquet", "mat"):
        assert export(short, name, tmp_path / f"signals.{name}") == [tmp_path / f"signals.{name}"]
    table = pc.read_csv(tmp_path / "signals.csv")
    assert pq.read_table(tmp_path / "signals.parquet").schema.field("z").metadata[b"unit"] == b"m"
    for name in short.names:
        column = short.signals.column(name).to_numpy()
        np.testing.assert_array_equal(table.column(name).to_numpy(), column)
        np.testing.assert_array_equal(pq.read_table(tmp_path / "signals.parquet").column(name).to_numpy(), column)
    mat = loadmat(tmp_path / "signals.mat", simplify_cells=True)
    np.testing.assert_array_equal(mat["uav3"]["S1"], short.column("S1", 3))
    assert mat["units"]["z"] == "m"


def test_mcap_holds_the_recording_and_what_foxglove_shows(short: Run, tmp_path: Path) -> None:
    reader = pytest.importorskip("mcap.reader")
    (file,) = export(short, "mcap", tmp_path / "flight.mcap")
    found: dict[str, list[tuple[int, dict[str, Any]]]] = {}
    schemas, times = {}, []
    with file.open("rb") as stream:
        read = reader.make_reader(stream)
        for schema, channel, message in read.iter_messages(log_time_order=False):
            found.setdefault(channel.topic, []).append((message.log_time, json.loads(message.data)))
            schemas[channel.topic] = (schema.name, json.loads(schema.data)["properties"])
            times.append(message.log_time)
        assert [a.data for a in read.iter_attachments()] == [(short.path / "scenario.toml").read_bytes()]
    assert times == sorted(times)
    for uav in short.uavs:
        recording = found[f"/uav{uav}/recording"]
        assert [row for _, row in recording] == [numbers(short, uav, row) for row in range(121)]
        since = [(stamp - round(short.started * 1e9)) / 1e9 for stamp, _ in recording]
        assert since == pytest.approx(short.column("t", uav), abs=1e-9)
        assert len(found[f"/uav{uav}/pose"]) == len(found[f"/uav{uav}/position"]) == 13
    assert schemas["/uav1/recording"][1]["z"] == {"type": "number", "description": "altitude, up, m"}
    assert "S1" not in schemas["/uav8/recording"][1]  # a leader has no law
    kinds = {"position": "LocationFix", "pose": "PoseInFrame"}
    assert {topic: schemas[f"/uav2/{topic}"][0] for topic in kinds} == {t: f"foxglove.{k}" for t, k in kinds.items()}
    fix = found["/uav2/position"][-1][1]
    latitude, longitude, altitude = places(short, 2, 120)
    assert (fix["latitude"], fix["longitude"]) == pytest.approx((latitude, longitude), abs=1e-7)
    assert fix["altitude"] == pytest.approx(altitude, abs=1e-3)
    pose = found["/uav2/pose"][-1][1]["pose"]
    x, y, z = (short.column(name, 2)[120] for name in ("x", "y", "z"))
    assert list(pose["position"].values()) == pytest.approx([y, x, z], abs=1e-3)
    nose = Rotation.from_quat(list(pose["orientation"].values())).apply([1.0, 0.0, 0.0])
    theta = short.column("theta", 2)[120]
    assert nose == pytest.approx([0.0, math.cos(theta), math.sin(theta)], abs=1e-6)
    assert {row["child_frame_id"] for _, row in found["/tf"]} == {f"uav{uav}" for uav in short.uavs}
    logs = [(row["name"], row["level"], row["message"]) for _, row in found["/events"]]
    assert ("UAV 1", 3, "elevator fault: effectiveness 0.9, bias 0 rad") in logs


def test_rosbag2_holds_the_recording_and_odometry(short: Run, tmp_path: Path) -> None:
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    export(short, "rosbag2", tmp_path / "bag")
    store = get_typestore(Stores.ROS2_HUMBLE)
    found: dict[str, list[Any]] = {}
    with rosbag2.Reader(tmp_path / "bag") as bag:
        for connection, _, data in bag.messages():
            found.setdefault(connection.topic, []).append(store.deserialize_cdr(data, connection.msgtype))
    names = found["/uav2/columns"][0].data.split(",")
    assert names == list(numbers(short, 2, 60))
    rows = np.array([message.data for message in found["/uav2/recording"]])
    np.testing.assert_array_equal(rows, np.column_stack([short.column(name, 2) for name in names]))
    moved, fix = found["/uav2/odometry"][-1], found["/uav2/fix"][-1]
    assert (len(found["/uav2/odometry"]), moved.child_frame_id) == (13, "uav2")
    speed, alpha = short.column("V", 2)[120], short.column("alpha", 2)[120]
    along = moved.twist.twist.linear
    expected = [speed * math.cos(alpha), 0.0, -speed * math.sin(alpha)]
    assert [along.x, along.y, along.z] == pytest.approx(expected, abs=1e-4)
    assert moved.twist.twist.angular.y == pytest.approx(-short.column("q", 2)[120], abs=1e-6)
    assert fix.altitude == pytest.approx(places(short, 2, 120)[2], abs=1e-3)
    assert "elevator fault: effectiveness 0.9, bias 0 rad" in [log.msg for log in found["/rosout"]]
    with pytest.raises(RunError, match="bag: exists"):
        export(short, "rosbag2", tmp_path / "bag")


def command(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    """Call ``ftcc`` in this process; return its exit code."""
    monkeypatch.setattr(sys, "argv", ["ftcc", *arguments])
    with pytest.raises(SystemExit) as end:
        main()
    return int(end.value.code or 0)


def test_the_command_exports_into_the_run_or_where_it_is_told(
    short: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command(monkeypatch, "export", str(short.path), "--format", "gpx") == 0
    assert (short.path / "export" / "tracks.gpx").is_file()
    assert command(monkeypatch, "export", str(short.path), "--format", "parquet") == 0
    assert f"wrote {short.path / 'signals.parquet'}" in capsys.readouterr().err
    assert command(monkeypatch, "export", str(short.path), "--format", "kml", "--out", str(tmp_path / "a.kml")) == 0
    assert (tmp_path / "a.kml").is_file()
    assert command(monkeypatch, "export", str(short.path), "--format", "xls") == 2
    assert capsys.readouterr().err.endswith(f"unknown format 'xls'; there are {', '.join(FORMATS)}\n")
    out = tmp_path / "none" / "a.csv"
    assert command(monkeypatch, "export", str(short.path), "--format", "csv", "--out", str(out)) == 2
    assert f"--out {out}: cannot be written: " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("format", "package", "module", "instead"),
    [("mcap", "mcap", "mcap.writer", "ulog"), ("rosbag2", "rosbags", "rosbags.rosbag2", "mcap")],
)
def test_a_missing_library_is_one_line(
    short: Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    format: str,
    package: str,
    module: str,
    instead: str,
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.delitem(sys.modules, module, raising=False)
    text = (
        f"format {format}: {package} is not installed; install it with: pip install 'ftcc-sitl[{format}]', "
        f"or use --format {instead}"
    )
    with pytest.raises(MissingPackageError) as missing:
        export(short, format, tmp_path / "out")
    assert str(missing.value) == text
    assert command(monkeypatch, "export", str(short.path), "--format", format, "--out", str(tmp_path / "out")) == 2
    assert capsys.readouterr().err == f"ftcc: {text}\n"
    assert not (tmp_path / "out").exists()
