"""The arithmetic of time: a command computed from state k acts from tick k+1 on, in one process and between two."""

from __future__ import annotations

import threading
import time
from multiprocessing import Pipe

import numpy as np
import pytest

from ftcc.link.actuators import ELEVATOR, THRUST
from ftcc.link.gate import Ended, Gate, Go, Limit, Pace, Release
from ftcc.link.mavlink import AUTOPILOT, LOOPBACK, STATION, Endpoint
from ftcc.link.ports import reserve
from ftcc.link.process import Setting
from ftcc.sim.build import build_fleet
from ftcc.sim.plant import TRUTH
from ftcc.sim.plants import cycle_of
from ftcc.sim.process import Vehicles
from tests.support.pymavlink_wire import command_message, read_state
from tests.support.swarm import TRIM, Swarm, timing, vehicle

START = {1: (29.5, 0.0, 1000.5, 0.01, 0.05, 0.02), 4: (30.5, 0.0, 999.7, 0.0, 0.02, 0.0)}
"""Away from equilibrium, so that every command differs from the one before."""

FOLLOWERS = slice(0, 6)


def commanded(flight: Swarm) -> np.ndarray:
    """Elevator and thrust that the laws computed at each tick, within the limits, shape (rows, 6, 2)."""
    elevator = np.clip(flight.signal("elevator_wanted"), -0.7, 0.7)
    thrust = np.clip(flight.signal("thrust_wanted"), 0.0, 40.0)
    return np.stack([elevator, thrust], axis=-1)


def in_force(flight: Swarm) -> np.ndarray:
    """Elevator and thrust in force from each tick on, shape (rows, 6, 2)."""
    return flight.recording.command[:, FOLLOWERS][:, :, [ELEVATOR, THRUST]]


def on_the_wire(values: np.ndarray) -> np.ndarray:
    """As fractions of the travel in float32, and back."""
    travel = np.array([0.7, 40.0])
    return np.float32(values / travel).astype(np.float64) * travel


@pytest.fixture(scope="module")
def flight() -> Swarm:
    return Swarm("flight", 1.0, lag=0.0, start=START).fly()


def test_the_command_computed_from_state_k_is_in_force_from_tick_k_plus_1(flight):
    assert np.array_equal(in_force(flight)[1:], on_the_wire(commanded(flight)[:-1]))


def test_in_the_first_period_the_initial_command_is_in_force(flight):
    assert np.array_equal(in_force(flight)[0], np.tile([TRIM[ELEVATOR], TRIM[THRUST]], (6, 1)))


def test_every_command_differs_from_its_neighbours_so_that_the_delay_shows(flight):
    changes = np.abs(np.diff(commanded(flight), axis=0))
    assert (changes[:5] > 1e-4).any(axis=2).all()
    assert not np.array_equal(in_force(flight)[2:], on_the_wire(commanded(flight)[:-2])), "not two samples"
    assert not np.array_equal(in_force(flight), on_the_wire(commanded(flight))), "not none"


def test_the_aircraft_flies_each_period_under_the_command_in_force(flight):
    """From the recorded state at tick k, under the recorded command, the plant alone reaches the state at tick k+1."""
    states = flight.recording.truth[:, :, [TRUTH.index(name) for name in ("V", "x", "z", "gamma", "theta", "q")]]
    alone = build_fleet([vehicle()])
    for k in range(len(states) - 1):
        for i in range(6):
            alone.state[0] = states[k, i]
            alone.command[0] = flight.recording.command[k, i]
            assert cycle_of("longitudinal").advance(alone, 0, k * 10_000, 10_000, 1000) == 0
            assert np.array_equal(alone.state[0], states[k + 1, i]), (k, i)


def test_with_ideal_exchange_a_command_acts_at_once():
    """The monograph's simulation: law and plant without delay, and no rounding on the way."""
    ideal = Swarm("monograph", 0.1, start=START).fly()
    assert np.array_equal(in_force(ideal), commanded(ideal))


def test_what_a_law_is_told_to_be_in_force_is_in_force(flight):
    """Own.elevator and Own.thrust of the last tick, against the recording."""
    told = flight.autopilots.own[FOLLOWERS][:, [15, 17]]
    assert told == pytest.approx(in_force(flight)[-1], rel=1e-7)


def test_a_record_is_heard_from_the_first_tick_a_latency_after_its_stamp():
    """20 Hz records one exchange period old: between two of them the age runs from 0.05 to 0.09 s."""
    flight = Swarm("flight", 0.3)
    ages = []
    for tick in range(flight.timing.ticks + 1):
        flight.fly(tick, tick + 1)
        ages.append(float(flight.inbox.age[0, 0]) if flight.inbox.valid[0, 0] else None)
    assert ages[:5] == [None] * 5
    assert ages[5:] == pytest.approx([0.05 + 0.01 * (n % 5) for n in range(len(ages) - 5)])


# The vehicle's process.


def test_a_vehicle_process_latches_at_tick_k_the_answer_to_state_k_minus_1(tmp_path, monkeypatch):
    """The test plays the autopilot and answers state k with a command that carries k."""
    monkeypatch.setenv("FTCC_RUNTIME_DIR", str(tmp_path / "runtime"))
    block = reserve((1,))
    ports = block.of(1)
    ticks = 30
    setting = Setting("test", timing("flight", ticks / 100), True, {1: ports}, {1: 1}, block.station, tmp_path)
    launcher, pipe = Pipe()
    pilot = Endpoint(1, AUTOPILOT, ports.autopilot, (LOOPBACK, ports.vehicle))
    station = Endpoint(STATION, 1, block.station)
    vehicles = Vehicles([vehicle(1)], setting, Gate(pipe))
    launcher.send(Go(Pace(0.0, 0, 1.0), Limit(None)))
    vehicles.gate.wait_until_go()
    flying = threading.Thread(target=vehicles.fly)
    flying.start()

    states: dict[int, np.ndarray] = {}
    told: dict[int, np.ndarray | None] = {}
    until = time.monotonic() + 20.0
    while len(states) <= ticks and time.monotonic() < until:
        messages = pilot.receive()
        while messages:
            state, force = np.zeros(13), np.zeros(4)
            stamp, used = read_state(messages, state, force)
            messages = messages[used:]
            tick = stamp // 10_000
            assert tick <= len(states), "a vehicle never runs ahead of its command"
            states[tick], told[tick] = state, force if used == 3 else None
            pilot.send(command_message(stamp, answer(tick)))
        time.sleep(0.0005)
    flying_ended = until - time.monotonic() > 0.0
    launcher.send(Release())
    flying.join(20.0)
    vehicles.close()
    pilot.close()
    station.close()
    block.release()
    assert flying_ended
    assert not flying.is_alive()
    assert launcher.recv() == Ended(ticks + 1, 0, ticks + 1)

    # The vehicle tells the command in force at the first tick only: later it is the answer to the last state.
    assert np.array_equal(told[0], np.float32([0.0, TRIM[ELEVATOR] / 0.7, 0.0, TRIM[THRUST] / 40.0]))
    assert [tick for tick, force in told.items() if force is not None] == [0]
    # And the aircraft flew under just these commands.
    alone = build_fleet([vehicle()])
    for tick in range(ticks):
        if tick > 0:
            alone.command[0] = answer(tick - 1) * [0.0, 0.7, 0.0, 40.0]
        cycle_of("longitudinal").advance(alone, 0, tick * 10_000, 10_000, 1000)
        assert -states[tick + 1][9] == np.float32(alone.state[0, 2])
        assert states[tick + 1][5] == np.float32(alone.state[0, 5])


def answer(tick: int) -> np.ndarray:
    """A command near the trim that tells which state it answers, in fractions of the travel."""
    return np.float32([0.0, -0.28 + 0.002 * (tick % 7), 0.0, 0.5 + 0.001 * tick]).astype(np.float64)
