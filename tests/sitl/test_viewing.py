"""A flight's recording in the viewer, without a screen: blueprint, timeline, entities, values; a killed run, too."""

from __future__ import annotations

import io
import statistics
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from ftcc.groundside import Run, Station
from ftcc.groundside.cli.view import show_past
from ftcc.groundside.dashboard import Dashboard
from ftcc.groundside.dashboard.feed import watch_swarm
from ftcc.groundside.dashboard.snapshot import Event, Snapshot
from ftcc.groundside.dashboard.viewer import viewer_program
from tests.sitl.conftest import Flight
from tests.support import rrd
from tests.support.ports import free_port

DRIVERS = list(Path("/usr/share/vulkan/icd.d").glob("*.json")) if Path("/usr/share/vulkan/icd.d").is_dir() else []
UAVS = range(1, 9)


@pytest.fixture
def viewer(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Rerun's own viewer, drawn in software."""
    from rerun.experimental import ViewerClient

    monkeypatch.setenv("CI", "true")  # no usage statistics
    client = ViewerClient.spawn(
        headless=True,
        port=free_port(),
        memory_limit="1GB",
        server_memory_limit="128MB",
        executable_path=str(viewer_program()),  # an environment need not be active
    )
    yield client
    client.quit()


def altitudes(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) and altitudes (n, 8) in a recording of the dashboard."""
    times: list[float] = []
    values: list[list[float]] = []
    for chunk in rrd.chunks(path):
        if str(chunk.entity_path) == "/plots/motion/z/uavs" and not chunk.is_static:
            batch = chunk.to_record_batch()
            times += [ns / 1e9 for ns in batch["t"].cast("int64").to_pylist()]
            values += [row[: len(UAVS)] for row in batch["Scalars:scalars"].to_pylist()]
    order = np.argsort(times)
    return np.array(times)[order], np.array(values)[order]


def assert_the_recording_shows_what_was_flown(flight: Flight) -> float:
    """Altitudes in the view are those of the run's signals; the last time that the view shows, s."""
    run = Run(flight.folder)
    times, shown = altitudes(flight.folder / "swarm.rrd")
    # The station draws the newest that it has heard of each UAV, at most two seconds old at ten times real time.
    for i, uav in enumerate(UAVS):
        t, z = run.column("t", uav), run.column("z", uav)
        t, z = t[np.isfinite(z)], z[np.isfinite(z)]
        within = times <= t[-1]
        assert within.sum() > 3
        for now, seen in zip(times[within], shown[within, i], strict=True):
            flown = z[(t > now - 2.0) & (t < now + 0.011)]
            assert flown.min() - 1e-3 <= seen <= flown.max() + 1e-3
    return float(times[-1])


def picture(viewer: Any) -> np.ndarray:
    image = pytest.importorskip("PIL.Image")
    return np.asarray(image.open(io.BytesIO(viewer.take_screenshot())).convert("RGB")).astype(int)


@pytest.mark.browser
@pytest.mark.skipif(not DRIVERS, reason="needs the system package mesa-vulkan-drivers")
def test_a_flight_in_lockstep_opens_with_its_blueprint(fly: Callable[..., Flight], viewer: Any) -> None:
    flight = fly("demo", "--speed", "8", "--duration", "20", "--pack", "auto")
    assert flight.wait() == 0, flight.output
    assert assert_the_recording_shows_what_was_flown(flight) == pytest.approx(20.0)

    viewer.open(str(flight.folder / "swarm.rrd"))
    state = viewer.get_state()
    (recording,) = state.recordings
    timeline = next(timeline for timeline in recording.timelines if timeline.name == "t")
    assert timeline.time_type == "duration"
    assert timeline.end == pytest.approx(20e9)
    assert recording.current_timeline == "t"
    views = {view.name: view.view_class for view in state.views}
    assert views["Swarm"] == "TextDocument"
    assert views["Events"] == "TextLog"
    assert next(kind for name, kind in views.items() if name.startswith("Swarm (")) == "3D"
    assert next(kind for name, kind in views.items() if name.startswith("Links")) == "2D"
    for plot in ("Altitude, m", "Altitude tracking error S1, m", "Thrust, N", "Elevator, rad", "Estimated disturbance"):
        assert next(kind for name, kind in views.items() if name.startswith(plot)) == "TimeSeries"
    assert not [report for view in state.views for report in view.reports]

    entities = {str(entity.entity_path) for entity in viewer.get_recording_schema().entities}
    for uav in UAVS:
        assert f"/world/uav/{uav}/airframe" in entities
    assert {"/world/links", "/graph/links", "/world/hull", "/swarm"} <= entities

    pictures = []
    for t in (5.0, 15.0):
        viewer.set_time("t", duration=t, play_state="paused")
        pictures.append(picture(viewer))
    colored = pictures[0].max(axis=2) - pictures[0].min(axis=2) > 40
    assert colored.mean() > 0.002, "the picture is blank"
    assert (np.abs(pictures[0] - pictures[1]).max(axis=2) > 40).mean() > 0.002, "the picture stands still"


def test_a_command_from_the_ground_is_seen_at_once(
    fly: Callable[..., Flight], environment: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A viewer has it 0.15 s later at most, the longest wait between two deliveries."""
    monkeypatch.setenv("FTCC_RUNTIME_DIR", environment["FTCC_RUNTIME_DIR"])
    flight = fly("demo", "--speed", "1", "--pack", "auto", "--viewer", "none")
    flight.wait_until_flying()
    arrived: list[tuple[float, str]] = []

    def watch() -> None:
        for snapshot in watch_swarm(flight.folder.name):
            arrived.extend((time.monotonic(), event.text) for event in snapshot.events)

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    delays = []
    with Station(flight.folder.name) as station:
        for n in range(9):
            begun = time.monotonic()
            station.fault(2, "thrust", eff=0.9 + 0.005 * n)
            flight.wait_until(lambda n=n: any(f"{0.9 + 0.005 * n:g}" in text for _, text in arrived), 20.0)  # type: ignore[misc]
            delays.append(next(t for t, text in arrived if f"{0.9 + 0.005 * n:g}" in text) - begun)
    flight.interrupt()
    assert statistics.median(delays) < 0.35


def test_who_watches_late_sees_the_past_and_the_run_stays_whole(fly: Callable[..., Flight]) -> None:
    flight = fly("demo", "--speed", "4", "--pack", "auto", "--viewer", "none")
    flight.wait_until_flying()
    flight.wait_until(lambda: "leader commanded" in flight.output)  # at 10 s
    drawn: list[Snapshot] = []

    class Board:
        def log(self, snapshot: Snapshot, timeout: float) -> None:
            drawn.append(snapshot)

        def take_problems(self) -> tuple[Event, ...]:
            return ()

    told = show_past(Run(flight.folder), cast(Dashboard, Board()))
    assert drawn[0].t == 0.0
    assert drawn[-1].t > 6.0
    assert [event.text for event in told] == [event.text for snapshot in drawn for event in snapshot.events]
    flight.wait_until(lambda: "disturbance" in flight.output)  # at 25 s
    flight.interrupt()
    assert flight.wait() == 0, flight.output
    assert Run(flight.folder).end > 24.0 > drawn[-1].t


def test_the_view_of_a_killed_flight_is_readable(fly: Callable[..., Flight]) -> None:
    flight = fly("demo", "--speed", "1", "--pack", "auto", "--viewer", "none")
    flight.wait_until_flying()
    # The view is written in pieces of two seconds.
    flight.wait_until(lambda: len(altitudes(flight.folder / "swarm.rrd")[0]) > 10)
    flight.process.kill()
    flight.process.wait()
    assert assert_the_recording_shows_what_was_flown(flight) > 1.0
