"""The ground commands a swarm of real processes: faults at their time, modes, the flow of time, strangers."""

from __future__ import annotations

import socket
import subprocess
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from ftcc.groundside import Run, Station
from ftcc.groundside.swarm.registry import find_swarm
from ftcc.link.codec import Codec, dialect
from tests.sitl.conftest import Flight, events, same_flight

Ftcc = Callable[..., subprocess.CompletedProcess[str]]

SLOW = ["--set", "rates={control_rate=50.0, exchange_rate=10.0, latency=0.1}", "--set", "record_rate=50"]
"""In real time at 50 Hz: a test machine that is busy for a moment must not be the one that loses an aircraft."""


@pytest.fixture(autouse=True)
def runtime(environment: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    """The tests' own station looks for swarms where the flights are listed."""
    monkeypatch.setenv("FTCC_RUNTIME_DIR", environment["FTCC_RUNTIME_DIR"])


def held(fly: Callable[..., Flight], *arguments: str, scenario: str = "containment", name: str = "run") -> Flight:
    """A swarm in lockstep before its first tick."""
    flight = fly(scenario, "--speed", "max", "--hold", "--pack", "3", "--mavlink", "none", *arguments, name=name)
    flight.wait_until(lambda: "held at t = 0" in flight.output)
    return flight


def test_the_same_failures_planned_and_commanded_are_the_same_flight_bit_for_bit(
    fly: Callable[..., Flight], ftcc: Ftcc
) -> None:
    planned = [
        "--set",
        "faults=[{at=2.0, uav=1, actuator='elevator', effectiveness=0.7, bias=0.2, effectiveness_onset=2.0,"
        " bias_onset=2.0}, {at=3.0, uav=2, actuator='elevator', kind='stuck'}, {at=3.5, uav=2, actuator='elevator',"
        " kind='ok'}, {at=4.0, uav=3, navigation='position', kind='off'}, {at=4.5, uav=3, navigation='position',"
        " kind='ok'}, {at=5.0, uav=4, actuator='thrust', kind='intermittent', period=0.5, duty=0.5,"
        " effectiveness=0.2}]",
        "--set",
        "link_events=[{at=1.5, until=2.5, kind='cut', uav=5}]",
    ]
    flight = held(fly, "--duration", "6", "--set", "faults=[]")
    with Station() as station:
        assert (
            station.fault(1, "elevator", at=2.0, effectiveness=0.7, bias=0.2, effectiveness_onset=2.0, bias_onset=2.0)
            == 2.0
        )
        station.fault(2, "elevator", kind="stuck", at=3.0)
        station.repair(2, "elevator", at=3.5)
        station.fault(3, "position", kind="off", at=4.0)
        station.repair(3, "position", at=4.5)
        station.fault(4, "thrust", kind="intermittent", at=5.0, period=0.5, duty=0.5, eff=0.2, bias=0.0)
        assert station.cut(5, at=1.5) == []
        assert station.restore(5, at=2.5) == []
    assert ftcc("resume").returncode == 0
    assert flight.wait() == 0, flight.output
    alone = flight.folder.with_name("alone")
    assert ftcc("simulate", "containment", "--duration", "6", *planned, "--out", str(alone)).returncode == 0
    assert same_flight(alone, flight.folder)
    acts = [event for event in events(flight.folder) if event.get("outcome") == "acts"]
    assert [(event["t"], event["uav"]) for event in acts if event["uav"] == 1] == [(2.0, 1)]
    assert {event["who"] for event in acts} == {"254/190"}


def test_a_fire_that_moves_as_planned_and_as_commanded_is_the_same_flight_bit_for_bit(
    fly: Callable[..., Flight], ftcc: Ftcc
) -> None:
    at, north, east, drift = 4.0, 620.0, -35.0, (0.5, -0.25)
    flight = held(fly, "--duration", "8", scenario="fire_monitoring")
    with Station() as station:
        for uav in station.uavs:
            station.set(uav, "FTCC_AT", 1e3 * at)
            for name, value in (("NORTH", north), ("EAST", east), ("DRIFT_N", drift[0]), ("DRIFT_E", drift[1])):
                station.set(uav, f"FIRE_{name}", value)
    assert ftcc("resume").returncode == 0
    assert flight.wait() == 0, flight.output
    moves = f"fire_events=[{{at={at}, centre=[{north}, {east}], drift=[{drift[0]}, {drift[1]}]}}]"
    for name, settings, same in (("planned", ("--set", moves), True), ("still", (), False)):
        folder = flight.folder.with_name(name)
        simulated = ftcc("simulate", "fire_monitoring", "--duration", "8", *settings, "--out", str(folder))
        assert simulated.returncode == 0, simulated.stderr
        assert same_flight(folder, flight.folder) == same


def test_modes_pause_and_steps_in_one_flight(fly: Callable[..., Flight], ftcc: Ftcc) -> None:
    """Mission, hold, mission of a follower and of a leader; a leader offboard; each between pauses at known ticks."""
    flight = held(fly, "--duration", "12", "--set", "leaders.7.commands=[{at=0.0, altitude=1050.0}]")
    with Station() as station:

        def step_to(t: float) -> None:
            now = station.state(1).t if station.state(1).t > 0 else 0.0
            ticks = round((t - now) * 100) - (0 if now else -1)
            assert ftcc("step", str(ticks)).returncode == 0
            assert {station.state(uav).t for uav in station.uavs} == {t}

        step_to(4.0)
        station.mode(3, "hold")
        station.mode(7, "hold")
        step_to(6.0)
        station.mode(3, "mission")
        station.mode(7, "mission")
        step_to(8.0)
        send = dialect.MAVLink_set_position_target_local_ned_message
        target = send(0, 8, 1, dialect.MAV_FRAME_LOCAL_NED, 0b1111_1111_1011, 0, 0, -1020.0, *(0.0,) * 8)
        station.set(8, "COM_OF_LOSS_T", 0.0)
        station.send(8, target)
        station.mode(8, "offboard")
        station.send(8, target)
        assert station.state(8).mode == "offboard"
    assert ftcc("resume").returncode == 0
    assert flight.wait() == 0, flight.output
    run = Run(flight.folder)
    t = run.column("t", 7)
    held_for = (t >= 4.02) & (t <= 6.0)
    assert np.ptp(run.column("z", 7)[held_for]) == 0.0, "the leader stands still in altitude"
    assert np.ptp(run.column("V", 7)[held_for]) == 0.0
    after = run.column("z", 7)[t > 6.02]
    assert abs(after[0] - run.column("z", 7)[held_for][-1]) < 0.05, "it goes on from where it was held"
    assert np.all(np.diff(after) > 0.0)
    assert np.ptp(run.column("zhat", 3)[held_for]) == 0.0, "nobody is heard: the estimate stands"
    assert np.ptp(run.column("zhat", 3)[t > 6.1]) > 0.01
    assert run.column("z", 8)[t <= 8.0].max() == 1000.0
    assert run.column("z", 8)[-1] > 1000.05, "the leader climbs to the target from the ground"
    modes = [(event["uav"], event["text"]) for event in events(flight.folder) if "mode" in str(event["text"])]
    assert modes == [(3, "mode hold"), (7, "mode hold"), (3, "mode mission"), (7, "mode mission"), (8, "mode offboard")]


def test_offboard_without_targets_becomes_hold_in_simulated_time_with_a_pause_or_without(
    fly: Callable[..., Flight], ftcc: Ftcc
) -> None:
    """A pause as long as the time-out is no part of the flight: both are the same, bit for bit."""
    send = dialect.MAVLink_set_position_target_local_ned_message
    target = send(0, 8, 1, dialect.MAV_FRAME_LOCAL_NED, 0b1111_1111_1011, 0, 0, -1020.0, *(0.0,) * 8)
    folders = []
    for name in ("straight", "paused"):
        flight = held(fly, "--duration", "4", name=name)
        with Station() as station:
            station.set(8, "COM_OF_LOSS_T", 2.0)
            station.send(8, target)
            station.mode(8, "offboard")
            station.send(8, target)
            if name == "paused":
                assert ftcc("step", "101").returncode == 0
                time.sleep(2.5)
                assert station.state(8).mode == "offboard"
        assert ftcc("resume").returncode == 0
        assert flight.wait() == 0, flight.output
        lost = [event["t"] for event in events(flight.folder) if "becomes hold" in str(event["text"])]
        assert lost == [2.0]
        folders.append(flight.folder)
    assert same_flight(*folders)


def strangers(ports: list[int], count: int, per_second: float) -> int:
    """Send random bytes and mutated messages to every one of ``ports``; how many in all."""
    random = np.random.default_rng(1)
    codec = Codec(255, 190)
    seeds = [
        dialect.MAVLink_command_long_message(1, 1, 420, 0, 102, 4, 2, 0, 0, 0, 0),
        dialect.MAVLink_param_set_message(1, 1, b"K11", 9.0, dialect.MAV_PARAM_TYPE_REAL32),
        dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3),
        dialect.MAVLink_local_position_ned_message(0, 1, 2, 3, 4, 5, 6),
        dialect.MAVLink_debug_float_array_message(0, b"truth", 0, [1.0] * 58),
    ]
    begun = time.monotonic()
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as stranger:
        for n in range(count):
            datagram = bytearray(codec.pack(seeds[n % len(seeds)]))
            if n % 3 == 0:
                datagram = bytearray(random.bytes(int(random.integers(1, 400))))
            elif n % 3 == 1:
                datagram[int(random.integers(len(datagram)))] ^= int(random.integers(1, 256))
            else:
                datagram = datagram[: int(random.integers(1, len(datagram)))]
            for port in ports:
                try:
                    stranger.sendto(bytes(datagram), ("127.0.0.1", port))
                except ConnectionRefusedError:
                    continue
            time.sleep(max(0.0, begun + (n + 1) / per_second - time.monotonic()))
    return count * len(ports)


def test_strangers_on_every_port_change_nothing(fly: Callable[..., Flight], ftcc: Ftcc) -> None:
    """While a swarm flies in lockstep: it equals the simulation, and what came was counted."""
    flight = held(fly, "--duration", "20", "--set", "faults=[]")
    entry = find_swarm(None)
    with Station() as station:
        before = {uav: station.parameters(uav) for uav in station.uavs}
    # Two seconds of wall time: it must not be over before they come.
    assert ftcc("speed", "10").returncode == 0
    assert ftcc("resume").returncode == 0
    sent = strangers(list(range(entry.ports[0], entry.ports[1] + 1)), 100, 1000.0)
    assert sent > 4000
    assert flight.wait() == 0, flight.output
    alone = flight.folder.with_name("alone")
    assert (
        ftcc("simulate", "containment", "--duration", "20", "--set", "faults=[]", "--out", str(alone)).returncode == 0
    )
    assert same_flight(alone, flight.folder)
    assert all(values["K11"] == 3.0 for uav, values in before.items() if uav < 7)
    dropped = [str(event["text"]) for event in events(flight.folder) if "dropped" in str(event["text"])]
    assert len(dropped) == len(entry.vehicles) + 1, dropped
    assert not [event for event in events(flight.folder) if event.get("who") == "255/190"]


def test_the_command_line_reaches_a_swarm_in_real_time(fly: Callable[..., Flight], ftcc: Ftcc) -> None:
    flight = fly("containment", "--duration", "300", "--pack", "auto", "--mavlink", "none", *SLOW)
    flight.wait_until_flying()
    assert ftcc("vehicles").stdout.count("mission") == 8
    assert ftcc("fault", "1", "elevator", "--effectiveness", "0.9").returncode == 0
    assert ftcc("repair", "1").returncode == 0
    assert ftcc("link", "cut", "1", "2").returncode == 0
    assert ftcc("link", "restore", "1", "2").returncode == 0
    assert ftcc("leader", "7", "--altitude", "1020").returncode == 0
    assert ftcc("ftc", "3", "off").returncode == 0
    assert ftcc("param", "get", "3", "FTCC_FT").stdout.strip() == "0"
    refused = ftcc("leader", "7", "--speed", "32")
    assert refused.returncode == 1
    assert "speed must be constant" in refused.stderr
    absent = ftcc("fault", "9", "elevator", "--bias", "0.1")
    assert absent.returncode == 2
    assert "has no UAV 9" in absent.stderr
    assert ftcc("pause").returncode == 0
    with Station() as station:
        stands = [station.state(uav).t for uav in station.uavs]
        time.sleep(0.3)
        assert [station.state(uav).t for uav in station.uavs] == stands
        assert len(set(stands)) == 1
    assert ftcc("speed", "2").returncode == 0
    assert ftcc("resume").returncode == 0
    assert ftcc("step").returncode == 1
    assert ftcc("stop").returncode == 0
    assert flight.wait(20) == 0, flight.output
    told = [(event["uav"], event["text"], event.get("outcome")) for event in events(flight.folder)]
    for expected in (
        (1, "elevator wrong: eff 0.9", "acts"),
        (2, "link from UAV 1 off", "acts"),
        (7, "leader commanded to 1020 m", "accepted"),
        (3, "parameter FTCC_FT = 0 (was 1)", "accepted"),
    ):
        assert expected in told


def test_two_swarms_have_systems_of_their_own_at_one_ground_station(fly: Callable[..., Flight], ftcc: Ftcc) -> None:
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as ground:
        ground.bind(("127.0.0.1", 0))
        ground.settimeout(60.0)
        here = ["--mavlink", f"127.0.0.1:{ground.getsockname()[1]}", "--pack", "auto", "--hold"]
        fly("containment", *here, name="first")
        fly("containment", "--id-offset", "100", *here, name="second")
        codec = Codec(245, 190)
        systems: set[int] = set()
        while len(systems) < 16:
            systems |= {message.get_srcSystem() for message in codec.parse(ground.recv(4096))}
    assert systems == {*range(1, 9), *range(101, 109)}
    with Station("second") as station:
        assert station.fault(1, "elevator", at=20.0, eff=0.9) == 20.0
        assert station.state(8).role == "leader"
    with Station("first") as station:
        assert station.get(1, "FAIL_EFF") != pytest.approx(0.9)


def test_with_a_key_whose_folder_takes_no_stamps_it_says_so_and_flies(
    fly: Callable[..., Flight], ftcc: Ftcc, tmp_path: Path
) -> None:
    key = tmp_path / "key"
    assert ftcc("keys", "new", str(key)).returncode == 0
    (tmp_path / "key.stamps").mkdir()
    stamps = tmp_path / "key.stamps"
    stamps.rmdir()
    stamps.symlink_to("/proc/self")
    flight = held(fly, "--duration", "2", "--key", str(key))
    assert "cannot be saved" in flight.output
    listed = ftcc("vehicles")
    assert listed.returncode == 0, listed.stderr
    assert listed.stdout.count("mission") == 8
    assert ftcc("resume").returncode == 0
    assert flight.wait() == 0, flight.output


def test_systems_of_ground_stations_are_not_taken(ftcc: Ftcc) -> None:
    refused = ftcc("fly", "containment", "--id-offset", "232")
    assert refused.returncode == 2
    assert "must be from 0 to 231 with UAVs up to 8" in refused.stderr


def test_a_vehicle_that_has_died_is_missed(fly: Callable[..., Flight], ftcc: Ftcc) -> None:
    flight = fly("containment", "--duration", "300", "--mavlink", "none", *SLOW)
    flight.wait_until_flying()
    flight.child("uav3-autopilot").kill()
    missed = ftcc("param", "get", "3", "K11")
    assert missed.returncode == 2
    assert "UAV 3 of swarm run does not answer" in missed.stderr
    partly = ftcc("link", "cut", "2", "3")
    assert partly.returncode == 1
    assert "done at one end only: UAV 3" in partly.stderr


def test_keys_are_made_once(ftcc: Ftcc, tmp_path: Path) -> None:
    assert ftcc("keys", "new", str(tmp_path / "key")).returncode == 0
    again = ftcc("keys", "new", str(tmp_path / "key"))
    assert again.returncode == 2
    assert "never overwritten" in again.stderr
