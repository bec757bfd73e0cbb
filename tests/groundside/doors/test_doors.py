"""Flights by another autopilot from the command line, with players in the place of PX4 and ArduPilot."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import psutil
import pytest

from ftcc.groundside import Run
from ftcc.groundside.cli import main
from ftcc.groundside.doors import DoorError, find_px4, set_aside
from ftcc.groundside.scenario import load, resolve
from ftcc.sim.doors import px4
from tests.support.ports import free_port

ROOT = Path(__file__).parents[3]
Outcome = tuple[int, str, str]
SCENARIO = ("attitude_synchronization", "--variant", "healthy")


@pytest.fixture
def ftcc(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Callable[..., Outcome]:
    """Run a command in an empty folder: exit code, standard output, standard error."""

    def run(*arguments: object) -> Outcome:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["ftcc", *map(str, arguments)])
        code = 0
        try:
            main()
        except SystemExit as exit_:
            code = int(exit_.code or 0)
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run


@pytest.fixture
def build(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a PX4 build in which a player stands in for px4, and ports that nobody uses."""
    folder = tmp_path / "build" / "px4_sitl_default"
    scripts = folder / "etc" / "init.d-posix"
    (scripts / "airframes").mkdir(parents=True)
    (scripts / "rcS").touch()
    (scripts / "airframes" / "1036_jsbsim_malolo").touch()
    (folder / "bin").mkdir()
    first = min(free_port() for _ in range(4))
    monkeypatch.setattr(px4, "PORT", first)
    write_program(
        folder,
        f"""
        echo "arguments $@"; echo "model $PX4_SIM_MODEL$PX4_SIMULATOR, folder $(basename "$PWD")"
        cd {ROOT}; exec {sys.executable} -m tests.support.px4_player --port $(({first} + $2))
        """,
    )
    return folder


def write_program(folder: Path, script: str) -> None:
    program = folder / "bin" / "px4"
    program.write_text(f"#!/bin/sh\n{script}")
    program.chmod(0o755)


def test_a_swarm_by_px4_starts_one_for_each_aircraft_and_leaves_a_run(ftcc, build, tmp_path, monkeypatch):
    monkeypatch.setenv("PX4_SIMULATOR", "gz")
    code, out, err = ftcc("fly", *SCENARIO, "--px4", build, "--speed", "max", "--duration", 2, "--out", "run")
    assert (code, err) == (0, "")
    assert "flown: 2 s of the scenario" in out
    logs = [(tmp_path / "run" / "px4" / str(uav) / "px4.log").read_text().splitlines() for uav in (1, 2, 3, 4)]
    assert [log[0] for log in logs] == [f"arguments -i {n} -d {build}/etc" for n in range(4)]
    assert [log[1] for log in logs] == [f"model jsbsim_malolo, folder {uav}" for uav in (1, 2, 3, 4)]
    run = Run(tmp_path / "run")
    assert run.uavs == (1, 2, 3, 4)
    assert run.end == pytest.approx(2.0)
    assert len({run.column("t", uav).tobytes() for uav in run.uavs}) == 1
    assert np.abs(run.column("z", 3) - 1000.0).max() < 5.0
    assert np.isnan(run.column("wall", 3)).all()  # a signal of the law, which did not fly
    code, out, _ = ftcc("report", "run", "--no-page")
    assert code == 0
    assert "the scenario makes no claims" in out
    assert not children()


def test_one_px4_that_ends_is_told_with_its_exit_code_and_the_others_fly_on(ftcc, build, tmp_path):
    write_program(build, (build / "bin" / "px4").read_text().replace("echo", '[ "$2" = 2 ] && exit 7; echo', 1))
    code, out, _ = ftcc("fly", *SCENARIO, "--px4", build, "--speed", "max", "--duration", 1, "--out", "run")
    assert code == 1
    assert "UAV 3: lost: PX4: PX4 ended with exit code 7; see px4.log" in out
    assert "flown: 1 s of the scenario; lost: UAV 3" in out
    assert Run(tmp_path / "run").end == pytest.approx(1.0)
    assert Run(tmp_path / "run").lost.keys() == {3}
    assert not children()


def test_ctrl_c_ends_the_flight_and_every_px4(build, tmp_path):
    program = f"from ftcc.sim.doors import px4; px4.PORT = {px4.PORT}; from ftcc.groundside.cli import main; main()"
    arguments = ["fly", *SCENARIO, "--px4", str(build), "--out", str(tmp_path / "run")]
    flight = subprocess.Popen(
        [sys.executable, "-c", program, *arguments],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"COLUMNS": "200"},
    )
    try:
        assert flight.stdout is not None
        for line in flight.stdout:
            if "is armed" in line:
                break
        started = psutil.Process(flight.pid).children(recursive=True)
        assert len(started) == 4
        flight.send_signal(signal.SIGINT)
        rest, _ = flight.communicate(timeout=20)
    finally:
        flight.kill()
    assert flight.returncode == 0
    assert "stopped: 0 s of the scenario" in rest
    assert not [one for one in started if one.is_running() and one.status() != psutil.STATUS_ZOMBIE]


def children() -> list[psutil.Process]:
    return [one for one in psutil.Process().children() if "px4" in " ".join(one.cmdline())]


@pytest.mark.parametrize("option", ["--px4", "--ardupilot"])
def test_one_aircraft_for_an_autopilot_that_the_user_starts(ftcc, tmp_path, option):
    port = free_port()
    module = "px4_player" if option == "--px4" else "ardupilot_player"
    player = subprocess.Popen([sys.executable, "-m", f"tests.support.{module}", "--port", str(port)], cwd=ROOT)
    try:
        code, out, err = ftcc(
            "vehicle", *SCENARIO, "--uav", 2, option, port, "--speed", 0, "--duration", 1, "--out", "run"
        )
    finally:
        player.kill()
        player.wait()
    assert (code, err) == (0, "")
    assert f"UAV 2: waits for {'PX4' if option == '--px4' else 'ArduPilot'} at port {port}" in out
    assert Run(tmp_path / "run").uavs == (2,)


def test_a_flight_keeps_the_pace_that_is_asked_for(ftcc, tmp_path):
    """At 4 s per second, the 3 s of arming and launch and 1 s of flight take at least a second."""
    port = free_port()
    player = subprocess.Popen([sys.executable, "-m", "tests.support.px4_player", "--port", str(port)], cwd=ROOT)
    begun = time.monotonic()
    code, _, _ = ftcc("vehicle", *SCENARIO, "--px4", port, "--speed", 4, "--duration", 1, "--out", "run")
    assert code == 0
    assert player.wait(10.0) == 0
    assert time.monotonic() - begun > 1.0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("vehicle", *SCENARIO), "--px4 PORT or --ardupilot PORT"),
        (("vehicle", *SCENARIO, "--px4", 4560, "--ardupilot", 9002), "--px4 PORT or --ardupilot PORT"),
        (("vehicle", *SCENARIO, "--px4", 70000), "--px4 70000: must be a port from 1 to 65535"),
        (("vehicle", *SCENARIO, "--px4", 4560, "--uav", 9), "has the aircraft 1, 2, 3, 4"),
        (("vehicle", "demo", "--px4", 4560), "plant longitudinal has thrust, elevator"),
        (("vehicle", *SCENARIO, "--px4", 4560, "--field", "1,2"), "--field 1,2: must be north,east,down in gauss"),
        (("vehicle", *SCENARIO, "--px4", 4560, "--field", "0,0,0"), "--field 0,0,0: must be"),
        (("vehicle", *SCENARIO, "--px4", 4560, "--speed", "-1"), "--speed -1: must be a positive factor"),
        (("fly", *SCENARIO, "--px4", "nowhere"), "nowhere does not exist"),
        (("fly", *SCENARIO, "--px4-model", "plane"), "--px4-model: belongs to --px4"),
        (("fly", *SCENARIO, "--px4", "nowhere", "--id-offset", 3), "--id-offset: not with --px4"),
        (("fly", *SCENARIO, "--px4", "nowhere", "--hold"), "--hold: not with --px4"),
    ],
)
def test_bad_input_is_one_line_and_starts_nothing(ftcc, tmp_path, arguments, said):
    code, out, err = ftcc(*arguments)
    assert (code, out) == (2, "")
    assert said in err
    assert len(err.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_what_does_not_act_behind_a_door_is_named():
    assert set_aside(resolve(load("attitude_synchronization"))) == ()
    noisy = resolve(load("attitude_synchronization", settings=["noise.p=0.01"]))
    assert set_aside(noisy) == ("the measurement noise (doors have sensors)",)
    blind = resolve(
        load("attitude_synchronization", settings=['faults=[{at=1.0,uav=1,navigation="position",kind="off"}]'])
    )
    assert set_aside(blind) == ("faults of navigation",)


def test_a_port_in_use_is_refused(ftcc, tmp_path):
    import socket

    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        code, _, err = ftcc("vehicle", *SCENARIO, "--px4", other.getsockname()[1], "--out", "run")
    assert code == 2
    assert "Address already in use" in err


def test_turbulence_needs_the_plants_own_step(ftcc):
    code, _, err = ftcc(
        "vehicle", *SCENARIO, "--px4", 4560, "--set", "turbulence={sigma=[1,1,1],length=[100,100,100]}",
        "--set", "rates.plant_step=0.0025", "--set", "rates.control_rate=200"
    )  # fmt: skip
    assert code == 2
    assert "rates.plant_step 0.0025 s must divide 0.004 s" in err


def test_px4_is_found_by_its_build_or_by_itself_and_what_is_missing_is_named(build):
    assert find_px4(build) == find_px4(build / "bin" / "px4")
    assert find_px4(build).model == "jsbsim_malolo"
    scripts = build / "etc" / "init.d-posix"
    (scripts / "airframes" / "22500_ftcc_plane").touch()
    assert find_px4(build).model == "ftcc_plane"
    assert find_px4(build, "jsbsim_malolo").model == "jsbsim_malolo"
    with pytest.raises(DoorError, match="has no iris among its airframes"):
        find_px4(build, "iris")
    (build / "bin" / "px4").chmod(0o644)
    with pytest.raises(DoorError, match="is not executable"):
        find_px4(build)
    (build / "bin" / "px4").chmod(0o755)
    (scripts / "rcS").unlink()
    with pytest.raises(DoorError, match="rcS does not exist"):
        find_px4(build)
