"""The door for PX4, with a player of PX4's end: a whole flight, its repetition, faults, losses, and the bytes."""

from __future__ import annotations

import math
import socket
import struct
from contextlib import closing

import numpy as np
import pytest
from pymavlink.dialects.v20 import common as mavlink

from ftcc.groundside.scenario import load, resolve
from ftcc.link.home import Home
from ftcc.link.ports import PortError
from ftcc.sim.doors import flight
from ftcc.sim.doors.channels import PX4, ChannelError, Channels, by_pwm, checked, fractions
from ftcc.sim.doors.flight import DoorFlight
from ftcc.sim.doors.px4 import Px4Door
from ftcc.sim.doors.vehicle import DoorVehicle
from tests.sim.doors.bench import EXACT, Flown, a_vehicle, by_px4, fly, player, pytest_fails
from tests.support.ports import free_port


@pytest.fixture(scope="module")
def flown() -> Flown:
    return by_px4(20.0)


def test_the_aircraft_flies_for_twenty_seconds_after_its_launch(flown):
    truth = flown.truth[1]
    assert flown.flight.lost == {}
    assert len(truth) == 5001
    assert truth[0, 3] == 30.0
    assert np.abs(truth[:, 2] - 1000.0).max() < 5.0
    assert np.abs(truth[1000:, 6]).max() < 0.02
    assert np.abs(truth[1000:, 3] - 30.5).max() < 0.5
    texts = [text for text, _ in flown.said]
    assert [text.split()[0] for text in texts] == ["waits", "is", "launch:"]


def test_a_flight_repeats_bit_for_bit(flown):
    again = by_px4(20.0)
    assert again.truth[1].tobytes() == flown.truth[1].tobytes()
    assert again.acting[1].tobytes() == flown.acting[1].tobytes()


def test_junk_between_messages_changes_nothing(flown):
    noisy = by_px4(2.0, arguments=["--junk"])
    assert noisy.truth[1].tobytes() == flown.truth[1][:501].tobytes()


def test_answers_stamped_by_the_clock_of_px4_are_the_same(flown):
    """Main stamps them since its first sample, 2021 with the time of the sample."""
    other = by_px4(2.0, arguments=["--own-clock"])
    assert other.truth[1].tobytes() == flown.truth[1][:501].tobytes()


def test_a_fault_of_the_scenario_acts_on_the_controls_received(flown):
    """Elevator with 60 % effect and a bias of 0.05 rad from 2 s after the launch on, rudder stuck from 3 s on."""
    faulty = by_px4(
        4.0,
        'faults=[{at=2.0,uav=1,actuator="elevator",effectiveness=0.6,bias=0.05},'
        '{at=3.0,uav=1,actuator="rudder",kind="stuck"}]',
    )
    before, after = slice(0, 501), slice(550, None)
    assert faulty.truth[1][before].tobytes() == flown.truth[1][before].tobytes()
    commanded, acting = faulty.command[1][after, 1], faulty.acting[1][after, 1]
    # Behind a lag of 20 rad/s: 0.2 s after the step, the command moves slowly.
    assert acting == pytest.approx(0.6 * commanded + 0.05, abs=0.005)
    assert np.abs(faulty.truth[1][after, 9] - flown.truth[1][550:1001, 9]).max() > 0.02  # and it is felt
    assert np.ptp(faulty.acting[1][755:, 2]) == 0.0
    assert np.ptp(faulty.command[1][755:, 2]) > 0.0


def test_a_client_that_dies_is_reported_and_the_other_flies_on():
    vehicles = [a_vehicle(uav=uav) for uav in (1, 2)]
    doors = [Px4Door(vehicle, free_port(), PX4, pytest_fails) for vehicle in vehicles]
    with (
        player("px4_player", "--port", str(doors[0].port), "--die-at", "4.0"),
        player("px4_player", "--port", str(doors[1].port)),
    ):
        flown = fly(doors, 3.0)
    assert flown.flight.lost == {1: "PX4: PX4 closed the connection"}
    assert ("lost: PX4: PX4 closed the connection", 1) in flown.said
    assert len(flown.truth[2]) == 751
    # Armed at 1 s, launched in 2 s, dead at 4 s.
    assert len(flown.truth[1]) == pytest.approx(250, abs=2)


def test_all_wait_for_the_last_one_to_give_thrust():
    vehicles = [a_vehicle(uav=uav) for uav in (1, 2)]
    doors = [Px4Door(vehicle, free_port(), PX4, pytest_fails) for vehicle in vehicles]
    with (
        player("px4_player", "--port", str(doors[0].port), "--arm-at", "0.5"),
        player("px4_player", "--port", str(doors[1].port), "--arm-at", "1.5"),
    ):
        flown = fly(doors, 0.1)
    assert flown.said[-3:-1] == [("is armed and gives thrust", 1), ("is armed and gives thrust", 2)]
    assert len(flown.truth[1]) == len(flown.truth[2]) == 26
    assert vehicles[0].now_us == vehicles[1].now_us == pytest.approx(3_600_000, abs=20_000)


def test_an_aircraft_that_leaves_its_model_is_lost_with_the_reason():
    vehicle = a_vehicle("plant.guards.flight_path_angle=0.001")
    door = Px4Door(vehicle, free_port(), PX4, pytest_fails)
    with player("px4_player", "--port", str(door.port)):
        flown = fly([door], 3.0)
    assert flown.flight.lost == {1: "flight-path angle outside the model's valid range"}


# By hand, without a player.


def connected(door: Px4Door) -> socket.socket:
    client = socket.create_connection(("127.0.0.1", door.port))
    while not door.connected:
        door.read()
    return client


def controls(stamp: int, values: list[float], armed: bool = True, lockstep: bool = True) -> bytes:
    mav = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    message = mavlink.MAVLink_hil_actuator_controls_message(stamp, values, 1 | 128 * armed, int(lockstep))
    return bytes(message.pack(mav))


def take(door: Px4Door, data: bytes, client: socket.socket) -> None:
    client.sendall(data)
    while not select_one(door):
        pass
    door.read()


def select_one(door: Px4Door) -> bool:
    import select

    return bool(select.select([door], [], [], 5.0)[0])


def test_the_bytes_of_a_sample_are_those_of_the_public_definition():
    """MAVLink 2 frame, CRC-16/MCRF4XX with CRC_EXTRA 108, and the fields of HIL_SENSOR in the order of c_library_v2.

    Sources: mavlink.io "Packet Serialization"; common/mavlink_msg_hil_sensor.h (107, CRC 108).
    """
    vehicle = a_vehicle("start.uav.1.mu=0", "start.uav.1.alpha=0", "start.uav.1.beta=0", "start.z=500")
    door = Px4Door(vehicle, free_port(), PX4, pytest_fails)
    with closing(door), closing(connected(door)) as client:
        door.send()
        data = client.recv(4096)
    frames = []
    while data:
        assert data[0] == 0xFD
        size = data[1]
        frames.append(data[: 12 + size])
        data = data[12 + size :]
    kinds = [int.from_bytes(frame[7:10], "little") for frame in frames]
    assert kinds == [115, 113, 107]  # HIL_STATE_QUATERNION, HIL_GPS, HIL_SENSOR
    frame = frames[-1]
    assert int.from_bytes(frame[-2:], "little") == checksum(frame[1:-2] + bytes([108]))
    payload = frame[10:-2].ljust(64, b"\0")  # MAVLink 2 leaves zeros at the end out
    stamp, *numbers, fields = struct.unpack("<Q13fI", payload[:64])
    assert (stamp, fields) == (1, 0x1FFF)
    field = (0.2175, 0.0133, 0.4333)
    # Specific force, rates, field; hPa at 500 m (ISO 2533: 95461 Pa), no dynamic pressure, height, deg C.
    expected = (0.0, 0.0, -9.8, 0.0, 0.0, 0.0, *field, 954.61, 0.0, 500.0, 11.75)
    assert numbers == pytest.approx(expected, abs=0.01)


def checksum(data: bytes) -> int:
    """CRC-16/MCRF4XX; its check value for "123456789" is 0x6F91."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0x8408 if crc & 1 else crc >> 1
    return crc


def test_the_checksum_of_this_test_is_the_public_one():
    assert checksum(b"123456789") == 0x6F91


def test_the_fix_has_the_units_of_hil_gps():
    """1e-7 deg, mm, cm/s, cdeg; the course is unknown at rest."""
    vehicle = a_vehicle("home.altitude=400", "start.chi=-0.5")
    door = Px4Door(vehicle, free_port(), PX4, pytest_fails)
    mav = mavlink.MAVLink(None)
    with closing(door), closing(connected(door)) as client:
        door.send()
        at_rest = next(m for m in mav.parse_buffer(client.recv(4096)) if m.get_type() == "HIL_GPS")
        vehicle.launch()
        while not vehicle.flying:
            vehicle.advance(np.zeros(4))
        door.send()
        messages = mav.parse_buffer(client.recv(4096))
    moving = next(m for m in messages if m.get_type() == "HIL_GPS")
    truth = next(m for m in messages if m.get_type() == "HIL_STATE_QUATERNION")
    assert (at_rest.cog, at_rest.vel, at_rest.fix_type) == (65535, 0, 3)
    assert moving.alt == 1_400_000
    assert (moving.lat, moving.lon) == (
        473977000,
        round(8.5456e7 - 45.0 / 6378137.0 / math.cos(0.82725) * 180e7 / math.pi),
    )
    assert (moving.vel, moving.vn, moving.ve) == (3000, round(3000 * math.cos(0.5)), round(-3000 * math.sin(0.5)))
    assert moving.cog == round(100 * (360.0 - math.degrees(0.5)))
    assert (truth.true_airspeed, truth.vx, truth.alt) == (3000, moving.vn, 1_400_000)


@pytest.mark.parametrize("first", [0, 1])
def test_samples_go_out_by_the_clock_until_the_first_answer_and_then_one_for_each(first: int):
    door = Px4Door(a_vehicle(), free_port(), PX4, pytest_fails)
    with closing(door), closing(connected(door)) as client:
        for n in range(3):
            if n:
                door.vehicle.advance(door.controls)
            door.send()
            assert door.answered
        take(door, controls(4000 + first, [0.0] * 16), client)
        assert not door.answered  # that was for the second sample; the third is on its way
        take(door, controls(8000 + first, [0.0] * 16), client)
        assert door.answered
        door.vehicle.advance(door.controls)
        door.send()
        assert not door.answered
        take(door, controls(8000 + first, [0.0] * 16), client)
        assert not door.answered
        take(door, controls(12000 + first, [0.0] * 16), client)
        assert door.answered


def test_one_that_does_not_answer_is_reported_and_not_ended(monkeypatch):
    monkeypatch.setattr(flight, "_PATIENCE", 0.1)
    door = Px4Door(a_vehicle(), free_port(), PX4, pytest_fails)
    said: list[str] = []
    with closing(socket.create_connection(("127.0.0.1", door.port))) as client, closing(door):
        client.sendall(controls(1, [0.0] * 16))
        report = DoorFlight([door], math.inf, 1, lambda text, _: said.append(text), lambda: len(said) > 1)
        report.fly()
    assert said[1] == "still waits for PX4 to answer"
    assert report.lost == {}


def test_a_px4_without_lockstep_is_told_and_flown_by_the_clock():
    said: list[str] = []
    door = Px4Door(a_vehicle(), free_port(), PX4, said.append)
    with closing(door), closing(connected(door)) as client:
        door.send()
        take(door, controls(1, [0.0] * 16, lockstep=False), client)
        assert door.running_free
        assert door.answered
    assert said == ["this PX4 is not built for lockstep: it is sent samples by the clock"]


def test_the_default_channels_are_those_of_the_airframe():
    """PX4's 1036_jsbsim_malolo: 3 rudder, 5 motor, 6 left and 7 right aileron (TRQ_R -0.5 and 0.5), 8 elevator."""
    door = Px4Door(a_vehicle(), free_port(), PX4, pytest_fails)
    values = [0.0] * 16
    values[2], values[4], values[5], values[6], values[7] = 0.1, 0.7, -0.2, 0.2, 0.3
    with closing(door), closing(connected(door)) as client:
        take(door, controls(1, values, armed=True), client)
        assert door.armed
        # PX4 rolls right, pitches up, yaws right; our deflections that do so are negative.
        assert door.controls == pytest.approx([-0.2, -0.3, -0.1, 0.7])
        values[7], values[4] = math.nan, 1.5
        take(door, controls(2, values, armed=False), client)
        assert not door.armed
        assert door.controls == pytest.approx([-0.2, -0.3, -0.1, 1.0])


@pytest.mark.parametrize(
    "table",
    [
        PX4._replace(throttle=5),
        PX4._replace(elevator=((16, 1.0),)),
        PX4._replace(rudder=((2, 0.5),)),
        PX4._replace(aileron=()),
    ],
)
def test_a_table_of_channels_is_checked(table: Channels):
    with pytest.raises(ChannelError, match="channels"):
        checked(table, 16)


def test_pulses_are_fractions_of_travel_and_none_is_rest():
    out = np.zeros(4)
    by_pwm(Channels(((0, 1.0),), ((1, 1.0),), ((3, 1.0),), 2), [1750, 1000, 1500, 0], out)
    assert out.tolist() == [0.5, -1.0, 0.0, 0.5]
    fractions(PX4, [0.0] * 16, out)
    assert out.tolist() == [0.0] * 4


def test_a_port_in_use_is_named():
    port = free_port()
    with closing(socket.socket()) as other:
        other.bind(("127.0.0.1", port))
        other.listen()
        with pytest.raises(PortError, match=str(port)):
            Px4Door(a_vehicle(), port, PX4, pytest_fails)


def test_one_that_stands_still_does_not_hold_the_door():
    """It reads nothing for 60 s of samples: its buffers fill, the door waits without blocking, and then goes on."""
    door = Px4Door(a_vehicle(), free_port(), PX4, pytest_fails)
    with closing(door), closing(connected(door)) as client:
        sent = 0
        while door.answered and sent < 60_000:
            door.send()
            sent += 1
        assert sent < 60_000
        while not door.answered:
            client.recv(1 << 16)
        assert door.gone == ""


def test_an_aircraft_of_jsbsim_flies_in_real_time_at_the_step_of_its_door():
    """Its scenario steps it by 5 ms, PX4 by 4 ms: in 2 s it flies as far as its speed says."""
    pytest.importorskip("jsbsim", reason="JSBSim is not installed")
    flown = resolve(load("jsbsim_attitude"))
    vehicle = DoorVehicle(flown.vehicles[0], flown.timing, Home(*flown.home), EXACT, None, pytest_fails)
    door = Px4Door(vehicle, free_port(), PX4, pytest_fails)
    said: list[tuple[str, int | None]] = []
    with player("px4_player", "--port", str(door.port)):
        truth = fly([door], 2.0, said).truth[1]
    assert len(truth) == 501
    assert vehicle.spec.flown is not None
    assert vehicle.spec.flown.step_us == 1000
    along = np.linalg.norm(np.diff(truth[:, :3], axis=0), axis=1).sum()
    assert along == pytest.approx(truth[:, 3].mean() * 2.0, rel=0.01)
    assert along > 80.0
