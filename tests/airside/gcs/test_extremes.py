"""Nothing from the ground ends an autopilot: all commands and all messages of the dialect with extreme numbers."""

from __future__ import annotations

import math
import socket
from contextlib import closing
from typing import Any

import numpy as np
import pytest

from ftcc.airside.gcs.commands import COMMANDS
from ftcc.airside.gcs.requests import MESSAGES
from ftcc.groundside.swarm.conversation import RefusedError
from ftcc.link.codec import Codec
from ftcc.link.mavlink import LOOPBACK
from tests.airside.gcs.in_flight import LEVEL, M, flying, said

EXTREMES = (
    0.0,
    1.0,
    -1.0,
    *(2.0**n for n in (15, 16, 31, 32)),
    1e10,
    -1e10,
    1e30,
    -1e30,
    math.nan,
    math.inf,
    -math.inf,
)
RANGES = {"int8_t": (-(2**7), 2**7 - 1), "uint8_t": (0, 2**8 - 1), "int16_t": (-(2**15), 2**15 - 1)}
RANGES |= {"uint16_t": (0, 2**16 - 1), "int32_t": (-(2**31), 2**31 - 1), "uint32_t": (0, 2**32 - 1)}
RANGES |= {"int64_t": (-(2**63), 2**63 - 1), "uint64_t": (0, 2**64 - 1)}

PAUSES = {M.MAV_CMD_DO_PAUSE_CONTINUE, M.MAV_CMD_NAV_LOITER_UNLIM, M.MAV_CMD_DO_REPOSITION}
"""Commands that have a follower hold, as they should: what they change is their meaning."""

AT_A_TIME = 100
"""Messages that the buffer of a socket holds with certainty."""


class Stranger:
    """Sends what no good client would, and counts what comes back."""

    def __init__(self, port: int) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setblocking(False)
        self.socket.connect((LOOPBACK, port))
        self.codec = Codec(255, 190)

    def send(self, message: Any) -> None:
        self.socket.send(message.pack(self.codec._mav))

    def acknowledged(self) -> list[int]:
        """The commands that have been answered."""
        found = []
        while True:
            try:
                datagram = self.socket.recv(4096)
            except BlockingIOError:
                return found
            found += [m.command for m in self.codec.parse(datagram) if m.get_type() == "COMMAND_ACK"]

    def close(self) -> None:
        self.socket.close()


def commands():
    """Every command that exists, with every extreme in one parameter and in all of them."""
    for number in M.enums["MAV_CMD"]:
        if number >= 2**16 or number in PAUSES:
            continue
        places = range(8) if number in COMMANDS else (7,)
        for value in EXTREMES:
            for place in places:
                given = [value if place in (n, 7) else 0.0 for n in range(7)]
                yield M.MAVLink_command_long_message(1, 1, number, 0, *given)
                whole = [round(max(-(2.0**31), min(2.0**31 - 1, v))) if math.isfinite(v) else 0 for v in given[4:6]]
                yield M.MAVLink_command_int_message(1, 1, 3, number, 0, 0, *given[:4], *whole, given[6])


def messages():
    """Every message of the dialect to UAV 1 with its fields at either end of their range, with nan and with inf."""
    for kind in M.mavlink_map.values():
        if kind.msgname in ("COMMAND_LONG", "COMMAND_INT"):
            continue
        for end in range(4):
            values = []
            lengths = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
            for name, type_ in zip(kind.fieldnames, kind.fieldtypes, strict=True):
                length = lengths[name]
                if name in ("target_system", "target_component"):
                    values.append(1)
                elif type_ == "char":
                    values.append((b"K11", b"\xff" * length, b"", b"FTCC_AT")[end][: max(1, length)])
                elif type_ in ("float", "double"):
                    value = (3.4e38, -3.4e38, math.nan, math.inf)[end]
                    values.append([value] * length if length else value)
                else:
                    value = RANGES[type_.removesuffix("_mavlink_version")][end % 2]
                    values.append([value] * length if length else value)
            yield kind(*values)


def flight(tmp_path, monkeypatch, sent, ticks):
    """The autopilot's commands at so many ticks while ``sent`` comes in; faults, answers, and parameters at the end."""
    with flying(tmp_path, monkeypatch) as (bench, station), closing(Stranger(bench.block.of(1).ground)) as stranger:
        station.set(1, "SYS_FAILURE_EN", 0)
        answers, controls = [], []
        for tick in range(1, ticks + 1):
            for message in sent[(tick - 1) * AT_A_TIME : tick * AT_A_TIME]:
                stranger.send(message)
            # What came before this question has been taken in when it is answered.
            assert station.get(1, "SYS_FAILURE_EN") == 0
            answers += stranger.acknowledged()
            while bench.launcher.poll(0.0):
                bench.launcher.recv()
            controls.append(bench.answer(tick, LEVEL, np.zeros(4)).copy())
        return np.array(controls), bench.process.gcs_links[0].errors, answers, station.parameters(1)


@pytest.mark.parametrize("make", [commands, messages])
def test_every_process_lives_and_the_flight_is_the_one_without(tmp_path, monkeypatch, make):
    sent = list(make())
    assert len(sent) > 800
    ticks = -(-len(sent) // AT_A_TIME)
    alone, _, _, parameters = flight(tmp_path / "alone", monkeypatch, [], ticks)
    beset, faults, answers, after = flight(tmp_path / "beset", monkeypatch, sent, ticks)
    assert not faults, "a handler that raises is a fault of ours"
    assert np.array_equal(alone, beset)
    assert after == parameters
    if make is commands:
        assert len(answers) == len(sent), "each is answered"


def test_an_interval_that_no_answer_could_carry_is_refused(station):
    for interval in (2147483648.0, 1e10, 1e30, math.inf, math.nan, -2.0, 0.5):
        with pytest.raises(RefusedError, match="interval: up to"):
            throw_interval(station, interval)
    for rate in (1e-30, 1e-9, 0.0005):
        with pytest.raises(RefusedError, match="at least"):
            station.set(1, "SR_ATTITUDE", rate)
    station.set(1, "SR_ATTITUDE", 0.001)
    station.command(1, M.MAV_CMD_GET_MESSAGE_INTERVAL, M.MAVLINK_MSG_ID_ATTITUDE)


def throw_interval(station, interval):
    """As `Conversation.command`, which would not send it."""
    question = M.MAVLink_command_long_message(
        1, 1, M.MAV_CMD_SET_MESSAGE_INTERVAL, 0, M.MAVLINK_MSG_ID_ATTITUDE, interval, *(math.nan,) * 5
    )
    station.texts[1] = []
    station._socket.sendto(question.pack(station._codec._mav), (LOOPBACK, station.card(1).port))
    station.get(1, "K11")
    if station.texts[1]:
        raise RefusedError(station.texts[1][-1])


def test_a_handler_that_raises_drops_its_message_is_told_once_and_the_flight_goes_on(bench, station, monkeypatch):
    def broken(link, peer, message):
        raise ZeroDivisionError("a fault of ours")

    monkeypatch.setitem(MESSAGES, "PING", MESSAGES["PING"]._replace(handle=broken))
    for n in range(5):
        station.send(1, M.MAVLink_ping_message(0, n, 0, 0))
    assert station.get(1, "K11") == 3.0
    bench.answer(1, LEVEL, np.zeros(4))
    assert bench.process.gcs_links[0].errors == {"PING": 5}
    told = [event for event in said(bench) if "PING" in event.text]
    assert [(event.severity, event.text) for event in told] == [
        ("error", "PING failed, a fault of this software: ZeroDivisionError('a fault of ours')")
    ]
