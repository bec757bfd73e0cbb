"""A swarm that a script flies: deterministic in lockstep, and nothing is left of it, however it ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

from ftcc.groundside import RefusedError, ScenarioError, StationError, Swarm, SwarmError, simulate
from tests.sitl.conftest import same_flight

PERIOD = 0.01


@pytest.fixture(autouse=True)
def _apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The swarms of this test alone, and nothing of them left at its end."""
    monkeypatch.setenv("FTCC_RUNTIME_DIR", str(tmp_path / "runtime"))
    yield
    assert children() == []
    assert list((tmp_path / "runtime").rglob("*.json")) == []


def children() -> list[psutil.Process]:
    """The processes of swarms that this one has started."""
    return [one for one in psutil.Process().children(recursive=True) if is_of_a_swarm(one)]


def is_of_a_swarm(process: psutil.Process) -> bool:
    try:
        return os.readlink(f"/proc/{process.pid}/fd/1").endswith(".log")
    except OSError:
        return False


def swarm(tmp_path: Path, name: str = "run", **options: Any) -> Swarm:
    return Swarm("containment", tmp_path / name, speed="max", variants="loss30", seed=3, **options)


def test_a_swarm_that_is_stepped_is_the_simulated_flight_bit_for_bit(tmp_path: Path) -> None:
    """Also what is read of it while it is held, before and after faults and link events that come at once."""
    fault = {"uav": 2, "actuator": "elevator", "effectiveness": 0.75, "bias": 0.125}
    events = {"link_events": [{"at": 1.5, "until": 2.5, "kind": "cut", "uav": 5}]}
    planned = {"faults": [fault | {"at": 1.0}], **events}
    alone = simulate("containment", tmp_path / "alone", variants="loss30", seed=3, duration=4.0, settings=planned)
    with swarm(tmp_path, duration=4.0, settings={"faults": []}) as flown:
        assert flown.time == 0.0
        assert len(flown.column("z", 2)) == 0
        assert flown.step(100) == flown.time == pytest.approx(1.0)
        for name, uav in (("t", 2), ("z", 2), ("S1", 2), ("z", 7)):
            assert np.array_equal(flown.column(name, uav), alone.column(name, uav)[:100])
        assert flown.fault(2, "elevator", effectiveness=0.75, bias=0.125) == 1.0
        flown.cut(uav=5, at=1.5)
        flown.restore(uav=5, at=2.5)
        assert flown.wait(2.0) == pytest.approx(2.0)
        assert np.array_equal(flown.column("S1", 2), alone.column("S1", 2)[:200])
        assert [state.mode for state in flown.vehicles()] == ["mission"] * 8  # type: ignore[union-attr]
        flown.resume()
        flown.wait(60.0)
        assert flown.over
        assert flown.time == alone.end
        assert np.array_equal(flown.column("z", 7), alone.column("z", 7))
    assert same_flight(alone.path, flown.run.path)
    assert flown.run.claims() == alone.claims()


def test_two_fly_side_by_side_and_each_takes_its_commands(tmp_path: Path) -> None:
    with swarm(tmp_path, "one", pack="auto") as one, swarm(tmp_path, "other", pack="auto") as other:
        assert one.set(1, "K11", 3.5) == 3.5
        assert (one.get(1, "K11"), other.get(1, "K11")) == (3.5, 3.0)
        one.step(30)
        assert (one.time, other.time) == (pytest.approx(0.3), 0.0)
        one.speed(5.0)
        one.resume()
        one.wait(0.6)
        assert 0.6 <= one.pause() == one.time
        one.degrade(edge=(1, 2), loss=0.5)
        run = other.end()
        assert run.path.name == "other"
        assert other.over
        with pytest.raises(SwarmError, match="the flight is over"):
            other.fault(1, "elevator", bias=0.1)
    assert one.run.end > 0.59


def test_what_is_refused_is_an_exception_with_its_reason(tmp_path: Path) -> None:
    with swarm(tmp_path, pack="auto") as flown:
        with pytest.raises(StationError, match="has no UAV 9"):
            flown.fault(9, "elevator", bias=0.1)
        with pytest.raises(StationError, match="its size is missing"):
            flown.fault(1, "elevator")
        with pytest.raises(StationError, match="must be a finite number"):
            flown.fault(1, "elevator", bias=float("nan"))
        with pytest.raises(RefusedError, match="the present value is 3"):
            flown.set(1, "K11", -5.0)
        with pytest.raises(SwarmError, match="give either uav=ID or edge"):
            flown.cut()
        with pytest.raises(SwarmError, match="must be at least 1 tick"):
            flown.step(0)
        with pytest.raises(SwarmError, match="no column 'altitude'"):
            flown.column("altitude", 1)
        flown.resume()
        with pytest.raises(RefusedError, match="pause it before you step it"):
            flown.step(1)


def test_a_process_that_dies_is_named_and_the_others_end(tmp_path: Path) -> None:
    with swarm(tmp_path) as flown:
        flown.step(10)
        log = str((tmp_path / "run" / "logs" / "uav3-autopilot.log").resolve())
        (victim,) = [one for one in children() if os.readlink(f"/proc/{one.pid}/fd/1") == log]
        victim.kill()
        with pytest.raises(SwarmError, match=r"process uav3-autopilot died; see .*logs"):
            flown.step(500)
        # It has been said; the others fly the rest of the step, and on.
        assert flown.wait(6.0) == pytest.approx(6.0)
    assert flown.over
    assert len(flown.run.column("z", 4)) == 600
    assert len(flown.run.column("z", 3)) < 600


def test_a_death_that_nothing_has_reported_is_reported_at_the_end(tmp_path: Path) -> None:
    flown = swarm(tmp_path, pack="auto").start()
    for process in children():
        process.kill()
    while not flown.over:
        time.sleep(0.01)
    with pytest.raises(SwarmError, match=r"process uav1-8-\w+ died"):
        flown.end()
    assert flown.over


def test_another_scheme_flies_in_the_same_script(tmp_path: Path) -> None:
    """The fork server has loaded the scheme of the first swarm."""
    with swarm(tmp_path, pack="auto") as flown:
        flown.step(1)
    with Swarm("fire_monitoring", tmp_path / "fire", speed="max", pack="auto", duration=1.0, hold=False) as other:
        other.wait(2.0)
    assert same_flight(simulate("fire_monitoring", tmp_path / "alone", duration=1.0).path, other.run.path)


def test_an_exception_ends_all_processes_and_is_not_hidden(tmp_path: Path) -> None:
    flown = swarm(tmp_path)

    def fail() -> None:
        with flown:
            flown.step(5)
            assert len(children()) == 16
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert flown.run.end == pytest.approx(4 * PERIOD)


INTERRUPTED = """
import sys
from ftcc.groundside import Swarm
with Swarm("demo", sys.argv[1], speed="max", pack="auto") as swarm:
    print("started", flush=True)
    if sys.argv[2] == "flying":
        swarm.speed(1.0)
        swarm.resume()
    swarm.wait(1e6) if sys.argv[2] == "flying" else __import__("time").sleep(600)
"""


@pytest.mark.parametrize("state", ["flying", "held"])
def test_ctrl_c_ends_a_script_and_its_swarm(tmp_path: Path, state: str) -> None:
    """The script needs no guard of its main module."""
    script = tmp_path / "script.py"
    script.write_text(INTERRUPTED)
    program = [sys.executable, str(script), str(tmp_path / "run"), state]
    with subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "started\n"
            started = psutil.Process(process.pid).children(recursive=True)
            process.send_signal(signal.SIGINT)
            _, err = process.communicate(timeout=60.0)
        finally:
            process.kill()
    assert "KeyboardInterrupt" in err.splitlines()[-1]
    assert len(started) >= 4
    psutil.wait_procs(started, timeout=10.0)
    assert [one for one in started if one.is_running()] == []


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"form": "monograph"}, "use `ftcc simulate`"),
        ({"speed": -1}, "speed -1: must be a positive factor"),
        ({"clock": "wall", "speed": "max"}, "the wall clock needs a factor"),
        ({"clock": "sundial"}, "--clock sundial: must be one of lockstep, wall"),
        ({"viewer": "telescope"}, "--viewer telescope: must be one of"),
        ({"pack": 9}, "--pack 9: must be 'auto' or a number"),
        ({"mavlink": ["nowhere"]}, "--mavlink nowhere"),
        ({"id_offset": 300}, "--id-offset 300: must be from 0"),
    ],
)
def test_bad_choices_start_nothing(tmp_path: Path, options: Any, text: str) -> None:
    with pytest.raises(SwarmError) as refused, Swarm("containment", tmp_path / "run", **options):
        pytest.fail("it started")
    assert text in str(refused.value)
    assert not (tmp_path / "run").exists()
    with pytest.raises(ScenarioError):
        Swarm("containment", settings={"gains": {"k99": 1.0}})
