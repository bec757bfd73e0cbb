"""What diagnosis found, on columns made up for it, and in a flight."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from ftcc.airside.diagnosis.beliefs import (
    BIAS,
    FAULTY,
    FLOATING,
    KINDS,
    LOSS,
    NO_KIND,
    SLOW,
    STUCK,
    SUSPECTED,
    UNDETERMINED,
    WRONG,
)
from ftcc.groundside.scenario.loading import load
from ftcc.groundside.scenario.mission import Mission, resolve
from ftcc.groundside.simulation import fly_in_memory
from ftcc.groundside.verdict import Alarm, columns_diagnosed, false_alarms, fault_onsets, faults_found
from ftcc.groundside.verdict.diagnosis import true_kind
from ftcc.sim import faults
from ftcc.sim.faults import Fault

FAULT = '{at = 10.0, uav = 1, actuator = "elevator", effectiveness = 0.6, bias = 0.1, until = 40.0}'
T = np.arange(0.0, 60.0, 0.01)


def mission(*planned: str) -> Mission:
    return resolve(load("containment", settings=["diagnosis.on=true", f"faults=[{', '.join(planned)}]"]))


class Recorded:
    """Columns of followers, all of them as in a healthy flight where nothing else is given."""

    def __init__(self, mission: Mission) -> None:
        self.mission = mission
        self.uavs = mission.uavs
        self.names = tuple(columns_diagnosed(mission))
        self.given: dict[tuple[str, int], np.ndarray] = {}

    def column(self, name: str, uav: int) -> np.ndarray:
        if name == "t":
            return T
        healthy = 1.0 if "effectiveness" in name and "sd" not in name else 0.0
        return self.given.setdefault((name, uav), np.full(len(T), healthy))

    def set(self, name: str, begin: float, end: float, value: float, uav: int = 1) -> None:
        self.column(name, uav)[(begin - 1e-9 <= T) & (end - 1e-9 > T)] = value


def test_delays_kind_and_estimate_of_a_fault() -> None:
    flight = Recorded(mission(FAULT))
    flight.set("elevator_effectiveness", 10.0, 40.0, 0.6)
    flight.set("elevator_bias", 10.0, 40.0, 0.1)
    flight.set("health_elevator", 10.1, 10.2, SUSPECTED)
    flight.set("health_elevator", 10.2, 11.0, UNDETERMINED)
    flight.set("health_elevator", 11.0, 40.5, FAULTY)
    flight.set("kind_elevator", 11.0, 13.0, BIAS)
    flight.set("kind_elevator", 13.0, 40.0, WRONG)
    flight.set("effectiveness_hat_elevator", 16.0, 16.01, 0.63)
    flight.set("effectiveness_sd_elevator", 16.0, 16.01, 0.02)
    flight.set("bias_hat_elevator", 16.0, 16.01, 0.12)
    flight.set("bias_sd_elevator", 16.0, 16.01, 0.009)
    (fault,) = faults_found(flight)
    assert (fault.uav, fault.actuator, fault.onset, fault.until) == (1, "elevator", 10.0, 40.0)
    assert (fault.true_kind, fault.kind, fault.kind_compared) == ("loss and bias", "bias", "loss and bias")
    assert fault.detection_delay == pytest.approx(0.2)
    assert fault.isolation_delay == pytest.approx(1.0)
    assert fault.compared == pytest.approx(16.0)
    assert (fault.effectiveness_error, fault.bias_error) == (pytest.approx(0.03), pytest.approx(0.02))
    assert (fault.effectiveness_covered, fault.bias_covered) == (True, False)
    assert fault.determined
    assert false_alarms(flight) == ()


def test_a_fault_that_nobody_noticed_and_one_that_ends_too_early_to_compare() -> None:
    flight = Recorded(mission(FAULT))
    flight.set("elevator_effectiveness", 10.0, 40.0, 0.6)
    (missed,) = faults_found(flight)
    assert math.isnan(missed.detection_delay)
    assert math.isnan(missed.isolation_delay)
    assert (missed.kind, missed.determined, missed.effectiveness_covered) == ("none", False, False)
    assert missed.true_effectiveness == 0.6
    flight.set("health_elevator", 36.0, 50.0, FAULTY)
    flight.set("kind_elevator", 36.0, 50.0, LOSS)
    (late,) = faults_found(flight)
    assert (late.detected, late.isolated, late.kind) == (pytest.approx(36.0), pytest.approx(36.0), "loss")
    assert math.isnan(late.compared)
    assert math.isnan(late.effectiveness_error)


def test_a_second_fault_of_an_actuator_is_detected_by_an_alarm_of_its_own() -> None:
    second = '{at = 30.0, uav = 1, actuator = "elevator", effectiveness = 0.4}'
    flight = Recorded(mission(FAULT.replace(", until = 40.0", ""), second))
    flight.set("health_elevator", 10.5, 60.0, FAULTY)
    first, missed = faults_found(flight)
    assert first.until == missed.onset == 30.0
    assert first.detected == pytest.approx(10.5)
    assert math.isnan(missed.detected)
    flight.set("health_elevator", 30.3, 31.0, UNDETERMINED)
    assert faults_found(flight)[1].detected == pytest.approx(30.3)
    assert faults_found(flight)[1].isolated == pytest.approx(31.0)


def test_alarms_without_a_fault_of_their_actuator_are_false() -> None:
    gps = '{at = 20.0, uav = 2, navigation = "position", kind = "off", until = 25.0}'
    flight = Recorded(mission(FAULT, gps))
    flight.set("health_thrust", 12.0, 13.0, UNDETERMINED)
    flight.set("health_thrust", 12.5, 12.8, FAULTY)
    flight.set("kind_thrust", 12.5, 12.8, LOSS)
    flight.set("health_elevator", 5.0, 5.5, SUSPECTED)
    flight.set("health_elevator", 22.0, 60.0, UNDETERMINED, uav=2)
    assert false_alarms(flight) == (
        Alarm(1, "thrust", pytest.approx(12.0), pytest.approx(13.0), "faulty", "loss", ("elevator",)),
        Alarm(2, "elevator", pytest.approx(22.0), pytest.approx(59.99), "undetermined", "none", ("navigation",)),
    )
    assert math.isnan(faults_found(flight)[0].detected)


def test_faults_injected_in_flight_come_from_the_event_log() -> None:
    flight = Recorded(mission())
    log = [acts(15.0, "surfaces wrong: eff 0.4"), acts(20.0, "elevator repaired"), acts(25.0, "thrust slow: slew 2")]
    log += [acts(30.0, "elevator stuck") | {"outcome": "armed"}, acts(40.0, "attitude off")]
    flight.set("health_thrust", 25.5, 59.0, FAULTY)
    flight.set("health_elevator", 45.0, 46.0, FAULTY)
    surface, thrust = sorted(faults_found(flight, log), key=lambda fault: fault.onset)
    assert (surface.actuator, surface.onset, surface.until, surface.true_kind) == ("elevator", 15.0, 20.0, "loss")
    assert (thrust.true_kind, thrust.slew, thrust.detection_delay) == ("slow", 2.0, pytest.approx(0.5))
    assert [(alarm.actuator, alarm.amid) for alarm in false_alarms(flight, log)] == [
        ("elevator", ("thrust", "navigation"))
    ]


def test_onsets_are_those_of_the_scenario_and_of_the_event_log() -> None:
    log = [acts(15.0, "rudder repaired"), acts(41.0, "thrust slow: slew 2"), acts(50.0, "thrust off") | {"outcome": ""}]
    demo = resolve(load("demo"))
    assert fault_onsets(demo) == ((40.0, 1, "elevator"),)
    assert fault_onsets(demo, log) == ((40.0, 1, "elevator"), (41.0, 1, "thrust"))


def acts(t: float, text: str) -> dict[str, Any]:
    return {"t": t, "uav": 1, "severity": "warning", "text": text, "outcome": "acts"}


def test_the_kind_of_a_fault() -> None:
    fault = Fault(0.0, 1.0, 1.0, 0.0, 0.0, 0.0)
    kinds = [
        (fault, NO_KIND),
        (fault._replace(effectiveness=0.5), LOSS),
        (fault._replace(bias=0.1), BIAS),
        (fault._replace(effectiveness=0.5, bias=0.1), WRONG),
        (fault._replace(effectiveness=0.5, kind=faults.INTERMITTENT), LOSS),
        (fault._replace(effectiveness=0.0), FLOATING),
        (fault._replace(effectiveness=0.0, bias=0.1), STUCK),
        (fault._replace(kind=faults.STUCK), STUCK),
        (fault._replace(slew=0.1), SLOW),
    ]
    assert [KINDS[true_kind(one)] for one, _ in kinds] == [KINDS[kind] for _, kind in kinds]


def test_a_flight_without_diagnosis_has_nothing_to_find() -> None:
    flown = resolve(load("containment", duration=1.0))
    assert columns_diagnosed(flown) == frozenset()
    flight = fly_in_memory(flown)
    assert faults_found(flight) == false_alarms(flight) == ()


def test_a_flight_with_a_fault() -> None:
    settings = ["diagnosis.on=true", f"faults=[{FAULT.replace('10.0', '6.0')}]"]
    flown = resolve(load("containment", settings=settings, duration=16.0))
    flight = fly_in_memory(flown, columns=columns_diagnosed(flown))
    (fault,) = faults_found(flight)
    assert fault.until == pytest.approx(16.0)
    assert 0.0 < fault.detection_delay < 2.0
    assert not fault.isolation_delay < fault.detection_delay
    assert (fault.true_effectiveness, fault.true_bias) == (0.6, 0.1)
