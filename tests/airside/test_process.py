"""The autopilot process as its vehicle meets it."""

from __future__ import annotations

import math
import select
import time
from collections.abc import Iterator

import numpy as np
import pytest

from ftcc.link.mavlink import dialect, float_array
from ftcc.link.waiting import DATAGRAM
from tests.airside.autopilot_bench import Bench, forged
from tests.support.pymavlink_wire import read_command, state_messages

LEVEL = forged(1000.0, 30.0, 0.0, 0.0322, 0.0)


@pytest.fixture(params=[True, False], ids=["lockstep", "real time"])
def bench(request, tmp_path, monkeypatch) -> Iterator[Bench]:
    """On the ground, in either clock: nothing flies unless entered."""
    monkeypatch.setenv("FTCC_RUNTIME_DIR", str(tmp_path / "runtime"))
    one = Bench(tmp_path, 9, lockstep=request.param)
    yield one
    one.close()


def state(tick: int) -> tuple[object, ...]:
    return state_messages(tick * 10_000, LEVEL, np.zeros(4))


def taken(bench: Bench) -> list[int]:
    """Ticks of the states that the process takes in, one after the other, until its socket is empty."""
    process, ticks = bench.process, []
    while select.select([process.vehicles[0]], [], [], 0.05)[0]:
        if process.flight.listen(process.group, process.timing) == DATAGRAM:
            process.read_datagram()
        if process.group.pending[0] >= 0:
            ticks.append(int(process.group.pending[0]))
            process.group.done[0], process.group.pending[0] = process.group.pending[0], -1
    return ticks


def test_states_are_taken_in_order_and_once(bench):
    for tick in (0, 1, 1, 0, 2):
        bench.vehicle.send(*state(tick))
    assert taken(bench) == [0, 1, 2]


def test_another_message_in_front_of_a_state_swallows_nothing_of_it(bench):
    bench.vehicle.send(float_array(0, "other", [1.0]))
    bench.vehicle.send(*state(0))
    bench.vehicle.send(float_array(0, "other", [1.0]), *state(1))
    assert taken(bench) == [0, 1]


def test_a_state_of_which_a_part_was_dropped_does_not_shift_those_after_it(bench):
    """One of the three messages holds nan and never passes: that state is incomplete, the next is whole."""
    attitude, position, force = state(0)
    position.x = math.nan
    data = b"".join(message.pack(bench.vehicle.codec._mav) for message in (attitude, position, force))
    bench.vehicle._socket.send(data)
    bench.vehicle.send(*state(1))
    bench.vehicle.send(*state(2))
    assert taken(bench) == [1, 2]


def test_an_autopilot_whose_aircraft_is_lost_answers_the_states_before_that_and_ends(bench):
    lost = dialect.MAVLink_heartbeat_message(
        dialect.MAV_TYPE_FIXED_WING, dialect.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_FLIGHT_TERMINATION, 3
    )
    for tick in range(3):
        bench.vehicle.send(*state(tick))
    bench.vehicle.send(lost)
    with bench:
        until = time.monotonic() + 10.0
        while bench.process.group.alive.any() and time.monotonic() < until:
            time.sleep(0.001)
        assert not bench.process.group.alive.any(), "nobody need stop it"
    stamps = [read_command(message, np.zeros(4)) for message in bench.vehicle.receive()]
    assert list(dict.fromkeys(stamps)) == [0, 10_000, 20_000]


def test_every_state_is_answered_with_its_own_stamp_and_a_repeated_one_once_more(bench):
    """A datagram may be lost on either way: the same state gets the same answer, not another step of the law."""
    with bench:
        first = bench.answer(0, LEVEL, np.zeros(4))
        assert np.array_equal(bench.answer(0, LEVEL, np.zeros(4)), first)
        for tick in range(1, 10):
            bench.answer(tick, LEVEL, np.zeros(4))
    message = None
    while messages := bench.vehicle.receive():
        message = messages[-1]
    assert message is None or read_command(message, np.zeros(4)) <= 90_000
