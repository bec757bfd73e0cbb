"""MAVLink between a vehicle and its autopilot, over real loopback sockets."""

from __future__ import annotations

import math
import select
import socket
import time
from collections.abc import Iterator

import numpy as np
import pytest

from ftcc.link.mavlink import AUTOPILOT, LOOPBACK, SIMULATOR, Endpoint, dialect, float_array, status_text
from tests.support.pymavlink_wire import command_message, read_command, read_state, state_messages


class Pair:
    """An autopilot's endpoint, and the bare socket of its vehicle from which any bytes can come."""

    def __init__(self) -> None:
        self.vehicle = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.vehicle.bind((LOOPBACK, 0))
        self.autopilot = Endpoint(1, AUTOPILOT, 0, self.vehicle.getsockname())
        self.vehicle.connect((LOOPBACK, port_of(self.autopilot)))
        self._packer = dialect.MAVLink(None, srcSystem=1, srcComponent=SIMULATOR)

    def bytes_of(self, *messages: object) -> bytes:
        data = b""
        for message in messages:
            data += message.pack(self._packer)  # type: ignore[attr-defined]
            self._packer.seq = (self._packer.seq + 1) % 256
        return data

    def state(self, n: int) -> bytes:
        """The datagram of the state at tick n of 10 ms."""
        return self.bytes_of(*state_messages(n * 10_000, np.arange(13.0) + n, np.zeros(4)))

    def close(self) -> None:
        self.vehicle.close()
        self.autopilot.close()


def port_of(endpoint: Endpoint) -> int:
    return int(endpoint._socket.getsockname()[1])


def arrived(endpoint: Endpoint, seconds: float = 2.0) -> list[object]:
    """What one reading gives, once something is there to be read."""
    select.select([endpoint], [], [], seconds)
    return endpoint.receive()


def gathered(endpoint: Endpoint, count: int, seconds: float = 5.0) -> list[object]:
    """At least ``count`` messages, or what has come after ``seconds``."""
    messages: list[object] = []
    until = time.monotonic() + seconds
    while len(messages) < count and time.monotonic() < until:
        messages += arrived(endpoint, 0.1)
    return messages


@pytest.fixture
def pair() -> Iterator[Pair]:
    both = Pair()
    yield both
    both.close()


# Content.


def test_state_arrives_as_the_float32_that_it_was_rounded_to(pair):
    """Rounded once by the sensors, a state is not changed any more by the wire: a flight in one process is the same."""
    random = np.random.default_rng(1)
    for n in range(200):
        sent = (random.normal(size=13) * 10.0 ** random.integers(-6, 5, 13)).astype(np.float32).astype(np.float64)
        controls = random.uniform(-1.0, 1.0, 4).astype(np.float32).astype(np.float64)
        pair.vehicle.send(pair.bytes_of(*state_messages(n * 10_000, sent, controls)))
        state, force = np.zeros(13), np.zeros(4)
        assert read_state(arrived(pair.autopilot), state, force) == (n * 10_000, 3)
        assert np.array_equal(state, sent)
        assert np.array_equal(force, controls)


def test_a_state_that_is_no_float32_is_rounded_to_the_nearest_one(pair):
    sent = np.full(13, 1.0 / 3.0)
    pair.vehicle.send(pair.bytes_of(*state_messages(0, sent, sent[:4])))
    state, force = np.zeros(13), np.zeros(4)
    read_state(arrived(pair.autopilot), state, force)
    assert np.array_equal(state, np.float32(sent))
    assert np.array_equal(force, np.float32(sent[:4]))


def test_attitude_position_and_command_in_force_travel_in_one_datagram(pair):
    pair.autopilot.send(*state_messages(30_000, np.zeros(13), np.zeros(4)))
    datagram = pair.vehicle.recv(4096)
    messages = dialect.MAVLink(None).parse_buffer(bytearray(datagram))
    assert [m.get_type() for m in messages] == ["ATTITUDE_QUATERNION", "LOCAL_POSITION_NED", "HIL_ACTUATOR_CONTROLS"]
    assert messages[0].time_boot_ms == messages[1].time_boot_ms == 30
    assert messages[2].time_usec == 30_000
    assert (messages[0].get_srcSystem(), messages[0].get_srcComponent()) == (1, AUTOPILOT)


def test_command_arrives_with_the_stamp_of_the_state_that_it_answers(pair):
    sent = np.float32([0.0, -0.28125714, 0.0, 0.532575]).astype(np.float64)
    pair.vehicle.send(pair.bytes_of(command_message(123_450_000, sent)))
    controls = np.zeros(4)
    assert read_command(arrived(pair.autopilot)[0], controls) == 123_450_000
    assert np.array_equal(controls, sent)


def test_numbers_for_the_ground_and_texts_are_made_to_fit(pair):
    signals = float_array(5, "signals", [1.5, math.nan, -2.0, math.inf, 1e39])
    pair.vehicle.send(pair.bytes_of(signals, status_text(4, "fault ρ " * 20)))
    numbers, text = arrived(pair.autopilot)
    assert list(numbers.data[:6]) == [1.5, 0.0, -2.0, 0.0, 0.0, 0.0]
    assert len(text.text) == 50


# What must never pass.


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_value_that_is_not_finite_is_not_sent(pair, value):
    state = np.ones(13)
    state[5] = value
    with pytest.raises(ValueError, match="ATTITUDE_QUATERNION holds a value that is not finite"):
        pair.autopilot.send(*state_messages(0, state, np.ones(4)))
    with pytest.raises(ValueError, match="HIL_ACTUATOR_CONTROLS"):
        pair.autopilot.send(command_message(0, np.array([0.0, value, 0.0, 0.0])))
    assert not select.select([pair.vehicle], [], [], 0.05)[0]


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_value_that_is_not_finite_is_dropped_on_arrival_and_counted(pair, value):
    state = np.ones(13)
    state[12] = value
    pair.vehicle.send(pair.bytes_of(*state_messages(0, state, np.ones(4))))
    pair.vehicle.send(pair.bytes_of(command_message(0, np.array([value, 0.0, 0.0, 0.0]))))
    pair.vehicle.send(pair.state(1))
    messages = gathered(pair.autopilot, 5)
    assert [m.get_type() for m in messages] == [
        "ATTITUDE_QUATERNION",
        "HIL_ACTUATOR_CONTROLS",
        "ATTITUDE_QUATERNION",
        "LOCAL_POSITION_NED",
        "HIL_ACTUATOR_CONTROLS",
    ]
    assert pair.autopilot.codec.not_finite == 2


def test_commands_keep_the_nan_that_means_not_given(pair):
    """MAVSDK sends failure.inject as COMMAND_LONG 420 with p4-p7 = nan."""
    command = dialect.MAVLink_command_long_message(1, 1, 420, 0, 101, 1, 1, *(math.nan,) * 4)
    pair.vehicle.send(pair.bytes_of(command))
    assert math.isnan(arrived(pair.autopilot)[0].param7)


FORGED_HEADER = bytes([0xFD, 255, 0, 0, 0, 1, 1, 30, 0, 0])
"""Ten bytes that announce a message of 255: the stock parser would fill it from the datagrams that follow."""


@pytest.mark.parametrize(
    "bad",
    [
        FORGED_HEADER,
        FORGED_HEADER[:1],
        bytes([0xFE, 255, 0, 1, 1, 30]),
        b"\xfd" * 40,
        bytes(range(256)),
        b"\x00" * 7,
        np.random.default_rng(1).bytes(500),
    ],
    ids=["header", "magic", "header-1", "magics", "ramp", "zeros", "random"],
)
def test_bad_bytes_swallow_nothing_of_the_datagrams_after_them(pair, bad):
    for n in range(20):
        pair.vehicle.send(bad)
        pair.vehicle.send(pair.state(n))
    messages = gathered(pair.autopilot, 60)
    stamps = [read_state(messages[3 * n : 3 * n + 3], np.zeros(13), np.zeros(4))[0] for n in range(20)]
    assert stamps == [n * 10_000 for n in range(20)]
    assert pair.autopilot.codec.bad_data >= 20


def test_a_datagram_cut_short_gives_its_whole_messages_and_harms_no_other(pair):
    pair.vehicle.send(pair.state(0)[:-3])
    pair.vehicle.send(pair.state(1))
    messages = gathered(pair.autopilot, 5)
    assert read_state(messages[-3:], np.zeros(13), np.zeros(4)) == (10_000, 3)


def test_a_flipped_bit_is_bad_data(pair):
    good = bytearray(pair.state(0))
    good[20] ^= 1
    pair.vehicle.send(bytes(good))
    assert [m.get_type() for m in arrived(pair.autopilot)] == ["LOCAL_POSITION_NED", "HIL_ACTUATOR_CONTROLS"]
    assert pair.autopilot.codec.bad_data > 0


def test_datagrams_per_reading_are_capped_and_the_rest_is_kept(pair):
    """A flood must not hold up a tick for ever."""
    for n in range(150):
        pair.vehicle.send(pair.bytes_of(command_message(n * 10_000, np.zeros(4))))
    readings = [arrived(pair.autopilot) for _ in range(3)]
    assert [len(messages) for messages in readings] == [64, 64, 22]
    stamps = [read_command(message, np.zeros(4)) for messages in readings for message in messages]
    assert stamps == [n * 10_000 for n in range(150)]
    assert pair.autopilot.receive() == []


def test_strangers_are_not_heard(pair):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(pair.state(3), (LOOPBACK, port_of(pair.autopilot)))
        pair.vehicle.send(pair.state(4))
        messages = arrived(pair.autopilot)
        assert read_state(messages, np.zeros(13), np.zeros(4)) == (40_000, 3)
        assert not select.select([pair.autopilot], [], [], 0.05)[0]


def test_a_peer_that_is_not_there_harms_nobody(pair):
    gone = pair.vehicle.getsockname()
    pair.vehicle.close()
    for _ in range(3):
        pair.autopilot.send(command_message(0, np.zeros(4)))
        assert pair.autopilot.receive() == []
    pair.vehicle = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    pair.vehicle.bind(gone)
    pair.autopilot.send(command_message(0, np.zeros(4)))
    pair.autopilot.send(command_message(0, np.zeros(4)))
    assert pair.vehicle.recv(4096)


def test_an_endpoint_listens_on_loopback_only(pair):
    assert pair.autopilot._socket.getsockname()[0] == LOOPBACK


def test_a_value_beyond_float32_is_not_sent(pair):
    """On the wire it would be infinite."""
    with pytest.raises(ValueError, match="a value that float32 cannot"):
        pair.autopilot.send(command_message(0, np.array([0.0, 1e39, 0.0, 0.0])))
