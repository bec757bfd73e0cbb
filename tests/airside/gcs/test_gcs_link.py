"""An autopilot as a ground station meets it: every question answered, every command obeyed or refused with a reason."""

from __future__ import annotations

import math
import select
import socket
import time
from contextlib import closing
from typing import Any

import numpy as np
import pytest

from ftcc.airside.gcs.commands import COMMANDS
from ftcc.airside.gcs.requests import MESSAGES
from ftcc.airside.gcs.streams import STREAMS
from ftcc.airside.schemes import find
from ftcc.groundside.swarm.conversation import NoAnswerError, RefusedError
from ftcc.groundside.swarm.registry import Entry, VehicleEntry
from ftcc.groundside.swarm.station import Station
from ftcc.link.codec import Codec
from ftcc.link.failures import failure_answer, read_failure
from ftcc.link.flight_modes import HOLD, MISSION
from ftcc.link.mavlink import LOOPBACK
from tests.airside.autopilot_bench import Bench
from tests.airside.gcs.in_flight import LEVEL, M, ask, said
from tests.support.pymavlink_wire import state_messages

# Questions.


@pytest.mark.parametrize(
    "message",
    [M.MAVLINK_MSG_ID_HEARTBEAT, M.MAVLINK_MSG_ID_AUTOPILOT_VERSION, M.MAVLINK_MSG_ID_HOME_POSITION]
    + [stream.message for stream in STREAMS],
)
def test_every_message_that_it_sends_can_be_asked_for(station, message):
    assert station.request(1, message).get_srcSystem() == 1


def test_what_a_ground_station_asks_at_connection_is_answered(station):
    mission = ask(station, M.MAVLink_mission_request_list_message(1, 1, 0), "MISSION_COUNT")
    assert mission.count == 0
    assert ask(station, M.MAVLink_mission_request_int_message(1, 1, 0, 0), "MISSION_ACK").type == 13
    assert ask(station, M.MAVLink_mission_count_message(1, 1, 3, 0), "MISSION_ACK").type == 3
    sync = ask(station, M.MAVLink_timesync_message(0, 12345), "TIMESYNC")
    assert (sync.ts1, sync.tc1 > 0) == (12345, True)
    assert ask(station, M.MAVLink_log_request_list_message(1, 1, 0, 100), "LOG_ENTRY").num_logs == 0
    listing = M.MAVLink_file_transfer_protocol_message(0, 1, 1, [7, 0, 0, 3] + [0] * 247)
    files = ask(station, listing, "FILE_TRANSFER_PROTOCOL")
    assert list(files.payload[:6]) == [8, 0, 0, 129, 1, 3]
    for request, error in ((3, 6), (4, 10), (15, 10), (7, 7)):
        question = M.MAVLink_file_transfer_protocol_message(0, 1, 1, [7, 0, 0, request] + [0] * 247)
        assert ask(station, question, "FILE_TRANSFER_PROTOCOL").payload[12] == error


@pytest.mark.parametrize("command", [M.MAV_CMD_DO_JUMP, M.MAV_CMD_REQUEST_CAMERA_INFORMATION, M.MAV_CMD_LOGGING_START])
def test_an_unknown_command_is_unsupported(station, command):
    with pytest.raises(RefusedError, match="unsupported"):
        station.command(1, command)


@pytest.mark.parametrize(
    ("command", "why"),
    [
        (M.MAV_CMD_NAV_LAND, "does not land"),
        (M.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, "not in the air"),
    ],
)
def test_what_makes_no_sense_in_the_air_is_denied_with_the_reason(station, command, why):
    with pytest.raises(RefusedError, match=f"denied: .*{why}"):
        station.command(1, command, 1)


def test_commands_to_other_systems_and_components_are_left_alone(station):
    for system, component in ((2, 1), (1, 100)):
        other = M.MAVLink_command_long_message(system, component, M.MAV_CMD_REQUEST_MESSAGE, 0, 148, 0, 0, 0, 0, 0, 0)
        with pytest.raises(NoAnswerError):
            ask(station, other, "COMMAND_ACK")


def test_streams_flow_at_the_rates_that_are_asked_for(bench, station):
    station.command(1, M.MAV_CMD_SET_MESSAGE_INTERVAL, M.MAVLINK_MSG_ID_ATTITUDE, 50_000)
    station.command(1, M.MAV_CMD_GET_MESSAGE_INTERVAL, M.MAVLINK_MSG_ID_ATTITUDE)
    for n in [n for n, stream in enumerate(STREAMS) if stream.name not in ("ATTITUDE", "BELIEFS", "TRUST")]:
        station.set(1, f"SR_{STREAMS[n].name}", 0.0)
    station.command(1, M.MAV_CMD_SET_MESSAGE_INTERVAL, M.MAVLINK_MSG_ID_VFR_HUD, -1)
    for tick in range(1, 101):  # a second of simulated time in at least a second of wall time
        bench.answer(tick, LEVEL, np.zeros(4))
        time.sleep(0.01)
    stamps = []
    while messages := station.receive(1, time.monotonic() + 0.05):
        stamps += [m.time_boot_ms for m in messages if m.get_type() == "ATTITUDE"]
        assert not [m for m in messages if m.get_type() == "VFR_HUD"]
    # At 20 Hz of simulated time, but for a tick by which the wall clock may be behind.
    assert len(stamps) in (19, 20, 21)
    assert set(np.diff(stamps)) <= {40, 50, 60}


# Parameters.


def test_all_parameters_are_listed_gains_and_sizes_among_them(station):
    values = station.parameters(1)
    assert values["K11"] == 3.0
    assert values["FAIL_EFF"] == 0.5
    assert values["SYS_FAILURE_EN"] == 1
    assert values["CH_LOSS"] == 0.0
    assert {"SYS_AUTOSTART", "COM_RC_IN_MODE", "CAL_GYRO0_ID", "CAL_ACC0_ID", "CAL_MAG0_ID"} <= set(values)
    assert all(len(name) <= 16 for name in values)


def test_a_value_that_was_typed_is_the_value_in_force(bench, station):
    assert station.set(1, "k11", 3.3) == 3.3
    assert bench.process.group.autopilots.gains[0, 0] == 3.3
    assert station.set(1, "ch_loss", 0.3) == 0.3
    assert bench.process.group.inbox.quality[0, :2, 0].tolist() == [0.3, 0.3]


@pytest.mark.parametrize(
    ("name", "value", "why"),
    [
        ("K11", -1.0, "0 to 10000"),
        ("SUBSTEPS", 1.5, "whole number"),
        ("CH_LOSS", 1.5, "0 to 1"),
        ("CH_DELAY", 3.0, "exchange periods"),
        ("SYS_FAILURE_EN", 2, "0 to 1"),
        ("SYS_AUTOSTART", 4001, "2100 to 2100"),
    ],
)
def test_a_refused_value_leaves_the_one_in_force(bench, station, name, value, why):
    before = station.get(1, name)
    with pytest.raises(RefusedError, match=f"refused: .*{why}"):
        station.set(1, name, value)
    assert station.get(1, name) == before
    assert any(event.outcome == "denied" and name in event.text for event in said(bench))


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_gain_is_never_nan(bench, station, value):
    station.send(1, M.MAVLink_param_set_message(1, 1, b"K11", value, M.MAV_PARAM_TYPE_REAL32))
    assert station.get(1, "K11") == 3.0
    assert np.isfinite(bench.process.group.autopilots.gains).all()


def test_a_parameter_that_does_not_exist_is_refused(station):
    with pytest.raises(RefusedError, match="no parameter NOTHING"):
        station.get(1, "NOTHING")


def test_a_change_is_logged_with_who_and_what(bench, station):
    station.set(1, "K11", 3.5)
    station.set(1, "K11", 3.5)
    events = [event for event in said(bench) if "K11" in event.text]
    assert [(e.text, e.who, e.outcome, e.uav) for e in events] == [
        ("parameter K11 = 3.5 (was 3)", "254/190", "accepted", 1)
    ]


def test_fault_tolerance_off_flies_the_gains_of_the_switch_and_on_the_former_ones(bench, station):
    names = find("containment").gains_type._fields
    observers = names.index("observers")
    station.fault_tolerance(1, False)
    assert bench.process.group.autopilots.gains[0, observers] == 0.0
    station.set(1, "K11", 3.5)
    station.fault_tolerance(1, True)
    assert bench.process.group.autopilots.gains[0, observers] == 1.0
    assert bench.process.group.autopilots.gains[0, 0] == 3.5


# Failures.


class Vehicle:
    """Answers injections as a vehicle does; what it was asked."""

    def __init__(self, bench: Bench, result: int = M.MAV_RESULT_ACCEPTED) -> None:
        self.asked: list[tuple[Any, int]] = []
        self._bench = bench
        self._result = result

    def attend(self) -> None:
        select.select([self._bench.vehicle], [], [], 0.05)
        messages = self._bench.vehicle.receive()
        for n in range(len(messages)):
            failure, at_us = read_failure(messages[n : n + 2])
            if failure is not None:
                self.asked.append((failure, at_us))
                self._bench.vehicle.send(failure_answer(1, self._result, at_us or 20_000))


def inject(station: Station, vehicle: Vehicle | None, *parameters: float) -> Any:
    """MAV_CMD_INJECT_FAILURE; the COMMAND_ACK."""
    request = M.MAVLink_command_long_message(
        1, 1, M.MAV_CMD_INJECT_FAILURE, 0, *parameters, math.nan, math.nan, math.nan, math.nan
    )
    station.send(1, request)
    until = time.monotonic() + 2.0
    while time.monotonic() < until:
        if vehicle is not None:
            vehicle.attend()
        for message in station.receive(1, time.monotonic() + 0.02):
            if message.get_type() == "COMMAND_ACK":
                return message
    raise AssertionError("no COMMAND_ACK")


ELEVATOR_WRONG = (M.FAILURE_UNIT_SYSTEM_SERVO, M.FAILURE_TYPE_WRONG, 2)


def test_a_fault_goes_to_the_vehicle_and_its_answer_to_the_ground(bench, station):
    vehicle = Vehicle(bench)
    station.set(1, "FAIL_EFF", 0.7)
    station.set(1, "FTCC_AT", 5000)
    ack = inject(station, vehicle, *ELEVATOR_WRONG)
    assert (ack.result, ack.result_param2) == (M.MAV_RESULT_ACCEPTED, 5000)
    ((failure, at_us),) = vehicle.asked
    assert (failure.instance, failure.sizes["FAIL_EFF"], at_us) == (2, 0.7, 5_000_000)
    assert any(event.outcome == "armed" for event in said(bench))


@pytest.mark.parametrize("instance", [1, 3])
def test_a_part_that_this_aircraft_has_not_is_refused_with_those_that_it_has(bench, station, instance):
    vehicle = Vehicle(bench)
    ack = inject(station, vehicle, M.FAILURE_UNIT_SYSTEM_SERVO, M.FAILURE_TYPE_WRONG, instance)
    assert ack.result == M.MAV_RESULT_UNSUPPORTED
    assert vehicle.asked == []
    with pytest.raises(RefusedError, match="no aileron: it has elevator, thrust"):
        station.fault(1, "aileron", eff=0.5)


def test_a_fault_that_leaves_no_trim_is_warned_of(bench, station):
    station.set(1, "FAIL_BIAS", 0.6)
    assert inject(station, Vehicle(bench), *ELEVATOR_WRONG).result == M.MAV_RESULT_ACCEPTED
    assert any("no trim" in event.text for event in said(bench))
    station.receive(1, time.monotonic() + 0.1)
    assert any("no trim" in text for text in station.texts[1])


def test_a_vehicle_that_refuses_or_is_silent_is_told_to_the_ground(bench, station):
    refusing = Vehicle(bench, M.MAV_RESULT_UNSUPPORTED)
    assert inject(station, refusing, *ELEVATOR_WRONG).result == M.MAV_RESULT_UNSUPPORTED
    begun = time.monotonic()
    assert inject(station, None, *ELEVATOR_WRONG).result == M.MAV_RESULT_FAILED
    assert 0.2 <= time.monotonic() - begun < 1.0


def test_the_past_what_is_unknown_and_what_is_switched_off_is_refused(bench, station):
    vehicle = Vehicle(bench)
    assert inject(station, vehicle, M.FAILURE_UNIT_SYSTEM_BATTERY, 1, 1).result == M.MAV_RESULT_UNSUPPORTED
    assert inject(station, vehicle, math.nan, math.nan, math.nan).result == M.MAV_RESULT_UNSUPPORTED
    for tick in range(1, 4):
        bench.answer(tick, LEVEL, np.zeros(4))
    station.set(1, "FTCC_AT", 20)
    assert inject(station, vehicle, *ELEVATOR_WRONG).result == M.MAV_RESULT_DENIED
    station.set(1, "FTCC_AT", 0)
    station.set(1, "SYS_FAILURE_EN", 0)
    assert inject(station, vehicle, *ELEVATOR_WRONG).result == M.MAV_RESULT_DENIED
    assert vehicle.asked == []


def test_a_repeated_command_is_answered_as_before_and_obeyed_once(bench, station):
    vehicle = Vehicle(bench)
    assert inject(station, vehicle, *ELEVATOR_WRONG).result == M.MAV_RESULT_ACCEPTED
    parameters = (*ELEVATOR_WRONG, math.nan, math.nan, math.nan, math.nan)
    again = M.MAVLink_command_long_message(1, 1, M.MAV_CMD_INJECT_FAILURE, 1, *parameters)
    assert ask(station, again, "COMMAND_ACK").result == M.MAV_RESULT_ACCEPTED
    vehicle.attend()
    assert len(vehicle.asked) == 1


def test_links_are_cut_degraded_and_restored_at_their_time(bench, station):
    quality = bench.process.group.inbox.quality[0]
    station.inject(1, "radio", "off", 2)
    station.inject(1, "radio", "intermittent", 6, loss=0.4)
    station.inject(1, "radio", "delayed", 6, delay=0.2)
    assert quality[0, 6] == 0.0
    bench.answer(1, LEVEL, np.zeros(4))
    assert quality[0].tolist()[:2] == [0.0, 0.0]
    assert quality[0, 6] == 1.0
    assert (quality[1, 0], quality[1, 4], quality[1, 6]) == (0.4, 0.2, 0.0)
    station.inject(1, "radio", "ok", 2, at=0.03)
    bench.answer(2, LEVEL, np.zeros(4))
    assert quality[0, 6] == 1.0
    bench.answer(3, LEVEL, np.zeros(4))
    assert quality[0, 6] == 0.0
    with pytest.raises(RefusedError, match="does not hear UAV 5"):
        station.inject(1, "radio", "off", 5)


def test_the_own_radio_is_switched_off_and_on(bench, station):
    station.cut(1)
    bench.answer(1, LEVEL, np.zeros(4))
    assert bench.process.group.link_events.radio_on[0] == 0
    station.restore(1)
    bench.answer(2, LEVEL, np.zeros(4))
    assert bench.process.group.link_events.radio_on[0] == 1


# Modes.


def test_hold_ignores_the_neighbours_and_mission_hears_them_again(bench, station):
    station.mode(1, "hold")
    assert bench.process.group.autopilots.mode[0] == HOLD
    assert station.state(1).mode == "hold"
    station.mode(1, "mission")
    assert bench.process.group.autopilots.mode[0] == MISSION


def test_a_follower_of_leaders_takes_no_targets_and_is_no_leader(station):
    with pytest.raises(RefusedError, match="takes no targets"):
        station.mode(1, "offboard")
    with pytest.raises(RefusedError, match="a follower follows"):
        station.lead(1, altitude=1010.0)


@pytest.mark.parametrize("pair", [(1, 0), (4, 5), (math.nan, math.nan)])
def test_modes_that_mean_nothing_here_are_denied(station, pair):
    with pytest.raises(RefusedError, match="denied"):
        station.command(1, M.MAV_CMD_DO_SET_MODE, 129, *pair)


# Signed and hostile.


def test_a_state_is_answered_whatever_strangers_send(bench, station):
    """Random bytes and messages with random contents to the port that hears everybody: the tick does not mind."""
    random = np.random.default_rng(1)
    gains = bench.process.group.autopilots.gains.copy()
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as stranger:
        for tick in range(1, 51):
            for _ in range(20):
                good = bytearray(Codec(255, 190).pack(M.MAVLink_command_long_message(1, 1, 420, 0, *random.random(7))))
                good[int(random.integers(len(good)))] ^= int(random.integers(1, 256))
                noise = random.bytes(int(random.integers(1, 300)))
                stranger.sendto(bytes(good) if random.random() < 0.5 else noise, (LOOPBACK, bench.block.of(1).ground))
            bench.answer(tick, LEVEL, np.zeros(4))
    assert station.get(1, "K11") == 3.0
    assert np.array_equal(bench.process.group.autopilots.gains, gains)
    assert bench.process.gcs_links[0].dropped()["bad_data"] > 500


def anything(random: np.random.Generator, kind: Any) -> Any:
    """A valid message of a kind to UAV 1 with random contents: every bit pattern, nan and infinity among them."""
    values = []
    for name, type_, length in zip(kind.fieldnames, kind.fieldtypes, array_lengths(kind), strict=True):
        if name in ("target_system", "target_component"):
            values.append(1)
        elif type_ == "char":
            values.append(random.bytes(length))
        else:
            bits = {"float": "<f4", "double": "<f8", "int8_t": "<i1", "uint8_t": "<u1", "int16_t": "<i2"}
            bits |= {"uint16_t": "<u2", "int32_t": "<i4", "uint32_t": "<u4", "int64_t": "<i8", "uint64_t": "<u8"}
            code = np.dtype(bits[type_])
            drawn = np.frombuffer(random.bytes(code.itemsize * max(1, length)), code).tolist()
            values.append(drawn if length else drawn[0])
    return kind(*values)


def array_lengths(kind: Any) -> list[int]:
    """Of the fields of a kind of message, in the order of their names."""
    by_name = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
    return [by_name[name] for name in kind.fieldnames]


def test_valid_messages_with_any_contents_are_survived(bench, station):
    random = np.random.default_rng(1)
    kinds = [kind for kind in M.mavlink_map.values() if kind.msgname in MESSAGES]
    assert len(kinds) == len(MESSAGES)
    commands = list(COMMANDS)
    for n in range(2000):
        message = anything(random, kinds[n % len(kinds)])
        if "command" in message.fieldnames and random.random() < 0.8:
            message.command = commands[int(random.integers(len(commands)))]
        station._socket.sendto(message.pack(station._codec._mav), (LOOPBACK, bench.block.of(1).ground))
        if n % 20 == 0:
            bench.answer(n // 20 + 1, LEVEL, np.zeros(4))
    assert station.state(1).uav == 1
    for array in (
        bench.process.group.autopilots.gains,
        bench.process.group.inbox.quality,
        bench.process.group.controls,
    ):
        assert np.isfinite(array).all()


def test_before_the_first_state_it_answers_too(tmp_path, monkeypatch):
    monkeypatch.setenv("FTCC_RUNTIME_DIR", str(tmp_path / "runtime"))
    with closing(Bench(tmp_path, 9)) as alone, alone as bench:
        card = VehicleEntry(1, 1, "follower", bench.block.of(1).ground, ())
        with Station(Entry("bench", 1, "", "", (card,), None, (0, 0), None, 0.0), timeout=0.5) as station:
            assert station.state(1).t == 0.0
        bench.vehicle.send(*state_messages(0, LEVEL, np.zeros(4)))
