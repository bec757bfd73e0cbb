"""The viewer and the recording: neither may delay the swarm, and the recording survives a killed station."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr

from ftcc.groundside.dashboard import Dashboard
from ftcc.groundside.dashboard.viewer import Entry, Viewer
from tests.groundside.dashboard.recorded import make, rows
from tests.groundside.dashboard.synthetic_swarm import flight, snapshot
from tests.support import rrd

STATION = """
import sys, time
from pathlib import Path
from ftcc.groundside.dashboard import Dashboard
from tests.groundside.dashboard.synthetic_swarm import *
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


def station(*arguments: str, **environment: str) -> subprocess.Popen[str]:
    program = [sys.executable, "-c", STATION, *arguments]
    root = Path(__file__).parents[3]
    return subprocess.Popen(program, stdout=subprocess.PIPE, text=True, cwd=root, env=os.environ | environment)


def until(true: Callable[[], bool], seconds: float) -> bool:
    deadline = time.monotonic() + seconds
    while not true():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True


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
def test_a_viewer_that_dies_or_hangs_does_not_delay_the_swarm(watched: tuple[Dashboard, int, Path], harm: int) -> None:
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
        texts = [problem.text for problem in problems]
        assert texts[-1] == "the viewer ended (exit code -9); the flight and its recording go on"
        # On a busy machine it may have fallen behind before.
        assert set(texts[:-1]) <= {"the viewer does not keep up: not everything is shown"}
        assert any("the viewer ended" in text[0] for text in rows(path, "/events", "TextLog:text")[1])


def test_a_viewer_that_never_reads_does_not_block_the_caller() -> None:
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
