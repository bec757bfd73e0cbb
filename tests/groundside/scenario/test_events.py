"""Events of a scenario that end, and what of it is told."""

from __future__ import annotations

import math

import pytest

from ftcc.airside.references import attitude
from ftcc.groundside.scenario.loading import ScenarioError, load
from ftcc.groundside.scenario.mission import Mission, resolve
from ftcc.groundside.simulation import fly_in_memory
from ftcc.sim.disturbances import Disturbance
from ftcc.sim.faults import Fault
from ftcc.sim.wind import DiscreteGust


def mission(*settings: str, scenario: str = "containment") -> Mission:
    return resolve(load(scenario, form="flight", duration=60.0, settings=settings))


def told(found: Mission, word: str) -> list[tuple[float, int | None, str]]:
    """Time, UAV and text of what is planned, with that word in it."""
    return [(t, uav, text) for t, uav, _, text in found.events if word in text]


def refused(*settings: str, scenario: str = "containment") -> str:
    with pytest.raises(ScenarioError) as caught:
        mission(*settings, scenario=scenario)
    return str(caught.value)


def test_a_disturbance_oscillates_and_ends() -> None:
    swing = "disturbances=[{at=5.0, until=20.0, d2=0.1, frequency=2.0, phase=0.5, onset=3.0, uavs=[2]}]"
    found = mission("faults=[]", swing)
    assert [vehicle.disturbances for vehicle in found.vehicles[:3]] == [
        (),
        (Disturbance(5.0, 1.0, 0.1, 3.0, 20.0, 2.0, 0.5),),
        (),
    ]
    assert told(found, "disturbance") == [
        (5.0, 2, "disturbance d2 = 0.1 rad/s, oscillating with 2 rad/s"),
        (20.0, 2, "disturbance d2 over"),
    ]
    d2 = fly_in_memory(found).column("d2", 2)
    shown = 0.1 * (1.0 - math.exp(-3.0 * 2.0)) * math.sin(2.0 * 2.0 + 0.5)
    assert (d2[499], d2[700], d2[2000]) == pytest.approx((0.0, shown, 0.0), abs=1e-12)


def test_a_fault_is_repaired_at_its_end() -> None:
    found = mission("faults=[{at=5.0, until=20.0, uav=1, actuator='elevator', effectiveness=0.7}]")
    assert found.vehicles[0].faults == (
        Fault(5.0, 1.0, 0.7, 0.0, 0.0, 0.0),
        Fault(20.0, 1.0, 1.0, 0.0, 0.0, 0.0),
    )
    assert [event[::2] for event in told(found, "elevator")] == [
        (5.0, "elevator fault: effectiveness 0.7, bias 0 rad"),
        (20.0, "elevator repaired"),
    ]
    repaired = mission(
        "faults=[{at=5.0, uav=1, actuator='elevator', effectiveness=0.7},"
        " {at=20.0, uav=1, actuator='elevator', kind='ok'}]"
    )
    assert found.vehicles == repaired.vehicles
    assert found.events == repaired.events


def test_a_fault_may_begin_when_another_one_ends() -> None:
    """Then nothing is repaired; faults of other parts may overlap."""
    found = mission(
        "faults=[{at=5.0, until=20.0, uav=1, actuator='elevator', effectiveness=0.7},"
        " {at=20.0, until=30.0, uav=1, actuator='elevator', effectiveness=0.8},"
        " {at=8.0, until=9.0, uav=1, navigation='attitude', kind='stuck'}]"
    )
    assert [(fault.time, fault.effectiveness) for fault in found.vehicles[0].faults] == [
        (5.0, 0.7),
        (20.0, 0.8),
        (30.0, 1.0),
    ]
    assert [fault.time for fault in found.vehicles[0].navigation_faults] == [8.0, 9.0]


def test_a_disturbance_that_is_over_asks_no_trim() -> None:
    """-0.046 rad are out of reach of this elevator, -0.197 rad are not."""
    fault = "faults=[{at=15.0, uav=1, actuator='elevator', effectiveness=0.4, bias=-0.4}]"
    push = "disturbances=[{at=5.0, d1=0.2, d2=0.2, d3=0.1%s}]"
    assert "allowed is -0.7 to 0.7" in refused(fault, push % "")
    assert not any("trim" in text for text in mission(fault, push % ", until=15.0").warnings)
    assert not any("trim" in text for text in mission(fault, push % ", frequency=9.0").warnings)


def test_a_leader_returns_to_what_was_commanded_before() -> None:
    commands = "leaders.7.commands=[{at=5.0, altitude=1010.0}, {at=10.0, until=20.0, altitude=1020.0}]"
    found = mission(commands)
    profile = next(spec.profile for spec in found.autopilots if spec.uav == 7)
    assert profile is not None
    assert [(c.at, c.altitude, c.speed) for c in profile.commands] == [
        (5.0, 1010.0, 30.0),
        (10.0, 1020.0, 30.0),
        (20.0, 1010.0, 30.0),
    ]
    assert (20.0, 7, "info", "leader commanded as before") in found.events


def test_an_attitude_returns_to_what_was_commanded_before() -> None:
    commands = (
        "attitude.commands=[{at=0.0, bank=0.0, alpha=0.05, sideslip=0.0},"
        " {at=5.0, until=9.0, bank=0.3, uavs=[2]}, {at=12.0, alpha=0.06}]"
    )
    found = mission(commands, scenario="attitude_synchronization")
    first, second = (spec.reference.commands for spec in found.autopilots[:2])
    assert first == (attitude.Command(0.0, 0.0, 0.05, 0.0), attitude.Command(12.0, 0.0, 0.06, 0.0))
    assert [(c.at, c.mu, c.alpha) for c in second] == [
        (0.0, 0.0, 0.05),
        (5.0, 0.3, 0.05),
        (9.0, 0.0, 0.05),
        (12.0, 0.0, 0.06),
    ]
    assert (9.0, 2, "info", "commanded to the attitude before") in found.events


def test_a_fire_drifts_as_before() -> None:
    found = mission("fire_events=[{at=5.0, until=25.0, drift=[1.0, 0.5]}]", scenario="fire_monitoring")
    first, moved, back = found.autopilots[0].reference.commands
    assert back[3:] == first[3:]
    assert (back.north - moved.north, back.east - moved.east) == pytest.approx((20.0, 10.0))
    assert (25.0, None, "info", "fire: it drifts as before") in found.events


def test_gusts_come_and_go() -> None:
    found = mission(
        "gusts=[{at=5.0, until=20.0, up=2.0, along=-1.0, length=60.0, uavs=[3]},"
        " {at=30.0, right=4.0, length=90.0, held=false, airspeed=45.0}]"
    )
    assert found.vehicles[2].discrete_gusts == (
        DiscreteGust(5.0, 2.0, -1.0, 0.0, 2.0, 20.0),
        DiscreteGust(30.0, 2.0, 0.0, 4.0, 0.0, 32.0),
    )
    assert [len(vehicle.discrete_gusts) for vehicle in found.vehicles] == [1, 1, 2, 1, 1, 1, 0, 0]
    assert told(found, "gust") == [
        (5.0, 3, "gust along -1 m/s, up 2 m/s within 60 m"),
        (20.0, 3, "gust along -1 m/s, up 2 m/s falls"),
        (30.0, None, "1-cosine gust right 4 m/s within 90 m"),
    ]


def test_turbulence_is_that_of_the_seed_and_of_the_uav() -> None:
    """The lengths are flown through with the speed of the start, 30 m/s here."""
    settings = "turbulence={sigma=[0.4, 0.5, 0.6], length=[300.0, 200.0, 100.0], uavs=[1, 2]}"
    found = mission(settings)
    assert [vehicle.turbulence.deviation for vehicle in found.vehicles] == [(0.4, 0.5, 0.6)] * 2 + [(0.0,) * 3] * 6
    assert found.vehicles[0].turbulence.bandwidth == pytest.approx((0.1, 0.15, 0.3), rel=0.02)
    flights = [
        fly_in_memory(resolve(load("containment", duration=5.0, seed=seed, settings=[settings]))) for seed in (1, 1, 2)
    ]
    first, again, other = ([flight.column("wind_up", uav) for uav in (1, 2, 3)] for flight in flights)
    assert (first[0] == again[0]).all()
    assert (first[0] != first[1]).all()
    assert (first[0] != other[0]).all()
    assert not first[2].any()


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("disturbances=[{at=5.0, until=5.0, d1=0.1}]", "disturbances.0"),
        ("disturbances=[{at=5.0, d1=0.1, phase=1.0}]", "phase needs frequency"),
        ("disturbances=[{at=5.0, d1=0.1, frequency=-1.0}]", "disturbances.0.frequency = -1.0: must be greater than 0"),
        ("faults=[{at=5.0, until=4.0, uav=1, actuator='elevator'}]", "until = 4 must be later than at = 5"),
        ("faults=[{at=5.0, until=9.0, uav=1, actuator='elevator', kind='ok'}]", "kind = 'ok' takes no until"),
        (
            "faults=[{at=5.0, until=9.0, uav=1, actuator='elevator'}, {at=7.0, uav=1, actuator='elevator'}]",
            "faults.1.at = 7: faults.0 of the same part of UAV 1 lasts from 5 to 9 s",
        ),
        ("leaders.7.commands=[{x=100.0, until=9.0, altitude=1010.0}]", "until needs at"),
        (
            "leaders.7.commands=[{at=5.0, until=9.0, altitude=1010.0}, {at=7.0, speed=31.0}]",
            "each after the until of those before",
        ),
        ("gusts=[{at=5.0, length=60.0}]", "needs some of along, right, up"),
        ("gusts=[{at=5.0, until=6.0, up=1.0, length=60.0}]", "gusts.0.until = 6: it rises until"),
        ("gusts=[{at=5.0, until=9.0, up=1.0, length=60.0, held=false}]", "until needs a gust that is held"),
        ("gusts=[{at=5.0, up=1.0, length=60.0, uavs=[7]}]", "gusts.0.uavs: UAV 7 is not a follower"),
        ("turbulence={sigma=[1.0, 1.0, 1.0]}", "needs either sigma and length, or wind_20ft and altitude"),
        ("turbulence={wind_20ft=8.0, altitude=1000.0}", "turbulence.altitude = 1000.0: must be less than"),
        (
            "turbulence={sigma=[1.0, 1.0, 1.0], length=[9.0, 9.0, 9.0], uavs=[8]}",
            "turbulence.uavs: UAV 8 is not a follower",
        ),
    ],
)
def test_events_that_cannot_be_are_refused(setting: str, said: str) -> None:
    assert said in refused(setting)


@pytest.mark.parametrize(
    ("scenario", "setting", "said"),
    [
        ("fire_monitoring", "fire_events=[{at=5.0, until=9.0, centre=[10.0, 0.0]}]", "until needs drift"),
        (
            "fire_monitoring",
            "fire_events=[{at=5.0, until=9.0, drift=[1.0, 0.0]}, {at=8.0, drift=[0.0, 0.0]}]",
            "each after the until of those before",
        ),
        ("attitude_synchronization", "attitude.commands=[{at=0.0, until=5.0, bank=0.1}]", "there is none before it"),
        (
            "attitude_synchronization",
            "attitude.commands=[{at=0.0, bank=0.1}, {at=3.0, until=5.0, bank=0.2}, {at=4.0, alpha=0.1}]",
            "attitude.commands.2.at = 4: must be in order of time",
        ),
    ],
)
def test_set_points_that_cannot_be_are_refused(scenario: str, setting: str, said: str) -> None:
    assert said in refused(setting, scenario=scenario)
