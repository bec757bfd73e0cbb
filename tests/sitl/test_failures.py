"""What happens when processes die, when the user stops, and when two swarms fly at once."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

from tests.sitl.conftest import Flight, events, same_flight
from tests.support.ports import free_port

Ftcc = Callable[..., subprocess.CompletedProcess[str]]


def last_time(folder: Path, uav: int) -> float:
    """Last recorded simulated time of a UAV, s."""
    table = pq.read_table(folder / "signals.parquet")
    return float(pc.max(table.filter(pc.equal(table["uav"], uav))["t"]).as_py())


# In real time at 50 Hz: a test machine that is busy for a moment must not be the one that loses an aircraft.
SLOW = ["--set", "rates={control_rate=50.0, exchange_rate=10.0, latency=0.1}", "--set", "record_rate=50"]


# In lockstep not as fast as possible: on a busy machine the flight would be over before the test can kill anybody.
@pytest.mark.parametrize("clock", [["--speed", "2"], ["--speed", "1", *SLOW]], ids=["lockstep", "real time"])
@pytest.mark.parametrize("kind", ["autopilot", "vehicle"])
def test_a_killed_process_is_named_and_the_others_fly_on(
    fly: Callable[..., Flight], clock: list[str], kind: str
) -> None:
    flight = fly("containment", *clock, "--duration", "12")
    flight.wait_until_flying()
    flight.child(f"uav3-{kind}").kill()
    assert flight.wait() == 1, flight.output
    assert f"process uav3-{kind} died (killed by signal 9)" in flight.output
    assert any("died" in str(event.get("text")) for event in events(flight.folder))
    for uav in (1, 2, 4, 5, 6, 7, 8):
        assert last_time(flight.folder, uav) == 12.0
    assert 0.0 < last_time(flight.folder, 3) < 12.0
    wait_until_gone(flight.folder, 10.0)


def wait_until_gone(folder: Path, seconds: float) -> float:
    """Wait until no process of a run is left; how long that took, s."""
    begun = time.monotonic()
    while leftovers(folder):
        assert time.monotonic() - begun < seconds, f"still running: {leftovers(folder)}"
        time.sleep(0.02)
    return time.monotonic() - begun


def leftovers(folder: Path) -> list[int]:
    """Processes that still write a log of this run."""
    found = []
    for process in psutil.process_iter():
        try:
            if os.readlink(f"/proc/{process.pid}/fd/1").startswith(str(folder)):
                found.append(process.pid)
        except OSError:
            continue
    return found


def test_ctrl_c_ends_everything_within_two_seconds(fly: Callable[..., Flight], ftcc: Ftcc) -> None:
    flight = fly("containment", "--duration", "300", *SLOW)
    flight.wait_until_flying()
    children = flight.processes()
    assert len(children) >= 17
    flight.interrupt()
    # The promise is 2 s; the test leaves a loaded machine five times that.
    wait_until_gone(flight.folder, 10.0)
    assert flight.wait(10) == 0, flight.output
    # Python's fork server and its tracker end when they see the launcher's end.
    _, alive = psutil.wait_procs(children, timeout=10.0)
    assert not [child for child in alive if child.is_running() and child.status() != psutil.STATUS_ZOMBIE]
    assert last_time(flight.folder, 1) > 0.0
    assert ftcc("ps").stdout.strip() == "no swarm is running"
    assert ftcc("report", str(flight.folder), "--no-page").returncode in (0, 1)


def test_a_killed_launcher_takes_everything_with_it(fly: Callable[..., Flight], ftcc: Ftcc) -> None:
    flight = fly("containment", "--duration", "300", *SLOW)
    flight.wait_until_flying()
    children = flight.processes()
    flight.process.send_signal(signal.SIGKILL)
    flight.process.wait()
    _, alive = psutil.wait_procs(children, timeout=10)
    assert not alive
    assert ftcc("ps").stdout.strip() == "no swarm is running"
    # What was recorded can still be read.
    assert ftcc("report", str(flight.folder), "--no-page").returncode in (0, 1)
    assert last_time(flight.folder, 1) > 0.0


def test_two_swarms_side_by_side_and_stop(fly: Callable[..., Flight], ftcc: Ftcc) -> None:
    first = fly("containment", "--duration", "300", "--pack", "auto", *SLOW, name="first")
    first.wait_until_flying()
    second = fly("containment", "--duration", "300", "--pack", "auto", *SLOW, name="second")
    second.wait_until_flying()
    listed = ftcc("ps").stdout
    assert "first" in listed
    assert "second" in listed
    ambiguous = ftcc("stop")
    assert ambiguous.returncode == 2
    assert "several swarms are running" in ambiguous.stderr + ambiguous.stdout
    assert ftcc("stop", "first").returncode == 0
    assert first.wait(20) == 0
    assert second.process.poll() is None
    assert ftcc("stop").returncode == 0
    assert second.wait(20) == 0
    assert ftcc("stop").returncode == 2


def test_a_held_swarm_waits_for_resume(fly: Callable[..., Flight], ftcc: Ftcc) -> None:
    flight = fly("containment", "--duration", "5", "--speed", "max", "--hold", "--pack", "auto")
    flight.wait_until(lambda: "held at t = 0" in flight.output)
    time.sleep(0.5)
    assert flight.process.poll() is None
    assert ftcc("resume").returncode == 0
    assert flight.wait(60) == 0, flight.output
    assert last_time(flight.folder, 8) == 5.0


def test_a_given_port_in_use_is_refused_before_anything_starts(ftcc: Ftcc, tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        port = free_port()
        taken.bind(("127.0.0.1", port))
        answer = ftcc("fly", "containment", "--viewer", "none", "--port", str(port), "--out", str(tmp_path / "run"))
    assert answer.returncode == 2
    assert f"port {port} is in use" in answer.stderr + answer.stdout
    assert not (tmp_path / "run").exists()


def test_an_aircraft_that_leaves_its_model_is_lost_and_the_others_fly_on(
    fly: Callable[..., Flight], ftcc: Ftcc
) -> None:
    hard_over = "faults=[{at=5.0, uav=2, actuator='elevator', effectiveness=0.05, bias=0.6, without_trim=true}]"
    flight = fly("containment", "--speed", "max", "--duration", "20", "--set", hard_over)
    assert flight.wait() == 1
    assert "UAV 2 lost" in flight.output
    assert 5.0 < last_time(flight.folder, 2) < 10.0
    assert last_time(flight.folder, 1) == 20.0
    # In one process the same happens, at the same tick.
    alone = flight.folder.with_name("alone")
    assert ftcc("simulate", "containment", "--duration", "20", "--set", hard_over, "--out", str(alone)).returncode == 1
    assert same_flight(alone, flight.folder)
