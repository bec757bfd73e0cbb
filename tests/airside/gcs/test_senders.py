"""Who may speak with a UAV: computers on board with its own system id, many clients, clients that come and go."""

from __future__ import annotations

import socket
import time
from contextlib import ExitStack, closing

import numpy as np
import pytest

from ftcc.link.codec import Codec
from ftcc.link.mavlink import LOOPBACK
from tests.airside.gcs.in_flight import LEVEL, M, ask, said

ARM = M.MAVLink_command_long_message(1, 1, M.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1, 0, 0, 0, 0, 0, 0)


class Client:
    """Somebody with a socket of his own."""

    def __init__(self, port: int, system: int, component: int) -> None:
        self.codec = Codec(system, component)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.settimeout(2.0)
        self.socket.connect((LOOPBACK, port))
        self.heard = []

    def send(self, message) -> None:
        self.socket.send(self.codec.pack(message))

    def hear(self, kind: str):
        """The next message of a kind."""
        until = time.monotonic() + 5.0
        while time.monotonic() < until:
            while self.heard:
                message = self.heard.pop(0)
                if message.get_type() == kind:
                    return message
            self.heard += self.codec.parse(self.socket.recv(4096))
        raise AssertionError(f"no {kind}")

    def close(self) -> None:
        self.socket.close()


@pytest.fixture
def client(bench):
    with ExitStack() as stack:
        port = bench.block.of(1).ground
        yield lambda system=255, component=190: stack.enter_context(closing(Client(port, system, component)))


@pytest.mark.parametrize(("system", "component"), [(1, 191), (1, 195), (1, 240), (255, 190), (254, 190), (2, 1)])
def test_everybody_but_the_uav_itself_is_answered_and_addressed(client, system, component):
    one = client(system, component)
    one.send(ARM)
    ack = one.hear("COMMAND_ACK")
    assert (ack.result, ack.target_system, ack.target_component) == (M.MAV_RESULT_ACCEPTED, system, component)
    one.send(M.MAVLink_param_request_read_message(1, 1, b"K11", -1))
    assert one.hear("PARAM_VALUE").param_value == 3.0


def test_its_own_messages_that_come_back_are_left_alone(client, station):
    one = client(1, 1)
    one.send(ARM)
    one.socket.settimeout(0.3)
    with pytest.raises(TimeoutError):
        one.hear("COMMAND_ACK")
    assert station.get(1, "K11") == 3.0


def test_two_computers_of_one_id_at_two_addresses_are_both_answered(client):
    pair = [client(1, 191), client(1, 191)]
    for one in pair:
        one.send(ARM)
    for one in pair:
        assert one.hear("COMMAND_ACK").result == M.MAV_RESULT_ACCEPTED


def test_what_is_true_already_is_accepted_and_what_cannot_be_is_denied(station):
    M_ = M
    for command, *parameters in (
        (M_.MAV_CMD_COMPONENT_ARM_DISARM, 1.0),
        (M_.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, 2989.0),
        (M_.MAV_CMD_NAV_TAKEOFF, 0.0),
        (M_.MAV_CMD_DO_SET_MODE, 129, 4, 4),
        (M_.MAV_CMD_RUN_PREARM_CHECKS,),
    ):
        assert station.command(1, command, *parameters).result == M.MAV_RESULT_ACCEPTED
    for parameters, why in (((0.0,), "stays armed"), ((0.0, 21196.0), "stays armed"), ((2.0,), "1 = arm")):
        with pytest.raises(Exception, match=f"denied: .*{why}"):
            station.command(1, M.MAV_CMD_COMPONENT_ARM_DISARM, *parameters)


def test_a_ping_comes_back_to_who_sent_it(station):
    answer = ask(station, M.MAVLink_ping_message(12345, 7, 0, 0), "PING")
    assert (answer.time_usec, answer.seq, answer.target_system, answer.target_component) == (12345, 7, 254, 190)


def test_many_clients_are_answered_and_streamed_to_as_they_come(bench, client):
    """Twelve at a time, then twelve more on new ports while the first ones are still remembered."""
    tick = 0
    for _ in range(2):
        clients = [client(255, n + 1) for n in range(12)]
        for one in clients:
            one.send(ARM)
            assert one.hear("COMMAND_ACK").target_component == one.codec._mav.srcComponent
        for _ in range(20):
            tick += 1
            bench.answer(tick, LEVEL, np.zeros(4))
        for one in clients:
            one.hear("ATTITUDE")


def test_who_finds_no_place_is_answered_and_told_so(bench, client):
    talking = [client(255, n + 1) for n in range(32)]
    for one in talking:
        one.send(ARM)
    for one in talking:
        one.hear("COMMAND_ACK")
    late = client(254, 1)
    late.send(ARM)
    assert late.hear("STATUSTEXT").text.startswith("too many clients")
    assert late.hear("COMMAND_ACK").result == M.MAV_RESULT_ACCEPTED
    assert any("too many clients" in event.text for event in said(bench))


def test_a_parameter_list_is_complete_after_three_rounds_with_a_tenth_lost(client):
    random = np.random.default_rng(1)
    one = client()
    found, count = set(), 1
    for _ in range(3):
        one.send(M.MAVLink_param_request_list_message(1, 1))
        while True:
            value = one.hear("PARAM_VALUE")
            count = value.param_count
            if random.random() >= 0.1:
                found.add(value.param_index)
            if value.param_index == count - 1:
                break
    assert found == set(range(count))
