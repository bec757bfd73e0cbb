"""The dashboard, read back from its recording, and what its viewer may cost the swarm: nothing."""

from __future__ import annotations

import dataclasses
import math
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr

from ftcc.airside.scheme import Quantity
from ftcc.groundside.dashboard import Dashboard
from ftcc.groundside.dashboard.detail import Detail
from ftcc.groundside.dashboard.pace import describe_pace
from ftcc.groundside.dashboard.plots import Plots
from ftcc.groundside.dashboard.scene import LANE
from ftcc.groundside.dashboard.snapshot import Pace, Snapshot, UavState
from ftcc.groundside.dashboard.viewer import Entry, Viewer
from ftcc.groundside.palette import CUT, FRESH, GRAY, STALE, colors
from ftcc.sim.obstacles import Obstacle
from tests import rrd
from tests.groundside.synthetic_swarm import (
    CUT as CUT_FROM_TO,
)
from tests.groundside.synthetic_swarm import (
    FAULT_AT,
    FOLLOWERS,
    GRAPH,
    HAPPENINGS,
    LEADERS,
    LIMITS,
    SIGNALS,
    SUBJECT,
    flight,
    leaders_at,
    snapshot,
)

DURATION = 32.0
EDGES = sorted((sender, receiver) for receiver, sender in GRAPH.weights)

STATION = """
import sys, time
from pathlib import Path
from ftcc.groundside.dashboard import Dashboard
from tests.groundside.synthetic_swarm import *
recording = Path(sys.argv[1]) if sys.argv[1] != "-" else None
dashboard = Dashboard(SUBJECT, recording=recording, viewer=sys.argv[2])
print(dashboard._viewer._process.pid if dashboard._viewer else "rerun" in sys.modules, flush=True)
for s in flight(float(sys.argv[3])):
    dashboard.log(s)
    if s.t >= 1.0:
        time.sleep(0.05)
        print(s.t, flush=True)
dashboard.close()
"""
"""A station of its own, to be killed: recording, viewer, duration."""


def make(recording: Path | None, viewer: Any = "none", **others: Any) -> Dashboard:
    return Dashboard(SUBJECT, recording=recording, viewer=viewer, **others)


def station(*arguments: str, **environment: str) -> subprocess.Popen[str]:
    program = [sys.executable, "-c", STATION, *arguments]
    root = Path(__file__).parents[2]
    return subprocess.Popen(program, stdout=subprocess.PIPE, text=True, cwd=root, env=os.environ | environment)


def rows(path: Path, entity: str, component: str) -> tuple[np.ndarray, list[Any]]:
    """Times, s (nan where it holds always), and values of a component of an entity."""
    times: list[float] = []
    values: list[Any] = []
    for chunk in rrd.chunks(path):
        batch = chunk.to_record_batch()
        if str(chunk.entity_path) != entity or component not in batch.schema.names:
            continue
        some = batch[component].to_pylist()
        static = [np.nan] * len(some)
        some_times = static if chunk.is_static else [ns / 1e9 for ns in batch["t"].cast("int64").to_pylist()]
        for t, value in zip(some_times, some, strict=True):
            if value is not None:
                times.append(t)
                values.append(value)
    order = np.argsort(times, kind="stable")
    return np.array(times)[order], [values[i] for i in order]


def at(path: Path, entity: str, component: str, t: float) -> Any:
    """The value in force at ``t``."""
    times, values = rows(path, entity, component)
    return values[int(np.searchsorted(times, t + 1e-6)) - 1]


def until(true: Callable[[], bool], seconds: float) -> bool:
    deadline = time.monotonic() + seconds
    while not true():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("run") / "swarm.rrd"
    dashboard = make(path)
    for snap in flight(DURATION):
        dashboard.log(snap)
    dashboard.close()
    assert dashboard.address is None
    assert dashboard.take_problems() == ()
    return path


def test_simulated_time_is_a_timeline_in_seconds(recording: Path) -> None:
    times, _ = rows(recording, "/plots/motion/z/uavs", "Scalars:scalars")
    np.testing.assert_allclose(times, np.arange(round(10 * DURATION) + 1) / 10.0, atol=1e-6)


def test_altitudes_of_all_uavs_and_the_leaders_hull(recording: Path) -> None:
    t = 17.3
    altitudes = at(recording, "/plots/motion/z/uavs", "Scalars:scalars", t)
    expected = snapshot(t).uavs
    true = [expected[uav].truth["z"] for uav in sorted(expected)]
    np.testing.assert_allclose(altitudes, [*true, *(expected[uav].signals["zhat"] for uav in FOLLOWERS)])
    middle = at(recording, "/plots/motion/z/hull", "Measurements:values", t)[0]
    half = at(recording, "/plots/motion/z/hull", "Measurements:variances", t)[0] ** 0.5
    np.testing.assert_allclose([middle - half, middle + half], sorted(leaders_at(t)))


def test_series_are_named_and_coloured_by_uav(recording: Path) -> None:
    _, names = rows(recording, "/plots/motion/z/uavs", "SeriesLines:names")
    assert names[0][: len(GRAPH.uavs)] == [f"UAV {uav}" for uav in (*FOLLOWERS, *LEADERS)]
    _, tints = rows(recording, "/plots/motion/z/uavs", "SeriesLines:colors")
    _, shape = rows(recording, "/world/uav/3/airframe", "Mesh3D:albedo_factor")
    assert shape[0][0] == tints[0][2]


def test_an_obstacle_is_drawn_beneath_the_altitudes_of_those_who_are_above_it() -> None:
    subject = dataclasses.replace(SUBJECT, obstacles=(Obstacle(250.0, 350.0, 870.0),))
    plots = Plots(subject, Detail(subject))
    before, above = ({entry.path: entry.what for entry in plots.draw(snapshot(t))} for t in (5.0, 10.0))
    assert np.isnan(before["/plots/motion/z/uavs"].scalars.as_arrow_array().to_pylist()[-1])
    assert above["/plots/motion/z/uavs"].scalars.as_arrow_array().to_pylist()[-1] == 870.0


def test_a_bank_that_passes_half_a_turn_is_drawn_on_its_reference_beside_it() -> None:
    subject = replace(SUBJECT, family="attitude", signals=(Quantity("mu_d", "rad", "reference, bank"), *SIGNALS))
    plots = Plots(subject, Detail(subject))
    drawn = []
    for told, wanted in ((179.0, 181.0), (-179.0, 182.0), (-177.0, -178.0), (178.0, 177.0)):
        flown = snapshot(1.0)
        uavs = {
            uav: replace(
                state,
                truth=state.truth | {"mu": math.radians(told)},
                signals=state.signals | {"mu_d": math.radians(wanted)},
            )
            for uav, state in flown.uavs.items()
        }
        (bank,) = [e.what for e in plots.draw(replace(flown, uavs=uavs)) if e.path == "/plots/motion/mu"]
        values = bank.scalars.as_arrow_array().to_pylist()
        drawn.append((values[0], values[len(subject.graph.uavs)]))
    assert drawn == [pytest.approx(two) for two in ((179.0, 181.0), (181.0, 182.0), (183.0, 182.0), (178.0, 177.0))]


def test_tracking_errors_with_their_bounds(recording: Path) -> None:
    uavs = snapshot(21.0).uavs
    values = at(recording, "/plots/errors/S1", "Scalars:scalars", 21.0)
    np.testing.assert_allclose(values, [*(uavs[i].signals["S1"] for i in FOLLOWERS), 1.0, -1.0])
    assert len(at(recording, "/plots/errors/S5", "Scalars:scalars", 21.0)) == len(FOLLOWERS)
    assert rows(recording, "/plots/errors/zhat", "Scalars:scalars")[1] == []


def test_an_estimate_stands_beside_the_true_value(recording: Path) -> None:
    values = at(recording, "/plots/estimates/d1_hat", "Scalars:scalars", 25.0)
    np.testing.assert_allclose(values, [0.19] * len(FOLLOWERS) + [0.2] * len(FOLLOWERS))


def test_the_true_effectiveness_falls_with_the_fault(recording: Path) -> None:
    for t, left in ((FAULT_AT - 0.1, 1.0), (FAULT_AT, 0.7)):
        assert at(recording, "/plots/effectiveness/elevator", "Scalars:scalars", t)[0] == left


def test_a_reference_is_the_aircraft_where_its_law_wants_it(recording: Path) -> None:
    uavs = snapshot(21.0).uavs
    _, north, up = at(recording, "/world/reference/1", "Transform3D:translation", 21.0)[0]
    assert up == pytest.approx(uavs[1].signals["zhat"], abs=1e-3)
    assert north == pytest.approx(uavs[1].truth["x"], abs=1e-3)
    assert rows(recording, "/world/reference/7", "Transform3D:translation")[1] == []


def test_elevator_and_thrust_acting_and_commanded_between_their_limits(recording: Path) -> None:
    uavs = snapshot(25.0).uavs
    for actuator in ("elevator", "thrust"):
        values = at(recording, f"/plots/actuators/{actuator}", "Scalars:scalars", 25.0)
        acting = [uavs[i].acting[actuator] for i in FOLLOWERS]
        commanded = [uavs[i].command[actuator] for i in FOLLOWERS]
        np.testing.assert_allclose(values, [*acting, *commanded, *LIMITS[actuator]])


def test_aircraft_stand_at_their_true_places_in_lanes_and_in_their_attitude(recording: Path) -> None:
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


def test_a_fault_is_written_at_its_aircraft_and_in_the_table(recording: Path) -> None:
    label = at(recording, "/world/uav/1/label", "Points3D:labels", FAULT_AT - 0.1)
    assert label == ["UAV 1"]
    label = at(recording, "/world/uav/1/label", "Points3D:labels", FAULT_AT)
    assert label == ["UAV 1: elevator 70 % +0.35"]
    table = at(recording, "/swarm", "TextDocument:text", DURATION)[0]
    assert re.search(r"\| 2 \|.*\| mission \|", table)
    assert "elevator 70 %" in next(line for line in table.splitlines() if line.startswith("| 1 |"))


def test_events_stand_at_their_times(recording: Path) -> None:
    times, texts = rows(recording, "/events", "TextLog:text")
    np.testing.assert_allclose(times, [event.t for event in HAPPENINGS])
    assert texts[2] == [f"{FAULT_AT:.1f} s  UAV 1: elevator fault: effectiveness 70 %, bias +0.35 rad"]
    _, levels = rows(recording, "/events", "TextLog:level")
    assert levels == [["INFO"], ["WARN"], ["ERROR"], ["INFO"]]


def test_the_recording_carries_its_blueprint(recording: Path) -> None:
    reader = rr.chunk.RrdReader(recording)
    (blueprint,) = reader.blueprints()
    said = [chunk.to_record_batch() for chunk in reader.stream(store=blueprint).to_chunks()]
    texts = {str(value) for batch in said for name in batch.schema.names if ":" in name for value in batch[name]}
    for title in (
        "Altitude, m (band: hull, thin: reference)",
        "Altitude tracking error S1, m",
        "Events",
    ):
        assert any(title in text for text in texts)


def test_a_uav_that_falls_silent_is_said_to_be(tmp_path: Path) -> None:
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


@pytest.mark.parametrize("told_from", [0.0, 2.0])
def test_the_pace_is_said_and_drawn_from_when_it_is_told(tmp_path: Path, told_from: float) -> None:
    pace = Pace(5.2, 10.0, "both cores busy", "try --pack auto")
    dashboard = make(tmp_path / "swarm.rrd")
    for snap in flight(4.0):
        dashboard.log(dataclasses.replace(snap, pace=pace if snap.t >= told_from else None))
    dashboard.close()
    times, values = rows(tmp_path / "swarm.rrd", "/plots/pace", "Scalars:scalars")
    assert times[0] == told_from
    assert values[-1] == [5.2, 10.0]
    said = at(tmp_path / "swarm.rrd", "/swarm", "TextDocument:text", 3.0)[0]
    assert said.startswith("5.2 x real time (asked: 10): both cores busy, try --pack auto\n")


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


def test_a_killed_recording_is_readable_to_its_last_seconds(tmp_path: Path) -> None:
    path = tmp_path / "swarm.rrd"
    process = station(str(path), "none", "60")
    assert process.stdout is not None
    killed_at = 0.0
    for line in process.stdout:
        if line.strip() not in ("True", "False") and (killed_at := float(line)) > 12.0:
            break
    process.kill()
    process.wait()
    times, _ = rows(path, "/plots/motion/z/uavs", "Scalars:scalars")
    # 0.05 s of wall time pass in 0.1 s of simulated time; pieces of 2 s are written.
    assert times[-1] >= killed_at - 6.0
    path.write_bytes(rrd.whole(path.read_bytes()))
    assert len(rr.chunk.RrdReader(path).blueprints()) == 1


def test_without_viewer_and_recording_nothing_is_loaded() -> None:
    process = station("-", "none", "1")
    assert process.communicate(timeout=60)[0].split()[0] == "False"
    assert process.returncode == 0


def test_the_cost_of_a_snapshot(tmp_path: Path) -> None:
    dashboard = make(tmp_path / "swarm.rrd")
    costs = []
    for snap in flight(10.0):
        begun = time.perf_counter()
        dashboard.log(snap)
        costs.append(time.perf_counter() - begun)
    dashboard.close()
    # Median 1 to 4 ms on an idle machine; five times that.
    assert float(np.median(costs)) < 0.02


@pytest.fixture
def watched(tmp_path: Path) -> Iterator[tuple[Dashboard, int, Path]]:
    """A dashboard with a web viewer that is up, the viewer's process and the recording."""
    path = tmp_path / "swarm.rrd"
    dashboard = make(path, "web")
    viewer = dashboard._viewer
    assert viewer is not None
    assert viewer._process is not None
    dashboard.log(snapshot(0.0))
    assert until(lambda: viewer._frames.empty(), 30.0), "the viewer did not start"
    yield dashboard, viewer._process.pid, path
    dashboard.close()


@pytest.mark.parametrize("harm", [signal.SIGKILL, signal.SIGSTOP])
def test_a_viewer_that_dies_or_hangs_costs_the_swarm_nothing(watched: tuple[Dashboard, int, Path], harm: int) -> None:
    dashboard, viewer, path = watched
    problems = []
    longest = 0.0
    for snap in list(flight(20.0))[1:]:
        if snap.t == 5.0:
            os.kill(viewer, harm)
        begun = time.perf_counter()
        dashboard.log(snap)
        longest = max(longest, time.perf_counter() - begun)
        problems += dashboard.take_problems()
        time.sleep(0.005)
    begun = time.perf_counter()
    dashboard.close()
    assert time.perf_counter() - begun < 5.0
    assert longest < 0.5
    assert not Path(f"/proc/{viewer}").exists()
    times, _ = rows(path, "/plots/motion/z/uavs", "Scalars:scalars")
    assert len(times) == 201
    if harm == signal.SIGKILL:
        assert [problem.text for problem in problems] == [
            "the viewer ended (exit code -9); the flight and its recording go on"
        ]
        assert any("the viewer ended" in text[0] for text in rows(path, "/events", "TextLog:text")[1])


def test_a_viewer_that_never_reads_holds_nobody_back() -> None:
    held = threading.Event()

    class Held:
        def log(self, *_: Any, **__: Any) -> None:
            held.wait()

        def flush(self, **_: Any) -> None:
            held.wait()

        def disconnect(self) -> None:
            held.wait()

    viewer = Viewer("web", None, False, lambda _: Held())  # type: ignore[arg-type, return-value]
    begun = time.perf_counter()
    for _ in range(1000):
        viewer.show([Entry("/nothing", None, None)])
    assert time.perf_counter() - begun < 0.5
    assert viewer.take_problem() == "the viewer does not keep up: not everything is shown"
    assert viewer.take_problem() is None
    viewer.close()
    held.set()


def test_a_viewer_whose_port_is_taken_is_reported_and_the_flight_recorded(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken, socket.create_server(("127.0.0.1", 0)) as other:
        ports = taken.getsockname()[1], other.getsockname()[1]
        other.close()
        dashboard = make(tmp_path / "swarm.rrd", "web", ports=ports)
        dashboard.log(snapshot(0.0))
        dashboard.log(snapshot(0.1))
        assert [event.text for event in dashboard.take_problems()] == [f"no viewer: port {ports[0]} is in use"]
        assert dashboard.address is None
        dashboard.close()
    assert len(rows(tmp_path / "swarm.rrd", "/plots/motion/z/uavs", "Scalars:scalars")[0]) == 2


@pytest.mark.skipif(sys.platform != "linux", reason="the viewer follows its station into death on Linux only")
def test_the_viewer_ends_with_a_killed_station() -> None:
    process = station("-", "web", "60")
    assert process.stdout is not None
    viewer = Path(f"/proc/{int(process.stdout.readline())}")
    assert float(process.stdout.readline()) == 1.0
    assert until(lambda: b"serve-web" in (viewer / "cmdline").read_bytes(), 10.0)
    process.kill()
    process.wait()
    assert until(lambda: not viewer.exists(), 5.0)


def test_nothing_is_left_in_the_users_home(tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    folders = {name: str(home / name) for name in ("XDG_CONFIG_HOME", "XDG_DATA_HOME")}
    # What is compiled is ours and may stay where it is.
    compiled = os.environ.get("FTCC_CACHE_DIR", str(Path.home() / ".cache" / "ftcc"))
    process = station(str(tmp_path / "swarm.rrd"), "web", "5", HOME=str(home), FTCC_CACHE_DIR=compiled, **folders)
    process.communicate(timeout=60)
    assert process.returncode == 0
    assert list(home.rglob("*")) == []


def test_everything_listens_on_loopback_only(watched: tuple[Dashboard, int, Path]) -> None:
    psutil = pytest.importorskip("psutil")
    _, viewer, _ = watched
    mine = [c for c in psutil.Process().net_connections("tcp") if c.status == "LISTEN"]
    its = [c for c in psutil.Process(viewer).net_connections("tcp") if c.status == "LISTEN"]
    assert len(its) == 2
    assert {connection.laddr.ip for connection in [*mine, *its]} == {"127.0.0.1"}
