"""Calibration: the rule, on flights that are made up; which flights are flown; what is refused."""

from __future__ import annotations

import pickle
import tomllib
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import replace
from typing import Any

import pytest

from ftcc.groundside.scenario import load, shipped
from ftcc.groundside.studies import StudyError, calibrate, plan_calibration
from ftcc.groundside.studies.calibration import MARGIN, Calibration
from ftcc.groundside.studies.engine import Engine
from ftcc.groundside.studies.flying import Outcome

Sums = Callable[[float, int], float]


class Fake(Engine):
    """Answers flights from a function of the elevator's drift and the seed; other actuators have no sum."""

    def __init__(self, sums: Sums, **fields: Any) -> None:
        self.seeds: list[int] = []
        self._sums, self._fields = sums, fields

    def submit(self, plan: bytes, numbers: Sequence[int]) -> Future[list[Outcome]]:
        study, done = pickle.loads(plan), Future[list[Outcome]]()
        gains = study.documents[0][1]["diagnosis"]["gains"]
        landed = []
        for number in numbers:
            seed = study.trial(number).seed
            self.seeds.append(seed)
            there = {"elevator": self._sums(gains["drift_elevator"], seed) / gains["limit_elevator"]}
            values = tuple(there.get(claim.signal.removeprefix("evidence_"), 0.0) for claim in study.claims)
            landed.append(replace(Outcome(number, values=values, verdict="as it should be"), **self._fields))
        done.set_result(landed)
        return done


@pytest.fixture(scope="module")
def planned() -> Calibration:
    """Six aircraft that fly 60 s: 0.1 h a flight, hence 20 flights a set and 2 for each drift."""
    one = plan_calibration("containment", hours=2.0, duration=60.0, seed=5)
    return replace(one, actuators={**one.actuators, "elevator": 0.1})


def elevator(planned: Calibration, sums: Sums) -> tuple[Any, Fake, Any]:
    engine = Fake(sums)
    found = calibrate(planned, engine=engine)
    assert found is not None
    return next(one for one in found.thresholds if one.actuator == "elevator"), engine, found


def test_the_drift_finds_the_smallest_fault_soonest(planned: Calibration) -> None:
    # Of the drifts 0.02, 0.03, 0.04, 0.05, 0.065, 0.08 and a fault of 0.1. The sum 0.003 takes 1.3 0.003 / (0.1 - d),
    # least at 0.02. The sum 0.1 (0.07 - d) does so at 0.065: 0.0186 s, where the least limit makes it 0.02 s.
    assert elevator(planned, lambda drift, seed: 0.003)[0].drift == pytest.approx(0.02)
    found, _, _ = elevator(planned, lambda drift, seed: max(0.1 * (0.07 - drift), 0.0))
    assert found.drift == pytest.approx(0.065)
    assert found.limit == pytest.approx(0.0007, rel=0.01)
    assert found.delay == pytest.approx(found.limit / 0.035)


def test_the_limit_leaves_a_margin_and_fresh_flights_have_seeds_of_their_own(planned: Calibration) -> None:
    found, engine, whole = elevator(planned, lambda drift, seed: 0.01 + 1e-5 * seed)
    assert planned.flights == 20
    assert engine.seeds[:12] == [5, 6] * 6, "the same flights for each drift"
    assert engine.seeds[12:] == [*range(7, 47)], "one set calibrates, one checks"
    assert found.largest == pytest.approx(0.01046)
    assert MARGIN * 0.01026 <= found.limit <= 1.01 * MARGIN * 0.01026
    assert (whole.flown, whole.fresh, whole.seeds) == (pytest.approx(4.0), pytest.approx(2.0), (5, 46))
    assert whole.alarms_an_hour == pytest.approx(1.5)


def test_an_alarm_of_fresh_flights_raises_the_limit(planned: Calibration) -> None:
    found, engine, whole = elevator(planned, lambda drift, seed: 0.02 if seed == 30 else 0.01)
    assert found.limit == pytest.approx(MARGIN * 0.02)
    assert engine.seeds[-1] == whole.seeds[1] == 66, "the set that raised it does not count as fresh"


def test_it_gives_up_where_sums_grow_with_every_set(planned: Calibration) -> None:
    with pytest.raises(StudyError, match="still raise alarms after 8 sets of 2 h: fly longer, --hours"):
        calibrate(planned, engine=Fake(lambda drift, seed: 2.0 ** (seed / 10.0) * 1e-3))


def test_sums_of_flights_with_a_loss_do_not_count(planned: Calibration) -> None:
    with pytest.raises(StudyError, match="in every healthy flight an aircraft was lost, first: UAV 1 lost"):
        calibrate(planned, engine=Fake(lambda drift, seed: 0.01, lost=(1,), error="UAV 1 lost at 3 s"))


def test_ctrl_c_leaves_nothing(planned: Calibration) -> None:
    def interrupt(drift: float, seed: int) -> float:
        raise KeyboardInterrupt

    assert calibrate(planned, engine=Fake(interrupt)) is None


def test_the_file_says_how_it_was_made_and_is_what_the_scenario_flies_with(planned: Calibration, tmp_path: Any) -> None:
    found, _, whole = elevator(planned, lambda drift, seed: 0.01)
    text = whole.toml()
    gains = tomllib.loads(text)["diagnosis"]["gains"]
    assert (gains["drift_elevator"], gains["limit_elevator"]) == (found.drift, found.limit)
    assert "--hours 2 --seed 5 --duration 60" in text
    assert "seeds 5 to 46" in text
    mine = tmp_path / "mine.toml"
    mine.write_text(shipped()["containment"].read_text())
    mine.with_suffix(".diagnosis.toml").write_text(text)
    assert load(mine).plan.diagnosis.gains.given == gains


@pytest.mark.parametrize("name", shipped())
def test_healthy_flights_of_every_scenario_can_begin(name: str) -> None:
    plan = plan_calibration(name, hours=1.0).with_drifts({}, 2, 1)
    _, mission, problem = plan.drawn(plan.trial(0))
    assert mission is not None, problem
    assert not any(vehicle.faults for vehicle in mission.vehicles)
    assert any(vehicle.noise != (0.0,) * len(vehicle.noise) for vehicle in mission.vehicles)
    assert mission.autopilots[0].diagnosis.on
    assert mission.timing.record_every == 1, "no peak of a statistic falls between two rows"
    other = plan.drawn(plan.trial(1))[1]
    assert other is not None
    if mission.vehicles[0].flown is None:
        assert other.vehicles[0].airframe != mission.vehicles[0].airframe
    else:
        # An aircraft of JSBSim has no coefficients to draw; its turbulence is.
        assert other.vehicles[0].turbulence != mission.vehicles[0].turbulence


@pytest.mark.parametrize("hours", [0.0, -1.0, float("nan"), float("inf")])
def test_hours_that_are_none(hours: float) -> None:
    with pytest.raises(StudyError, match=r"--hours .*: must be a positive number"):
        plan_calibration("containment", hours=hours)
