"""The lateral hold on the aircraft in six degrees of freedom: through messages, with lag and one sample of delay."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ftcc.airside.flight_path import Own, decode_state
from ftcc.airside.lateral_hold import LARGEST_BANK, hold_course
from ftcc.sim.build import build_fleet
from ftcc.sim.plant import TRUTH
from ftcc.sim.plants import cycle_of
from ftcc.sim.plants.attitude import State
from ftcc.sim.sensors import encode_state
from ftcc.sim.trim import trim
from tests.support.swarm import AIRFRAME, nominal, vehicle

TRAVEL = 0.5
MODEL = nominal(thrust=120.0, elevator=0.8, sideways=TRAVEL)


def flown(V: float, seconds: float, course: float = 0.0, **start: float) -> np.ndarray:
    """Truth at 100 Hz, elevator and thrust fixed at the trim of ``V``."""
    level = trim(AIRFRAME, V)
    state = State(0.0, 0.0, 1000.0, V, 0.0, 0.0, 0.0, level.alpha, 0.0, 0.0, 0.0, 0.0)._replace(**start)
    limits = ((-TRAVEL, TRAVEL), (-0.8, 0.8), (-TRAVEL, TRAVEL), (0.0, 120.0))
    command = (0.0, level.elevator, 0.0, level.thrust)
    fleet = build_fleet([vehicle(plant="attitude", initial=state, lag=(20.0,) * 4, limits=limits, command=command)])
    cycle = cycle_of("attitude")
    true, message, own = np.zeros(len(TRUTH)), np.zeros(13), np.zeros(len(Own._fields))
    next_command = np.array(command)
    rows = []
    for k in range(round(seconds * 100)):
        fleet.command[0] = next_command
        cycle.truth(fleet, 0, 0.01 * k, true)
        rows.append(true.copy())
        encode_state(true, message)
        decode_state(message, 0.01 * k, fleet.command[0], own)
        hold_course(Own(*own.tolist()), course, MODEL, next_command)
        assert cycle.advance(fleet, 0, 10_000 * k, 10_000, 1000) == 0
    return np.array(rows)


def channel(rows: np.ndarray, name: str) -> np.ndarray:
    return rows[:, TRUTH.index(name)]


@pytest.mark.parametrize("V", [18.0, 30.0, 35.0])
def test_a_banked_sideslipping_start_comes_to_level_wings_on_course(V):
    rows = flown(V, 30.0, mu=0.4, beta=0.1, chi=0.3)
    end = rows[-300:]
    assert np.abs(channel(end, "mu")).max() < 0.002
    assert np.abs(channel(end, "chi")).max() < 0.002
    assert np.abs(channel(end, "beta")).max() < 0.002


def test_it_turns_the_short_way_to_a_course_behind_with_a_bounded_bank():
    rows = flown(30.0, 40.0, course=-3.0, chi=3.0)
    assert np.abs(channel(rows, "mu")).max() < 1.05 * LARGEST_BANK
    turned = np.unwrap(channel(rows, "chi"))
    assert turned[-1] == pytest.approx(2.0 * math.pi - 3.0, abs=0.01)
    assert np.ptp(turned) < 0.35, "0.28 rad to the right"


@pytest.mark.parametrize("bank", [3.1, -3.1])
def test_an_inverted_aircraft_is_rolled_back_the_shorter_way(bank):
    """To the left it would be asked to bank by 0.5 rad: from -3.1 rad that is 2.7 rad on, not 3.6 rad back."""
    own = Own(**dict.fromkeys(Own._fields, 0.0) | {"V": 30.0, "mu": bank, "chi": math.copysign(1.0, bank)})
    command = np.zeros(4)
    hold_course(own, 0.0, MODEL, command)
    assert command[0] * bank < 0.0, "left bank is asked for where it is right of the course, and the other way around"


def test_a_level_flight_on_course_is_left_alone():
    """No aileron, no rudder: the vertical plane stays one."""
    rows = flown(30.0, 5.0)
    for name in ("y", "chi", "mu", "beta", "p", "r"):
        assert not channel(rows, name).any(), name
