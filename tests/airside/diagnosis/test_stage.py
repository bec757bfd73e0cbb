"""The stage in flight: what followers of chapter 5 believe, with noise, in moving air, of faults of all kinds."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from ftcc.airside.diagnosis.beliefs import KINDS, STATES
from ftcc.groundside.scenario.loading import load
from ftcc.groundside.scenario.mission import resolve
from ftcc.groundside.simulation import fly_in_memory

ON = ("diagnosis={on=true,gains={drift_elevator=0.03,limit_elevator=0.006}}", "noise.factor=1", "disturbances=[]")
DITHER = ("diagnosis={on=true,gains={drift_elevator=0.03,limit_elevator=0.006,dither=0.05}}", *ON[1:])
"""Thresholds of the elevator for calm air."""
AIR = "turbulence={sigma=[0.5,0.5,0.35],length=[200.0,200.0,50.0]}"
AT = 12.0


@functools.cache
def flown(*settings: str, duration: float = 24.0):
    return fly_in_memory(resolve(load("containment", settings=list(settings), duration=duration)))


def fault(text: str, actuator: str = "elevator") -> str:
    return f"faults=[{{at={AT},uav=2,actuator='{actuator}',{text},without_trim=true}}]"


def alarms(flight, actuator: str = "elevator", uav: int = 2) -> list[float]:
    """Times at which a UAV begins to believe that something is wrong with an actuator, s."""
    wrong = flight.column(f"health_{actuator}", uav) >= STATES.index("undetermined")
    return [round(float(t), 6) for t in flight.t[1:][wrong[1:] & ~wrong[:-1]]]


def test_off_by_default_and_then_nothing_is_recorded():
    flight = flown("noise.factor=1", "disturbances=[]", "faults=[]")
    assert not [name for name in flight.names if name.startswith("health")]


def test_who_only_watches_changes_nothing():
    watched, plain = flown(*ON, fault("effectiveness=0.6")), flown(*ON[1:], fault("effectiveness=0.6"))
    for name in plain.names:
        for uav in plain.mission.graph.followers:
            assert watched.column(name, uav).tobytes() == plain.column(name, uav).tobytes(), name


def test_a_healthy_swarm_raises_no_alarm():
    flight = flown(*ON, AIR, "faults=[]", "channel.loss=0.3")
    for uav in flight.mission.graph.followers:
        for actuator in ("elevator", "thrust"):
            assert alarms(flight, actuator, uav) == []
            assert np.all(flight.column(f"effectiveness_hat_{actuator}", uav) == 1.0)


@pytest.mark.parametrize(
    ("text", "within"),
    [("effectiveness=0.0", 0.3), ("effectiveness=0.4", 0.4), ("bias=0.15", 0.5), ("kind='stuck'", 3.0)],
    ids=["total loss", "60 % loss", "bias", "stuck"],
)
def test_a_fault_is_noticed_by_its_own_uav_and_no_other(text, within):
    flight = flown(*ON, fault(text))
    found = alarms(flight)
    assert found
    assert AT < found[0] <= AT + within
    assert [alarms(flight, "elevator", uav) for uav in (1, 3, 4, 5, 6)] == [[]] * 5


def test_a_loss_is_named_and_measured():
    flight = flown(*ON, fault("effectiveness=0.4"))
    assert KINDS[int(flight.column("kind_elevator", 2)[-1])] == "loss"
    assert STATES[int(flight.column("health_elevator", 2)[-1])] == "faulty"
    estimate, deviation = (
        flight.column("effectiveness_hat_elevator", 2)[-1],
        flight.column("effectiveness_sd_elevator", 2)[-1],
    )
    assert estimate == pytest.approx(0.4, abs=0.1)
    assert abs(estimate - 0.4) < 3.0 * deviation
    assert flight.column("worst_effectiveness", 2)[-1] == pytest.approx(estimate)


@pytest.mark.parametrize(
    "text",
    [
        "navigation='position',offset=[5.0,5.0,5.0],rate_offset=[2.0,1.0,1.0]",
        "navigation='position',kind='stuck'",
        "navigation='attitude',offset=[0.0,0.1,0.0],rate_offset=[0.0,0.1,0.0]",
        "navigation='attitude',kind='off'",
        "navigation='attitude',kind='slow',period=0.2",
    ],
)
def test_a_navigation_fault_is_not_taken_for_one_of_an_actuator(text):
    flight = flown(*ON, f"faults=[{{at={AT},uav=2,{text}}}]", duration=18.0)
    assert alarms(flight) == []
    assert alarms(flight, "thrust") == []


def test_a_repair_is_noticed():
    flight = flown(*ON, f"faults=[{{at={AT},until=20.0,uav=2,actuator='elevator',bias=0.15}}]", duration=45.0)
    states = flight.column("health_elevator", 2)
    assert states[flight.t < 20.0][-1] >= STATES.index("undetermined")
    assert states[-1] == STATES.index("healthy")


def test_a_law_that_knows_of_a_loss_compensates_it():
    """The command that the aircraft gets is that which, by the belief, does what the law wants."""
    told = flown(*ON, "diagnosis.accommodate=true", fault("effectiveness=0.4"))
    passive = flown(*ON, fault("effectiveness=0.4"))
    late = told.t > 20.0
    effort = np.std(np.diff(told.column("elevator_command", 2)[late]))
    assert effort > 1.3 * np.std(np.diff(passive.column("elevator_command", 2)[late])), "its loop gain is restored"
    assert not told.lost
    before = told.t < AT
    assert np.array_equal(told.column("elevator_command", 2)[before], passive.column("elevator_command", 2)[before])


def test_a_dither_excites_what_level_flight_does_not_show():
    """The deviation of the effectiveness gets smaller, and the aircraft pays with motion of its elevator."""
    still, excited = flown(*ON, fault("effectiveness=0.7")), flown(*DITHER, fault("effectiveness=0.7"))
    deviations = [one.column("effectiveness_sd_elevator", 2)[-1] for one in (still, excited)]
    assert deviations[1] < 0.8 * deviations[0]
    before = (still.t > 5.0) & (still.t < AT)
    moved = [one.column("elevator_command", 2)[before].std() for one in (still, excited)]
    travel = still.mission.autopilots[0].travel[1]
    assert moved[1] ** 2 - moved[0] ** 2 == pytest.approx((0.05 * travel) ** 2 / 2.0, rel=0.3)
