"""The ground station's receiver: it reads and refuses what pymavlink reads and refuses."""

from __future__ import annotations

import math
import random
import socket
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavutil

from ftcc.groundside.dashboard.snapshot import LinkState
from ftcc.groundside.swarm.monitor import Monitor
from ftcc.groundside.swarm.telemetry import ARRAY, HEARTBEAT, TelemetryMessage, TelemetrySocket
from ftcc.link.codec import Codec, dialect
from ftcc.link.flight_modes import MISSION, custom_mode
from ftcc.link.mavlink import float_array
from ftcc.link.signing import Signing
from ftcc.sim.plant import TRUTH
from ftcc.sim.plants import find
from ftcc.sim.process import truth_array

PLANT = "longitudinal"
NAMES = truth_array(PLANT)
SIGNALS = ("S1", "zhat")


@pytest.fixture
def receiver() -> Iterator[TelemetrySocket]:
    made = TelemetrySocket(0, ())
    yield made
    made.close()


@pytest.fixture
def pilot() -> Iterator[socket.socket]:
    """Where telemetry comes from."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind(("127.0.0.1", 0))
        yield link


@pytest.fixture
def station(pilot: socket.socket, tmp_path: Path) -> Iterator[Monitor]:
    """Receive UAVs 1 and 2 as systems 101 and 102."""
    made = Monitor(0, {pilot.getsockname()[1]}, (1, 2), PLANT, SIGNALS, tmp_path / "telemetry.tlog", id_offset=100)
    pilot.connect(made._socket._socket.getsockname())
    yield made
    made.close()


def as_pymavlink_reads(datagram: bytes) -> list[TelemetryMessage]:
    messages = []
    for message in Codec(254, 1).parse(datagram):
        read = TelemetryMessage(message.get_srcSystem(), message.get_msgId(), bytes(message.get_msgbuf()))
        if read.kind == HEARTBEAT:
            read = read._replace(values=(message.custom_mode,))
        if read.kind == ARRAY:
            read = read._replace(name=message.name, values=tuple(message.data))
        if hasattr(message, "time_boot_ms"):
            read = read._replace(stamp_us=message.time_boot_ms * 1000)
        if hasattr(message, "time_usec"):
            read = read._replace(stamp_us=message.time_usec)
        messages.append(read)
    return messages


def some_message(draw: random.Random) -> Any:
    """One of those that are read from the bytes, or another; now and then with zeros at its end."""
    stamp = draw.randrange(2**32)
    floats = [draw.choice((0.0, draw.uniform(-1e3, 1e3), draw.uniform(-3e38, 3e38))) for _ in range(58)]
    if draw.random() < 0.5:
        floats = floats[: draw.randrange(59)]
        floats += [0.0] * (58 - len(floats))
    name = draw.choice((b"truth", b"signals", b"links", b"", b"tenletters", b"a\0b", b"\xff"))
    return draw.choice(
        (
            dialect.MAVLink_heartbeat_message(1, 12, 129, draw.randrange(2**32), 4, 3),
            dialect.MAVLink_sys_status_message(1, 1, 1, 0, 65535, -1, 100, draw.randrange(9), 0, 0, 0, 0, 0),
            dialect.MAVLink_attitude_message(stamp, *floats[:6]),
            dialect.MAVLink_local_position_ned_message(stamp, *floats[6:12]),
            dialect.MAVLink_debug_float_array_message(stamp * 1000, name, draw.randrange(9), floats),
            dialect.MAVLink_statustext_message(4, b"stall"),
            dialect.MAVLink_vfr_hud_message(*floats[:2], 90, 50, *floats[2:4]),
            dialect.MAVLink_global_position_int_message(stamp, 473977000, -85456000, 1000000, 0, 3000, 0, 0, 9000),
            dialect.MAVLink_gps_raw_int_message(stamp * 1000, 3, 473977000, 85456000, 0, 100, 100, 3000, 0, 12),
            dialect.MAVLink_servo_output_raw_message(stamp, 0, *[1000 + draw.randrange(1000)] * 4, 0, 0, 0, 0),
        )
    )


def damaged(datagram: bytes, draw: random.Random) -> bytes:
    """The datagram, or one that is not perfect any more."""
    octets = bytearray(datagram)
    at = draw.randrange(len(octets))
    match draw.randrange(6):
        case 0:
            octets[at] = draw.randrange(256)
        case 1:
            del octets[at:]
        case 2:
            octets[at:at] = draw.randbytes(draw.randrange(1, 20))
        case 3:
            octets += draw.randbytes(draw.randrange(1, 20))
        case _:
            pass
    return bytes(octets)


def test_every_message_is_parsed_as_pymavlink_parses_it(receiver: TelemetrySocket) -> None:
    draw = random.Random(5)
    codecs = [Codec(system, 1) for system in (1, 7, 200)]
    for _ in range(3000):
        messages = [some_message(draw) for _ in range(draw.randrange(1, 5))]
        datagram = damaged(draw.choice(codecs).pack(*messages), draw)
        assert receiver.parse(datagram) == as_pymavlink_reads(datagram)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_value_that_is_not_finite_is_refused_and_its_neighbours_are_taken(
    receiver: TelemetrySocket, value: float
) -> None:
    datagram = Codec(1, 1).pack(float_array(10, "truth", [1.0, 2.0]), float_array(11, "signals", [3.0]))
    bad = bytearray(datagram)
    bad[30:34] = struct.pack("<f", value)  # the first number of the first message
    end = 10 + bad[1]
    bad[end : end + 2] = struct.pack("<H", dialect.x25crc(bytes(bad[1:end]) + b"\xe8").crc)
    assert [message.name for message in receiver.parse(bytes(bad))] == ["signals"]
    assert receiver.parse(bytes(bad)) == as_pymavlink_reads(bytes(bad))


def test_signed_and_old_messages_are_read_as_ever(receiver: TelemetrySocket, tmp_path: Path) -> None:
    message = float_array(10, "truth", [1.0, 2.0])
    signed = Codec(1, 1, Signing(b"k" * 32, tmp_path / "stamps.json")).pack(message)
    first = bytes(dialect.MAVLink_heartbeat_message(1, 12, 129, 7, 4, 3).pack(dialect.MAVLink(None, 3, 1), True))
    for datagram in (signed, first, first + signed):
        assert len(receiver.parse(datagram)) >= 1
        assert receiver.parse(datagram) == as_pymavlink_reads(datagram)


def test_frequent_messages_do_not_need_pymavlink(receiver: TelemetrySocket, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(receiver._codec, "parse", lambda _: pytest.fail("parsed"))
    state = [0.1] * 6
    datagram = Codec(5, 1).pack(
        dialect.MAVLink_attitude_message(1, *state),
        dialect.MAVLink_local_position_ned_message(1, *state),
        float_array(1000, "signals", [0.5] * 30),
        float_array(1000, "links", [2.0, 0.05, 7.0, 1.0, 0.0]),
        dialect.MAVLink_sys_status_message(1, 1, 1, 0, 65535, -1, 100, 0, 0, 0, 0, 0, 0),
        dialect.MAVLink_heartbeat_message(1, 12, 129, custom_mode(MISSION), 4, 3),
        dialect.MAVLink_global_position_int_message(1, 473977000, 85456000, 1000000, 0, 3000, 0, 0, 9000),
        dialect.MAVLink_gps_raw_int_message(1000, 3, 473977000, 85456000, 0, 100, 100, 3000, 0, 12),
        dialect.MAVLink_vfr_hud_message(30.0, 30.0, 90, 50, 1000.0, 0.0),
        dialect.MAVLink_servo_output_raw_message(1000, 0, 1500, 1500, 1500, 1200, 0, 0, 0, 0),
    )
    assert [message.system for message in receiver.parse(datagram)] == [5] * 10


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_display_that_is_not_finite_is_refused(receiver: TelemetrySocket, value: float) -> None:
    message = dialect.MAVLink_vfr_hud_message(30.0, value, 90, 50, 1000.0, 0.0)
    datagram = message.pack(dialect.MAVLink(None, 5, 1))
    assert receiver.parse(datagram) == as_pymavlink_reads(datagram) == []


def test_a_snapshot_holds_the_telemetry(station: Monitor, pilot: socket.socket) -> None:
    true = {name: float(i) for i, name in enumerate(NAMES)}
    pilot.send(Codec(101, 25).pack(float_array(2_500_000, "truth", list(true.values()))))
    assert not station.complete
    pilot.send(Codec(102, 25).pack(float_array(2_400_000, "truth", list(true.values()))))
    links = [2.0, 0.05, 7.0, 1.0, 0.0, 3.0, -1.0, 0.0, 0.0, 1.0]
    pilot.send(
        Codec(101, 1).pack(
            float_array(2_500_000, "signals", [0.5, 990.0]),
            float_array(2_500_000, "links", links),
            dialect.MAVLink_heartbeat_message(1, 12, 129, custom_mode(MISSION), 4, 3),
            dialect.MAVLink_statustext_message(4, b"not kept"),
        )
    )
    station.read()
    assert station.complete
    assert station.t == 2.5
    uavs = station.snapshot().uavs
    plant = find(PLANT)
    assert uavs[2].t == 2.4
    assert uavs[2].signals == {}
    assert uavs[2].links == {}
    one = uavs[1]
    assert dict(one.truth) == {name: true[name] for name in TRUTH}
    assert dict(one.command) == {name: true[f"{name}_command"] for name in plant.ACTUATORS}
    assert dict(one.acting) == {name: true[name] for name in plant.ACTUATORS}
    assert dict(one.effectiveness) == {name: true[f"{name}_effectiveness"] for name in plant.ACTUATORS}
    assert dict(one.bias) == {name: true[f"{name}_bias"] for name in plant.ACTUATORS}
    assert dict(one.disturbances) == {name: true[name] for name, _ in plant.DISTURBANCES}
    assert one.late == int(true["late"])
    assert one.signals == {"S1": 0.5, "zhat": 990.0}
    age = struct.unpack("<f", struct.pack("<f", 0.05))[0]
    assert one.links == {2: LinkState(age, 7, 1, False), 3: LinkState(math.inf, 0, 0, True)}
    assert one.mode == "mission"


def test_the_log_holds_the_messages_as_they_came(station: Monitor, pilot: socket.socket, tmp_path: Path) -> None:
    draw = random.Random(6)
    sent = [Codec(101, 1).pack(some_message(draw), some_message(draw)) for _ in range(50)]
    for datagram in sent:
        pilot.send(datagram)
        pilot.send(b"\xfd" + datagram[:7])
    station.read()
    station.close()
    logged = (tmp_path / "telemetry.tlog").read_bytes()
    frames = b""
    while logged:
        (stamp,), length = struct.unpack(">Q", logged[:8]), 12 + logged[9]
        assert stamp > 1.7e15
        frames, logged = frames + logged[8 : 8 + length], logged[8 + length :]
    assert frames == b"".join(sent)


def test_the_log_is_stamped_with_simulated_time_that_never_goes_back(pilot: socket.socket, tmp_path: Path) -> None:
    log = tmp_path / "stamped.tlog"
    station = Monitor(0, {pilot.getsockname()[1]}, (1, 2), PLANT, SIGNALS, log, started=1.8e9)
    pilot.connect(station._socket._socket.getsockname())
    state = [0.1] * 6
    # The second to last is of an earlier tick, the last is beyond every flight.
    for ms in (0, 40, 1000, 990, 2**32 - 1):
        heartbeat = dialect.MAVLink_heartbeat_message(1, 12, 129, custom_mode(MISSION), 4, 3)
        pilot.send(Codec(1, 1).pack(heartbeat, dialect.MAVLink_attitude_message(ms, *state)))
        station.read()
    station.close()
    read = mavutil.mavlink_connection(str(log))
    stamps = []
    while (message := read.recv_match(type=["HEARTBEAT", "ATTITUDE"])) is not None:
        stamps.append(message._timestamp - 1.8e9)
    assert stamps == pytest.approx([0.0, 0.0, 0.04, 0.04, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0], abs=1e-5)


def test_datagrams_from_other_ports_are_dropped(station: Monitor, tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(
            Codec(101, 25).pack(float_array(9, "truth", [1.0] * len(NAMES))), station._socket._socket.getsockname()
        )
        station.read()
    assert station.foreign_datagrams == 1
    assert station.snapshot().uavs == {}
    station.close()
    assert (tmp_path / "telemetry.tlog").read_bytes() == b""


def test_on_a_full_disk_the_log_ends_and_the_station_goes_on(pilot: socket.socket, tmp_path: Path) -> None:
    log = tmp_path / "telemetry.tlog"
    log.symlink_to("/dev/full")
    station = Monitor(0, {pilot.getsockname()[1]}, (1,), PLANT, SIGNALS, log)
    pilot.connect(station._socket._socket.getsockname())
    codec = Codec(1, 1)
    for n in range(200):
        pilot.send(codec.pack(float_array(10_000 * n, "truth", [1.0] * len(NAMES))))
        station.read()
    assert station.take_log_error() == "telemetry is no longer logged: No space left on device"
    assert station.take_log_error() == ""
    assert station.t == pytest.approx(1.99)
    station.close()
