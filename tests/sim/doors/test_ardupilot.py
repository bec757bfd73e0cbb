"""The door for ArduPilot, with a player of ArduPilot's end: flight, frames sent again, restarts, and the bytes."""

from __future__ import annotations

import json
import socket
import struct
from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest

from ftcc.link.ports import PortError
from ftcc.sim.doors.ardupilot import ArduPilotDoor, Frame, read_frame
from ftcc.sim.doors.channels import ARDUPILOT
from tests.sim.doors.bench import a_vehicle, by_ardupilot, pytest_fails
from tests.support.ardupilot_player import read_state
from tests.support.ports import free_port

REST = [1500, 1500, 1000, 1500] + [0] * 12


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def door(said: list[str]) -> Iterator[ArduPilotDoor]:
    with closing(ArduPilotDoor(a_vehicle(), free_port(), ARDUPILOT, said.append)) as door:
        yield door


@pytest.fixture
def client() -> Iterator[socket.socket]:
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as client:
        client.settimeout(5.0)
        yield client


def frame(number: int, pulses: list[int] = REST, rate: int = 1200, magic: int = 18458) -> bytes:
    return struct.pack(f"<HHI{len(pulses)}H", magic, rate, number, *pulses)


def exchange(door: ArduPilotDoor, client: socket.socket, data: bytes) -> None:
    """Send datagrams of a client, and let the door read them."""
    client.sendto(data, ("127.0.0.1", door.port))
    door.read()


def test_the_aircraft_flies_after_its_launch_and_repeats_bit_for_bit():
    flown, door = by_ardupilot(5.0)
    truth = flown.truth[1]
    assert flown.flight.lost == {}
    assert len(truth) == 5001
    assert np.abs(truth[:, 2] - 1000.0).max() < 5.0
    assert np.abs(truth[3000:, 6]).max() < 0.02
    assert (door.bad, door.missed) == (0, 0)
    again, _ = by_ardupilot(2.0)
    assert again.truth[1].tobytes() == truth[:2001].tobytes()


def test_a_frame_is_read_as_the_readme_describes_it():
    """uint16 magic, uint16 frame_rate, uint32 frame_count, uint16 pwm[16] or [32], little-endian."""
    few = bytes.fromhex("1a48b00407000000") + bytes.fromhex("dc05") * 16
    assert read_frame(few) == Frame(1200, 7, (1500,) * 16)
    many = bytes.fromhex("81739001ffffffff") + bytes.fromhex("e803") * 32
    assert read_frame(many) == Frame(400, 4294967295, (1000,) * 32)
    for junk in (b"", b"\x1a", few[:-1], few + b"\0", b"\0\0" + few[2:], many[:2] + few[2:]):
        assert read_frame(junk) is None


def test_the_answer_has_the_fields_of_the_readme_and_can_be_read_by_its_reader(door, client):
    exchange(door, client, frame(0))
    door.send()
    line = client.recv(65536)
    readme = (
        '{"timestamp":2500,"imu":{"gyro":[0,0,0],"accel_body":[0,0,0]},"position":[0,0,0],'
        '"attitude":[0,0,0],"velocity":[0,0,0]}'
    )
    expected = set(json.loads(readme)) - {"attitude"} | {"quaternion", "airspeed"}
    assert set(json.loads(line)) == expected
    state = read_state(line)
    assert state["timestamp"] == (0.001,)
    assert sum(f * f for f in state["accel_body"]) == pytest.approx(9.8**2)
    # 30 m before the place and 1000 m above the origin of the start.
    assert state["position"] == pytest.approx((-30.0, -45.0, -1000.0))
    assert (state["velocity"], state["airspeed"]) == ((0.0, 0.0, 0.0), (0.0,))


def test_the_step_is_the_nearest_number_of_the_plants_steps(door, client):
    """1/1200 s is 1.67 steps of 0.5 ms."""
    exchange(door, client, frame(0))
    assert door.vehicle.period_us == 1000
    other = ArduPilotDoor(a_vehicle(), free_port(), ARDUPILOT, pytest_fails)
    with closing(other):
        exchange(other, client, frame(0, rate=0))
        assert other.vehicle.period_us == 20_000


def test_a_frame_sent_again_gets_the_same_answer_and_no_step(door, client):
    exchange(door, client, frame(0))
    door.send()
    first = client.recv(65536)
    exchange(door, client, frame(0))
    assert client.recv(65536) == first
    assert not door.answered
    exchange(door, client, frame(1))
    assert door.answered


def test_of_several_frames_the_newest_counts(door, client):
    exchange(door, client, frame(0))
    door.send()
    client.recv(65536)
    for number in (0, 0, 1):
        client.sendto(frame(number, [1500, 1500, 1500 + 100 * number, 1500] + [0] * 12), ("127.0.0.1", door.port))
    door.read()
    assert door.answered
    assert door.controls[3] == 0.6
    client.setblocking(False)
    with pytest.raises(BlockingIOError):
        client.recv(65536)


def test_thirty_two_channels_and_the_default_servos(door, client):
    """Above 1500 us SERVO1 rolls right, 2 pitches up, 4 yaws right; our deflections that do so are negative."""
    exchange(door, client, frame(0, [1750, 1600, 1300, 1450] + [0] * 28, magic=29569))
    assert door.connected
    assert door.controls == pytest.approx([-0.5, -0.2, 0.1, 0.3])


def test_junk_and_strangers_are_counted_and_ignored(door, client):
    exchange(door, client, b"no frame")
    assert not door.connected
    exchange(door, client, frame(5))
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as stranger:
        exchange(door, stranger, frame(6, [2000] * 16))
    assert door.bad == 2
    assert door.controls.tolist() == [0.0] * 4
    exchange(door, client, frame(9))
    assert door.missed == 3


def test_an_ardupilot_started_again_on_the_launcher_begins_anew(door, client, said):
    exchange(door, client, frame(70))
    door.send()
    client.recv(65536)
    for _ in range(50):
        door.vehicle.advance(door.controls)
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as anew:
        anew.settimeout(5.0)
        exchange(door, anew, frame(0))
        door.send()
        assert read_state(anew.recv(65536))["timestamp"] == (0.001,)
    assert said == ["ArduPilot was started again"]
    assert door.gone == ""


def test_one_started_again_in_flight_is_lost(door, client):
    exchange(door, client, frame(70))
    door.vehicle.launch()
    exchange(door, client, frame(3))
    assert door.gone == "ArduPilot was started again in flight"


def test_a_port_in_use_is_named(door):
    with pytest.raises(PortError, match=str(door.port)):
        ArduPilotDoor(a_vehicle(), door.port, ARDUPILOT, pytest_fails)
