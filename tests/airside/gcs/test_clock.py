"""One clock: every time that leaves a UAV is simulated, and only SYSTEM_TIME knows of another."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from ftcc.airside.gcs.requests import MESSAGES
from ftcc.airside.gcs.streams import STREAMS
from ftcc.link.codec import Codec
from ftcc.link.flight_modes import HOLD, OFFBOARD
from tests.airside.gcs.in_flight import LEVEL, M, ask, flying, said

EPOCH = 1_700_000_000_000_000
OFFBOARD_MODE = (129, 6, 0)


@pytest.fixture
def both(tmp_path, monkeypatch):
    with flying(tmp_path, monkeypatch, epoch_us=EPOCH) as pair:
        yield pair


@pytest.fixture
def leader(tmp_path, monkeypatch):
    with flying(tmp_path, monkeypatch, uav=7) as pair:
        yield pair


def advance(bench, first, last):
    for tick in range(first, last + 1):
        bench.answer(tick, LEVEL, np.zeros(4))


def synchronized(station):
    """Simulated time by TIMESYNC, ns."""
    return ask(station, M.MAVLink_timesync_message(0, 42), "TIMESYNC").tc1


def test_timesync_system_time_and_all_stamps_are_one_clock(bench, station):
    for tick in (1, 25):
        advance(bench, tick, tick)
        now_ms = 10 * tick
        assert synchronized(station) == now_ms * 1_000_000
        for stream in STREAMS:
            message = station.request(1, stream.message)
            if hasattr(message, "time_boot_ms"):
                assert message.time_boot_ms == now_ms, message
            if hasattr(message, "time_usec"):
                assert message.time_usec == now_ms * 1000, message
        system_time = station.request(1, M.MAVLINK_MSG_ID_SYSTEM_TIME)
        assert system_time.time_unix_usec == EPOCH + now_ms * 1000


def test_the_clock_stands_while_the_flight_does(bench, station):
    advance(bench, 1, 3)
    before = synchronized(station), station.request(1, M.MAVLINK_MSG_ID_SYSTEM_TIME).time_unix_usec
    time.sleep(0.3)
    assert (synchronized(station), station.request(1, M.MAVLINK_MSG_ID_SYSTEM_TIME).time_unix_usec) == before


def test_before_the_first_tick_an_answer_is_no_question(tmp_path, monkeypatch):
    with flying(tmp_path, monkeypatch) as (_, station):
        assert synchronized(station) == 1


def test_after_fifty_days_the_32_bit_stamps_begin_anew_and_the_others_go_on(bench, station):
    """As documented: time_boot_ms and SERVO_OUTPUT_RAW's time_usec are uint32."""
    days = 50 * 86_400 * 1000
    view = replace(bench.process.gcs_links[0].view, done=np.array([days // 10]))  # ticks of 10 ms
    codec = Codec(1, 1)
    for stream in STREAMS:
        (message,) = codec.parse(codec.pack(stream.make(view)))
        if hasattr(message, "time_boot_ms"):
            assert message.time_boot_ms == days % 2**32 < days
        if hasattr(message, "time_usec"):
            stamp = days * 1000
            assert message.time_usec == (stamp % 2**32 if message.get_type() == "SERVO_OUTPUT_RAW" else stamp)


def target(station, altitude):
    """A leader's target, and nothing else asked."""
    return M.MAVLink_set_position_target_local_ned_message(0, 7, 1, 1, 0b1111_1111_1011, 0, 0, -altitude, *(0.0,) * 8)


def until(condition):
    end = time.monotonic() + 5.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)


def test_offboard_is_lost_after_so_much_simulated_time_however_long_the_flight_is_held(leader):
    bench, station = leader
    mode = bench.process.group.autopilots.mode
    station.set(7, "COM_OF_LOSS_T", 0.5)
    station.send(7, target(station, 1010.0))
    station.command(7, M.MAV_CMD_DO_SET_MODE, *OFFBOARD_MODE)
    station.send(7, target(station, 1010.0))
    advance(bench, 1, 20)
    time.sleep(1.0)
    advance(bench, 21, 50)
    assert mode[0] == OFFBOARD, "0.5 s after it was entered, at tick 1, are not over"
    advance(bench, 51, 51)
    until(lambda: mode[0] == HOLD)
    lost = [event.at_us for event in said(bench) if "becomes hold" in event.text]
    assert lost == [510_000]


def test_a_refused_target_is_complained_of_once_whatever_its_numbers(leader):
    _, station = leader
    station.send(7, target(station, 1010.0))
    station.command(7, M.MAV_CMD_DO_SET_MODE, *OFFBOARD_MODE)
    station.texts.clear()
    for n in range(50):
        station.send(7, target(station, -10.0 - n))
        station.send(7, target(station, -10.0 - n))
    station.request(7, M.MAVLINK_MSG_ID_HEARTBEAT)
    assert [text for text in station.texts[7] if "below the ground" in text] == [
        "altitude -10 m above home: below the ground"
    ]


def test_every_message_says_for_people_what_is_done_with_it():
    assert all(message.does for message in MESSAGES.values())
