"""Motion commands to a leader: in every frame, by every message, obeyed as a whole or refused with a text."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest

from ftcc.groundside.swarm.conversation import RefusedError
from ftcc.link.mavlink import LOOPBACK
from tests.airside.gcs.in_flight import LEVEL, M, ask, flying

HOME = 500.0
NOT_GIVEN = 2**31 - 1
ACCEPTED, DENIED = M.MAV_RESULT_ACCEPTED, M.MAV_RESULT_DENIED
NAN = math.nan
Z, SPEED = 0b1111_1111_1011, 0b1111_1111_0111
"""Type masks that leave everything else out."""


@pytest.fixture
def leader(tmp_path, monkeypatch):
    with flying(tmp_path, monkeypatch, uav=7, home=(47.0, 8.0, HOME)) as pair:
        yield pair


def commanded(bench):
    """Altitude and speed that the ground has commanded last; None if none."""
    rows = [row for row in bench.process.group.autopilots.profile_commands[0][-4:].tolist() if row[0] < math.inf]
    return tuple(rows[-1][1:]) if rows else None


def as_int(frame, command, p1, p2, p3, p4, x, y, z):
    return M.MAVLink_command_int_message(7, 1, frame, command, 0, 0, p1, p2, p3, p4, x, y, z)


def reposition_int(frame, x, y, z, speed=-1.0):
    return as_int(frame, M.MAV_CMD_DO_REPOSITION, speed, 1.0, 0.0, NAN, x, y, z)


@pytest.mark.parametrize("frame", range(21))
@pytest.mark.parametrize("place", [(NOT_GIVEN, NOT_GIVEN), (0, 0)])
def test_every_frame_of_a_reposition_means_what_it_says_or_is_refused(leader, frame, place):
    bench, station = leader
    ack = ask(station, reposition_int(frame, *place, 1510.0), "COMMAND_ACK")
    expected = {0: 1010.0, 5: 1010.0, 3: 1510.0, 6: 1510.0}
    if frame in (3, 6):
        # 510 m more: beyond what the followers can climb after.
        assert ack.result in (ACCEPTED, DENIED)
    elif frame in expected:
        assert ack.result == ACCEPTED
        assert commanded(bench) == (expected[frame], 30.0)
    else:
        assert ack.result == DENIED
        assert commanded(bench) is None


@pytest.mark.parametrize("frame", [3, 6])
def test_above_home_is_above_home(leader, frame):
    bench, station = leader
    assert ask(station, reposition_int(frame, NOT_GIVEN, NOT_GIVEN, 1005.0), "COMMAND_ACK").result == ACCEPTED
    assert commanded(bench) == (1005.0, 30.0)


@pytest.mark.parametrize("not_given", [NAN, 2147483648.0, 2147483647.0, 0.0])
def test_by_command_long_an_altitude_is_above_the_sea(leader, not_given):
    bench, station = leader
    ack = station.command(7, M.MAV_CMD_DO_REPOSITION, -1.0, 1.0, 0.0, NAN, not_given, not_given, 1510.0)
    assert ack.result == ACCEPTED
    assert commanded(bench) == (1010.0, 30.0)


@pytest.mark.parametrize(
    ("parameters", "why"),
    [
        ((-1.0, 0.0, 0.0, NAN, 47.1, 8.1, 1510.0), "only altitude and speed"),
        ((-1.0, 0.0, 0.0, NAN, 47.1, NAN, 1510.0), "only altitude and speed"),
        ((-1.0, 0.0, 50.0, NAN, NAN, NAN, 1510.0), "only altitude and speed"),
        ((-1.0, 0.0, 0.0, 1.5, NAN, NAN, 1510.0), "only altitude and speed"),
        ((-1.0, 0.0, 0.0, NAN, NAN, NAN, NAN), "neither an altitude nor a speed"),
        ((-1.0, 0.0, 0.0, NAN, NAN, NAN, 490.0), "below the ground"),
        ((-1.0, 0.0, 0.0, NAN, NAN, NAN, 1e6), "beyond 100 km"),
        ((70.0, 0.0, 0.0, NAN, NAN, NAN, NAN), "needs thrust"),
        ((31.0, 0.0, 0.0, NAN, NAN, NAN, NAN), "speed must be constant"),
    ],
)
def test_what_cannot_be_obeyed_as_a_whole_is_refused(leader, parameters, why):
    bench, station = leader
    with pytest.raises(RefusedError, match=f"denied: .*{why}"):
        station.command(7, M.MAV_CMD_DO_REPOSITION, *parameters)
    assert commanded(bench) is None


def test_a_speed_alone_is_taken_by_both_messages(leader):
    """The present one: the swarm's law lets no leader change its speed."""
    bench, station = leader
    assert station.command(7, M.MAV_CMD_DO_REPOSITION, 30.0, 0.0, 0.0, NAN, NAN, NAN, NAN).result == ACCEPTED
    assert commanded(bench) == (1000.0, 30.0)
    assert ask(station, reposition_int(0, NOT_GIVEN, NOT_GIVEN, NAN, 30.0), "COMMAND_ACK").result == ACCEPTED


def test_nothing_given_but_the_flag_is_a_pause(leader):
    _, station = leader
    station.command(7, M.MAV_CMD_DO_REPOSITION, -1.0, 1.0, 0.0, NAN, NAN, NAN, NAN)
    assert station.state(7).mode == "hold"


@pytest.mark.parametrize(("frame", "altitude"), [(0, 1510.0), (5, 1510.0), (3, 1010.0), (6, 1010.0)])
def test_change_altitude_takes_its_own_frame_by_both_messages(leader, frame, altitude):
    bench, station = leader
    for question in (
        M.MAVLink_command_long_message(7, 1, M.MAV_CMD_DO_CHANGE_ALTITUDE, 0, altitude, frame, NAN, NAN, NAN, NAN, NAN),
        as_int(2, M.MAV_CMD_DO_CHANGE_ALTITUDE, altitude, frame, NAN, NAN, NOT_GIVEN, NOT_GIVEN, NAN),
    ):
        assert ask(station, question, "COMMAND_ACK").result == ACCEPTED
        assert commanded(bench) == (1010.0, 30.0)


def test_change_altitude_in_another_frame_is_refused(leader):
    _, station = leader
    for frame in (1, 2, 4, 7, 8, 9, 10, 11, 20, NAN):
        with pytest.raises(RefusedError, match=r"frame .*: 0, 5 \(above sea\)"):
            station.command(7, M.MAV_CMD_DO_CHANGE_ALTITUDE, 1010.0, frame)


def test_the_present_mode_set_again_changes_nothing(leader):
    """Neither what was commanded in it, nor, in offboard, the time without targets."""
    bench, station = leader
    station.command(7, M.MAV_CMD_DO_CHANGE_ALTITUDE, 1010.0, 3)
    station.mode(7, "mission")
    assert commanded(bench) == (1010.0, 30.0)
    station.send(7, local(Z, z=-1010.0))
    station.mode(7, "offboard")
    ends = bench.process.gcs_links[0].services.offboard.next_us
    for tick in range(1, 51):
        bench.answer(tick, LEVEL, np.zeros(4))
    station.mode(7, "offboard")
    assert bench.process.gcs_links[0].services.offboard.next_us == ends


# Targets.


def local(mask, frame=1, x=0.0, y=0.0, z=0.0, v=(0.0, 0.0, 0.0), a=(0.0, 0.0, 0.0), yaw=0.0, rate=0.0):
    return M.MAVLink_set_position_target_local_ned_message(0, 7, 1, frame, mask, x, y, z, *v, *a, yaw, rate)


def worldwide(mask, frame, altitude, place=(NOT_GIVEN, NOT_GIVEN), v=(0.0, 0.0, 0.0)):
    return M.MAVLink_set_position_target_global_int_message(
        0, 7, 1, frame, mask, *place, altitude, *v, 0.0, 0.0, 0.0, 0.0, 0.0
    )


def throw(station, message):
    """Send what no good client would."""
    station._socket.sendto(message.pack(station._codec._mav), (LOOPBACK, station.card(7).port))


def offboard(station, message):
    """A target in offboard mode; the texts that it brings."""
    station.set(7, "COM_OF_LOSS_T", 0.0)
    station.send(7, local(Z, z=-1000.0))
    station.mode(7, "offboard")
    station.texts.clear()
    throw(station, message)
    station.request(7, M.MAVLINK_MSG_ID_HEARTBEAT)
    return station.texts.get(7, [])


OBEYED = {
    "an altitude": local(Z, z=-1010.0),
    "nan where nothing is asked": local(0, x=NAN, y=NAN, z=-1010.0, v=(NAN,) * 3, a=(NAN,) * 3, yaw=NAN, rate=NAN),
    "northward, level, steady, as it flies": local(Z & SPEED & 0b1100_0000_0011, z=-1010.0, v=(30.0, 0.0, 0.0)),
    "above the sea": worldwide(Z, 0, 1510.0),
    "above the sea, in integers": worldwide(Z, 5, 1510.0),
    "above home": worldwide(Z, 6, 1010.0),
    "a place that is not given": worldwide(Z & ~0b11, 3, 1010.0),
}


@pytest.mark.parametrize("name", OBEYED)
def test_a_target_that_is_obeyed(leader, name):
    bench, station = leader
    assert offboard(station, OBEYED[name]) == []
    assert commanded(bench)[0] == 1010.0


REFUSED = {
    "a place": (local(Z & ~0b11, z=-1010.0), "x, y: only altitude and vx"),
    "a place on earth": (worldwide(Z & ~0b11, 6, 1010.0, (470_000_000, 80_000_000)), "x, y: only altitude"),
    "sideways": (local(SPEED & ~0b10000, v=(30.0, 5.0, 0.0)), "vy: only altitude"),
    "a climb": (local(SPEED & ~0b100000, v=(30.0, 0.0, -1.0)), "vz: only altitude"),
    "an acceleration": (local(Z & ~0b1000000, z=-1010.0, a=(1.0, 0.0, 0.0)), "afx: only altitude"),
    "a heading": (local(Z & ~0b100_0000_0000, z=-1010.0, yaw=1.0), "yaw: only altitude"),
    "no motion": (local(SPEED, v=(0.0, 0.0, 0.0)), "speed 0 m/s"),
    "infinity": (local(Z, z=math.inf), "infinite"),
    "nothing": (local(0b1111_1111_1111), "neither altitude nor forward speed"),
    "below the ground": (local(Z, z=10.0), "below the ground"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_target_that_asks_for_more_is_refused_with_a_text(leader, name):
    bench, station = leader
    message, why = REFUSED[name]
    (text,) = offboard(station, message)
    assert why in text
    assert commanded(bench) is None


@pytest.mark.parametrize("frame", [n for n in range(21) if n != 1])
def test_a_local_target_in_another_frame_is_refused(leader, frame):
    bench, station = leader
    (text,) = offboard(station, local(Z, frame, z=-1010.0))
    assert text == f"target: frame {frame}: 1 (local NED)"
    assert commanded(bench) is None


@pytest.mark.parametrize("frame", [n for n in range(21) if n not in (0, 3, 5, 6)])
def test_a_global_target_in_another_frame_is_refused(leader, frame):
    bench, station = leader
    (text,) = offboard(station, worldwide(Z, frame, 1010.0))
    assert f"frame {frame}: 0, 5 (above sea) or 3, 6" in text
    assert commanded(bench) is None


def test_targets_of_the_wrong_kind_are_refused_with_a_text(leader):
    _, station = leader
    attitude = M.MAVLink_set_attitude_target_message(0, 7, 1, 0b111, (1.0, 0, 0, 0), 0, 0, 0, 0)
    assert offboard(station, attitude) == ["a leader takes positions, no attitudes"]


@pytest.mark.parametrize("kind", ["MISSION_ITEM", "MISSION_ITEM_INT"])
def test_an_item_of_a_mission_is_refused_whatever_its_numbers(leader, kind):
    _, station = leader
    send = getattr(M, f"MAVLink_{kind.lower()}_message")
    place = (0, 0) if kind == "MISSION_ITEM_INT" else (NAN, NAN)
    for frame in range(12):
        item = send(7, 1, 0, frame, M.MAV_CMD_NAV_WAYPOINT, 2, 1, NAN, NAN, NAN, NAN, *place, NAN)
        throw(station, item)
        end, acks = time.monotonic() + 5.0, []
        while not acks and time.monotonic() < end:
            acks = [m.type for m in station.receive(7, end) if m.get_type() == "MISSION_ACK"]
        assert acks == [M.MAV_MISSION_UNSUPPORTED]
