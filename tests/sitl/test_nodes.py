"""A swarm over several computers, here all on loopback; tests/hosts has a network of its own for each."""

from __future__ import annotations

import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest

from ftcc.groundside import Run
from ftcc.link.codec import Codec
from ftcc.link.gcs_sockets import LISTENERS
from tests.sitl.conftest import FTCC, Flight, events, same_flight
from tests.support.ports import free_port

SPLIT = """
listen = "127.0.0.1:{port}"
[[nodes]]
name = "a"
vehicles = "1-3"
autopilots = "4"
[[nodes]]
name = "b"
uavs = "5"
autopilots = "1, 7"
"""
"""UAV 1 between the two nodes, 2 to 4 and 7 between one and the leading computer, 6 and 8 there alone."""

Node = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def port() -> int:
    return free_port()


@pytest.fixture
def plan(tmp_path: Path, port: int) -> Path:
    path = tmp_path / "nodes.toml"
    path.write_text(SPLIT.format(port=port))
    return path


@pytest.fixture
def node(tmp_path: Path, environment: dict[str, str], port: int) -> Iterator[Node]:
    """Start `ftcc node` with a name; what still runs at the end of the test is killed."""
    started: list[subprocess.Popen[str]] = []

    def start(name: str, *arguments: str) -> subprocess.Popen[str]:
        secrecy = [] if "--tls" in arguments else ["--insecure"]
        command = [*FTCC, "node", *arguments, "--join", f"127.0.0.1:{port}", "--name", name, *secrecy]
        started.append(
            subprocess.Popen(
                [*command, "--out", str(tmp_path / f"{name}-{len(started)}")],
                env={**environment, "COLUMNS": "200"},
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                start_new_session=True,
            )
        )
        return started[-1]

    yield start
    for process in started:
        if process.poll() is None:
            for one in (*psutil.Process(process.pid).children(recursive=True), process):
                one.kill()


def ended(process: subprocess.Popen[str]) -> tuple[int, str]:
    output, _ = process.communicate(timeout=60.0)
    return process.returncode, output


def test_it_equals_the_simulation_wherever_vehicles_and_autopilots_fly(
    fly: Callable[..., Flight],
    ftcc: Callable[..., subprocess.CompletedProcess[str]],
    node: Node,
    plan: Path,
    tmp_path: Path,
) -> None:
    """Encrypted. Who does not belong is refused, and a ground station beside the leading computer hears everybody."""
    keys, foreign = str(tmp_path / "keys"), str(tmp_path / "foreign")
    for folder in (keys, foreign):
        made = ftcc("keys", "mesh", folder, "--swarm", "test", "--uavs", "1-8", *(f"--node={name}" for name in "abc"))
        assert made.returncode == 0, made.stderr
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind(("127.0.0.1", free_port()))
        station.settimeout(5.0)
        mavlink = f"127.0.0.1:{station.getsockname()[1]}"
        asked = ("containment", "--duration", "4", "--seed", "5", "--variant", "loss30")
        flight = fly(*asked, "--speed", "max", "--pack", "2", "--nodes", str(plan), "--tls", keys, "--mavlink", mavlink)
        flight.wait_until(lambda: "waiting for node b" in flight.output)
        strangers = [
            (node("b", "demo", "--tls", keys), "refused: it is to fly demo, the swarm flies containment"),
            (node("b", "--uavs", "5-6", "--tls", keys), "refused: it is to fly vehicles 5-6, the plan has 5 there"),
            (node("d", "--tls", keys), "--tls"),
        ]
        for process, said in strangers:
            code, output = ended(process)
            assert code == 2, output
            assert said in output
        outside = [node("c", "--tls", keys), node("a", "--tls", foreign)]
        flight.wait_until(lambda: "refused: does not accept our authority" in flight.output)
        flight.wait_until(lambda: "node-c at 127.0.0.1 refused: has no rights here" in flight.output)
        here = [node("a", "--tls", keys), node("b", "containment", "--uavs=5", "--autopilots=1,7", "--tls", keys)]
        assert flight.wait() == 0, flight.output
        assert [ended(process)[0] for process in here] == [0, 0]
        for process in outside:
            assert process.poll() is None, process.communicate()
            process.send_signal(signal.SIGINT)
            assert "joined" not in ended(process)[1]
        codec, heard = Codec(255, 190), set()
        while len(heard) < 8:
            heard |= {message.get_srcSystem() for message in codec.parse(station.recv(4096))}
    assert heard == set(range(1, 9))
    simulated = tmp_path / "simulated"
    assert ftcc("simulate", *asked, "--out", str(simulated)).returncode == 0
    assert same_flight(flight.folder, simulated)
    logs = {path.stem for path in (flight.folder / "logs").glob("*.log")}
    assert {"uav1-vehicle", "uav1-autopilot", "uav5-vehicle", "uav7-autopilot"} <= logs


def test_commands_reach_every_computer_and_who_leaves_is_named(
    fly: Callable[..., Flight],
    ftcc: Callable[..., subprocess.CompletedProcess[str]],
    node: Node,
    plan: Path,
    tmp_path: Path,
) -> None:
    flight = fly("containment", "--duration", "60", "--hold", "--nodes", str(plan), "--insecure", "--mavlink", "none")
    here = {name: node(name) for name in "ab"}
    flight.wait_until(lambda: "held at t = 0" in flight.output)
    stepped = ftcc("step", "50")
    assert "paused at t = 0.5" in stepped.stdout, stepped.stdout + stepped.stderr
    assert ftcc("resume").returncode == 0
    for uav in ("1", "5"):
        fault = ftcc("fault", uav, "elevator", "--effectiveness", "0.7")
        assert f"UAV {uav}: elevator wrong" in fault.stdout, fault.stdout + fault.stderr
    here["b"].send_signal(signal.SIGINT)
    assert ended(here["b"])[0] != 0
    flight.wait_until(lambda: "node b left: it was interrupted" in flight.output)
    assert ftcc("speed", "5").returncode == 0
    time.sleep(1.0)
    assert flight.process.poll() is None
    flight.interrupt()
    assert flight.wait() == 1
    assert ended(here["a"])[0] == 0
    texts = [str(event["text"]) for event in events(flight.folder)]
    assert any(text.startswith("process uav5-vehicle died (node b left") for text in texts)
    left = str(tmp_path / "b-1")
    assert any(left in text for text in texts)
    assert list(Path(left, "parts").glob("5-*.arrows"))


def test_nodes_are_started_by_ssh(
    fly: Callable[..., Flight], port: int, environment: dict[str, str], tmp_path: Path
) -> None:
    """Instead of ssh, a script of that name runs here what it is told to run there."""
    (tmp_path / "bin").mkdir()
    ssh = tmp_path / "bin" / "ssh"
    ssh.write_text(f'#!/bin/sh\nprintf "%s\\n" "$3" >> {tmp_path}/called\ncd {tmp_path} && exec sh -c "$4"\n')
    ssh.chmod(0o755)
    environment["PATH"] = f"{ssh.parent}:{environment['PATH']}"
    plan = tmp_path / "nodes.toml"
    entry = '[[nodes]]\nname = "{0}"\nuavs = "{1}"\nssh = "pilot@{0}"\ncommand = "{2}"\n'
    nodes = [entry.format(name, uavs, " ".join(FTCC)) for name, uavs in (("a", "1-2"), ("b", "3-4"))]
    plan.write_text(f'listen = "127.0.0.1:{port}"\n{"".join(nodes)}')
    asked = ("containment", "--duration", "1", "--speed", "max", "--pack", "2", "--mavlink", "none")
    flight = fly(*asked, "--nodes", str(plan), "--ssh", "--insecure")
    assert flight.wait() == 0, flight.output
    assert sorted((tmp_path / "called").read_text().split()) == ["pilot@a", "pilot@b"]
    for name in "ab":
        log = (flight.folder / "logs" / f"node-{name}.log").read_text()
        assert f"node {name}: joined run" in log
        assert f"node {name}: over; recorded in" in log
    run = Run(flight.folder)
    assert set(run.uavs) >= set(run.mission.graph.followers)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["fly", "demo", "--nodes", "PLAN"], "traffic between computers must be encrypted: give --tls DIR"),
        (["fly", "demo", "--nodes", "PLAN", "--insecure", "--tls", "keys"], "--tls and --insecure: give one of them"),
        (["fly", "demo", "--insecure"], "--insecure: belongs to --nodes"),
        (["fly", "demo", "--nodes", "nowhere.toml", "--insecure"], "--nodes nowhere.toml: No such file"),
        (["fly", "fire_monitoring", "--nodes", "PLAN", "--insecure"], "node b: there is no UAV"),
        (["node", "--join", "127.0.0.1:7447"], "traffic between computers must be encrypted"),
        (["node", "--insecure"], "--join HOST:PORT is missing"),
        (["node", "--insecure", "--join", "127.0.0.1"], "--join 127.0.0.1: must be HOST:PORT"),
        (["node", "--insecure", "--join", "127.0.0.1:1", "--uavs", "4-"], "--uavs '4-': must be ids of UAVs"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_starts(
    arguments: list[str],
    said: str,
    plan: Path,
    ftcc: Callable[..., subprocess.CompletedProcess[str]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    refused = ftcc(*(str(plan) if word == "PLAN" else word for word in arguments))
    assert refused.returncode == 2, refused.stdout + refused.stderr
    assert said in refused.stderr
    assert not (tmp_path / "runs").exists()


def test_the_default_ground_stations_are_beside_the_leading_computer() -> None:
    """They are on loopback, so nodes reach them through the relay."""
    assert {host for host, _ in LISTENERS} == {"127.0.0.1"}
