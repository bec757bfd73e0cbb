"""Datagrams go through two relays as they would by loopback, with the ports that both ends expect."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import pytest

from ftcc.groundside.nodes.relay import GROUND, LISTENER, PAIR, STATION, Relay, route_of
from tests.support.ports import free_port

HERE = "127.0.0.1"


def bound(port: int = 0) -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.bind((HERE, port))
    made.settimeout(5.0)
    return made


@pytest.fixture
def relays() -> Iterator[tuple[Relay, Relay]]:
    """Two ends, linked directly."""
    ends: list[Relay] = []
    ends += [Relay(lambda data: ends[1].deliver(data)), Relay(lambda data: ends[0].deliver(data))]
    yield ends[0], ends[1]
    for end in ends:
        end.close()


def test_two_callers_get_their_own_answers(relays: tuple[Relay, Relay]) -> None:
    here, there = relays
    with bound() as autopilot, bound() as one, bound() as other:
        port = here.add_entrance(GROUND, 3)
        there.add_exit(GROUND, 3, autopilot.getsockname())
        here.start()
        there.start()
        for caller, text in ((one, b"one"), (other, b"other")):
            caller.sendto(text, (HERE, port))
            question, sender = autopilot.recvfrom(100)
            assert question == text
            autopilot.sendto(text + b"!", sender)
        assert one.recvfrom(100) == (b"one!", (HERE, port))
        assert other.recvfrom(100) == (b"other!", (HERE, port))


def test_a_pair_sees_the_ports_of_its_partner(relays: tuple[Relay, Relay]) -> None:
    here, there = relays
    vehicle_there, autopilot_here = free_port(), free_port()
    with bound() as vehicle, bound() as autopilot:
        here.add_entrance(PAIR, 1, autopilot_here, {vehicle.getsockname()[1]: 0})
        there.add_exit(PAIR, 1, autopilot.getsockname(), {0: vehicle_there})
        here.start()
        there.start()
        vehicle.sendto(b"state", (HERE, autopilot_here))
        assert autopilot.recvfrom(100) == (b"state", (HERE, vehicle_there))
        autopilot.sendto(b"command", (HERE, vehicle_there))
        assert vehicle.recvfrom(100) == (b"command", (HERE, autopilot_here))


def test_a_stranger_at_a_port_of_the_station_is_not_heard(relays: tuple[Relay, Relay]) -> None:
    here, there = relays
    with bound() as known, bound() as stranger, bound() as station:
        source = free_port()
        port = here.add_entrance(STATION, 0, 0, {known.getsockname()[1]: 7})
        there.add_exit(STATION, 0, station.getsockname(), {7: source})
        here.start()
        there.start()
        stranger.sendto(b"forged", (HERE, port))
        known.sendto(b"telemetry", (HERE, port))
        assert station.recvfrom(100) == (b"telemetry", (HERE, source))


def test_what_belongs_nowhere_is_known(relays: tuple[Relay, Relay]) -> None:
    here, _ = relays
    assert not here.deliver(b"")
    assert not here.deliver(b"\x02\x01\x00\x00\x00datagram")
    assert route_of(b"\x02\x01") is None
    assert route_of(b"\x02\x01\x00\x00\x00datagram") == (LISTENER, 1)
