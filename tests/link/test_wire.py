"""Both ends of the wire over real loopback sockets: what is sent arrives, and pymavlink reads the same."""

from __future__ import annotations

import select
import socket
from collections.abc import Iterator

import numpy as np
import pytest

from ftcc.link.mavlink import AUTOPILOT, LOOPBACK, SIMULATOR, Endpoint, dialect, ending_message
from ftcc.link.system_calls import READABLE, wait
from ftcc.link.wire import (
    Wire,
    connect,
    is_readable,
    keep_sent,
    new_wire,
    read_attitude_target,
    read_command,
    read_position_target,
    read_state,
    receive_datagram,
    send_again,
    send_attitude_target,
    send_command,
    send_position_target,
    send_state,
)
from tests.support import pymavlink_wire as reference

RANDOM = np.random.default_rng(1)
STATE = (RANDOM.normal(size=13) * 100.0).astype(np.float32).astype(np.float64)
CONTROLS = RANDOM.uniform(-1.0, 1.0, 4).astype(np.float32).astype(np.float64)


class Ends:
    """A vehicle's end and an autopilot's end, and a bare socket in the place of either."""

    def __init__(self) -> None:
        ports = []
        for _ in range(2):
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
                free.bind((LOOPBACK, 0))
                ports.append(free.getsockname()[1])
        self.pilot = Endpoint(3, SIMULATOR, ports[0], (LOOPBACK, ports[1]))
        self.craft = Endpoint(3, AUTOPILOT, ports[1], (LOOPBACK, ports[0]))
        self.vehicle, self.autopilot = new_wire([3], SIMULATOR), new_wire([3], AUTOPILOT)
        self.others = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.others.bind((LOOPBACK, 0))
        connect(self.vehicle, [self.pilot], self.others.fileno())
        connect(self.autopilot, [self.craft], self.others.fileno())

    def close(self) -> None:
        for one in (self.pilot, self.craft, self.others):
            one.close()


@pytest.fixture
def ends() -> Iterator[Ends]:
    both = Ends()
    yield both
    both.close()


def arrived(wire: Wire) -> bytes:
    """The datagram at hand, after it has come."""
    wait(wire.polled, 5000)
    assert is_readable(wire, 0)
    assert receive_datagram(wire, 0)
    return wire.datagram[: wire.length[0]].tobytes()


def parsed(data: bytes) -> list[object]:
    return list(dialect.MAVLink(None).parse_buffer(bytearray(data)))


@pytest.mark.parametrize("told", [False, True])
def test_a_state_arrives_and_pymavlink_reads_the_same(ends: Ends, told: bool) -> None:
    assert send_state(ends.vehicle, 0, 30_000, STATE, CONTROLS, told)
    data = arrived(ends.autopilot)
    state, controls = np.zeros(13), np.zeros(4)
    assert read_state(ends.autopilot, state, controls) == (30_000, int(told))
    assert np.array_equal(state, STATE)
    assert np.array_equal(controls, CONTROLS if told else np.zeros(4))
    seen, force = np.zeros(13), np.zeros(4)
    assert reference.read_state(parsed(data), seen, force) == (30_000, 3 if told else 2)
    assert np.array_equal(seen, state)
    assert np.array_equal(force, controls)
    assert [m.get_srcSystem() for m in parsed(data)] == [3] * (3 if told else 2)  # type: ignore[attr-defined]


def test_commands_and_targets_arrive_and_pymavlink_reads_the_same(ends: Ends) -> None:
    controls, seen = np.zeros(4), np.zeros(4)
    assert send_command(ends.autopilot, 0, 123_450_000, CONTROLS)
    (message,) = parsed(arrived(ends.vehicle))
    assert read_command(ends.vehicle, controls) == reference.read_command(message, seen) == 123_450_000
    assert np.array_equal(controls, CONTROLS)
    assert np.array_equal(seen, CONTROLS)

    attitude = np.array([*STATE[:4] / 400.0, 0.5]).astype(np.float32).astype(np.float64)
    target, again = np.zeros(5), np.zeros(5)
    assert send_attitude_target(ends.autopilot, 0, 20_000, attitude)
    (message,) = parsed(arrived(ends.vehicle))
    assert read_attitude_target(ends.vehicle, target) == reference.read_attitude(message, again) == 20_000
    assert np.array_equal(target, attitude)
    assert np.array_equal(again, attitude)
    assert message.type_mask == 7  # type: ignore[attr-defined]

    leader, mine, theirs = np.array([12.5, 375.0, 20.0, 1010.5, 30.0, 0.0, 1.25]), np.zeros(7), np.zeros(7)
    assert send_position_target(ends.autopilot, 0, leader)
    (message,) = parsed(arrived(ends.vehicle))
    assert read_position_target(ends.vehicle, mine) == reference.read_target(message, theirs) == 12_500_000
    assert np.array_equal(mine, leader)
    assert np.array_equal(theirs, leader)
    assert (message.z, message.vz, message.coordinate_frame) == (-1010.5, -1.25, 1)  # type: ignore[attr-defined]


def test_a_stamp_between_two_ms_is_rounded_down_wherever_it_travels(ends: Ends) -> None:
    """12.5 ms: all messages of a tick name the same ms, but for actuator commands, which name microseconds."""
    send_state(ends.vehicle, 0, 37_500, STATE, CONTROLS, True)
    arrived(ends.autopilot)
    assert read_state(ends.autopilot, np.zeros(13), np.zeros(4)) == (37_000, 1)
    send_command(ends.autopilot, 0, 37_500, CONTROLS)
    arrived(ends.vehicle)
    assert read_command(ends.vehicle, np.zeros(4)) == 37_500
    send_attitude_target(ends.autopilot, 0, 37_500, np.array([1.0, 0.0, 0.0, 0.0, 0.5]))
    arrived(ends.vehicle)
    assert read_attitude_target(ends.vehicle, np.zeros(5)) == 37_000
    send_position_target(ends.autopilot, 0, np.array([0.0375, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    arrived(ends.vehicle)
    assert read_position_target(ends.vehicle, np.zeros(7)) == 37_000


def test_the_bytes_are_those_of_pymavlink(ends: Ends) -> None:
    packer = dialect.MAVLink(None, srcSystem=3, srcComponent=AUTOPILOT)
    target = np.array([12.5, 375.0, 20.0, 1010.5, 30.0, 0.0, 1.25])
    send_position_target(ends.autopilot, 0, target)
    assert arrived(ends.vehicle) == bytes(reference.target_message(3, target).pack(packer))
    packer.seq = 1
    send_attitude_target(ends.autopilot, 0, 20_000, np.array([1.0, 0.0, 0.0, 0.0, 0.5]))
    attitude = reference.attitude_message(20_000, 3, np.array([1.0, 0.0, 0.0, 0.0, 0.5]))
    assert arrived(ends.vehicle) == bytes(attitude.pack(packer))


def test_messages_of_another_kind_or_of_two_ticks_are_no_state_and_no_command(ends: Ends) -> None:
    now, later = (reference.state_messages(stamp, STATE, CONTROLS) for stamp in (10_000, 20_000))
    for wrong in (now[:1], (now[0], later[1], now[2]), (now[1], now[0], now[2]), (*now, *later), now[2:]):
        ends.pilot.send(*wrong)
        arrived(ends.autopilot)
        assert read_state(ends.autopilot, np.zeros(13), np.zeros(4)) == (-1, 0)
    ends.craft.send(*now)
    arrived(ends.vehicle)
    assert read_command(ends.vehicle, np.zeros(4)) == -1
    assert read_attitude_target(ends.vehicle, np.zeros(5)) == -1
    assert read_position_target(ends.vehicle, np.zeros(7)) == -1


def test_what_is_sent_again_is_the_same_datagram(ends: Ends) -> None:
    send_again(ends.autopilot, 0)  # nothing was sent yet
    send_command(ends.autopilot, 0, 10_000, CONTROLS)
    send_again(ends.autopilot, 0)
    assert arrived(ends.vehicle) == arrived(ends.vehicle)
    last = ends.craft.pack(ending_message())
    keep_sent(ends.autopilot, 0, last)
    send_again(ends.autopilot, 0)
    assert arrived(ends.vehicle) == last


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e39])
@pytest.mark.filterwarnings("ignore:overflow")
def test_what_float32_cannot_hold_is_not_sent(ends: Ends, value: float) -> None:
    for place in (5, 12):
        state = STATE.copy()
        state[place] = value
        assert not send_state(ends.vehicle, 0, 0, state, CONTROLS, True)
    assert not send_state(ends.vehicle, 0, 0, STATE, np.array([0.0, value, 0.0, 0.0]), True)
    assert not send_command(ends.autopilot, 0, 0, np.array([0.0, value, 0.0, 0.0]))
    assert not send_position_target(ends.autopilot, 0, np.array([1.0, 0.0, value, 0.0, 0.0, 0.0, 0.0]))
    assert not select.select([ends.pilot, ends.craft], [], [], 0.05)[0]
    send_again(ends.vehicle, 0)
    assert not select.select([ends.craft], [], [], 0.05)[0]


def test_messages_are_numbered_whoever_sends_them(ends: Ends) -> None:
    send_state(ends.vehicle, 0, 0, STATE, CONTROLS, True)
    ends.pilot.send(ending_message())
    send_state(ends.vehicle, 0, 10_000, STATE, CONTROLS, False)
    numbers = [m.get_seq() for _ in range(3) for m in parsed(arrived(ends.autopilot))]  # type: ignore[attr-defined]
    assert numbers == [0, 1, 2, 3, 4, 5]


def test_strangers_are_not_heard_and_a_peer_that_is_gone_harms_nobody(ends: Ends) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(b"\xfd" * 40, ends.craft._socket.getsockname())
    assert not receive_datagram(ends.autopilot, 0)
    ends.pilot.close()
    for _ in range(3):
        assert send_command(ends.autopilot, 0, 0, CONTROLS)
        assert not receive_datagram(ends.autopilot, 0)


def test_who_waits_is_woken_by_each_of_its_descriptors_and_else_by_the_time(ends: Ends) -> None:
    wire = ends.autopilot
    assert wire.polled[:, 1].tolist() == [READABLE] * 3
    assert wait(wire.polled, 1) == 0
    assert not is_readable(wire, 0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.sendto(b"?", ends.others.getsockname())
    assert wait(wire.polled, 5000) == 1
    assert (is_readable(wire, 0), is_readable(wire, 1)) == (False, True)
    send_state(ends.vehicle, 0, 0, STATE, CONTROLS, True)
    assert wait(wire.polled[:1], 5000) == 1
    assert is_readable(wire, 0)
