"""How a flight went: each finding on signals made up for it, and the verdict on flights of which it is known."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from ftcc.airside.scheme import Quantity
from ftcc.groundside import Run
from ftcc.groundside.dashboard.replay import snapshots_of
from ftcc.groundside.scenario.loading import ScenarioError, load
from ftcc.groundside.scenario.mission import Mission, resolve
from ftcc.groundside.simulation import fly_in_memory, simulate
from ftcc.groundside.verdict import AS_IT_SHOULD, FAILED, REMARKS, VERDICT_FILE, Verdict, judge
from ftcc.link.actuators import SLOT
from ftcc.sim.plants import conditions_of
from ftcc.sim.process import columns, places
from tests.groundside.conftest import mission_of

T = np.arange(0.0, 400.005, 0.01)


class Made:
    """A recording in which all is as it should be, but for what is given: by UAV and column."""

    def __init__(self, mission: Mission, changed: dict[int, dict[str, np.ndarray]], until: dict[int, float]) -> None:
        self._mission = mission
        self._changed = changed
        self._until = until
        self.uavs = tuple(sorted(mission.uavs))
        self.t = T[: round(mission.timing.duration * 100.0) + 1]
        commands = [f"{name}_command" for name in ("thrust", "elevator")]
        self.names = ("t", "uav", "x", "z", "V", *commands, *(signal.name for signal in mission.scheme.signals))

    def column(self, name: str, uav: int) -> np.ndarray:
        rows = int((self.t <= self._until.get(uav, math.inf)).sum())
        if name == "t":
            return self.t[:rows]
        assert name in self.names
        usual = {"z": 1000.0, "V": 30.0, "thrust_command": 20.0, "epsilon": 1.0}
        values = self._changed.get(uav, {}).get(name, np.full(len(self.t), usual.get(name, 0.0)))
        return values[:rows]


CONTAINMENT = mission_of("flight", duration=100.0)


def verdict(
    changed: dict[int, dict[str, np.ndarray]] | None = None,
    mission: Mission = CONTAINMENT,
    lost: dict[int, tuple[float, str]] | None = None,
    until: dict[int, float] | None = None,
) -> Verdict:
    lost = lost or {}
    ended = {uav: t for uav, (t, _) in lost.items()} | (until or {})
    return judge(Made(mission, changed or {}, ended), mission, lost)


T100 = T[T <= 100.0]
HIGH, LOW = np.full(len(T100), 1100.0), np.full(len(T100), 900.0)


def test_a_flight_without_findings_is_as_it_should_be() -> None:
    found = verdict()
    assert found.word == AS_IT_SHOULD
    assert (found.failures, found.remarks, found.severity) == ([], [], "info")
    assert found.text == "verdict: as it should be"


def test_the_largest_error_is_told_with_uav_and_time_and_judged_in_the_end() -> None:
    bump = 1000.0 + 7.0 * np.exp(-((T100 - 40.0) ** 2))
    found = verdict({2: {"z": bump}})
    error = found.tracking[0]
    assert (error.name, error.uav, error.allowed) == ("z - z_d", 2, 2.0)
    assert error.largest == pytest.approx(7.0)
    assert error.at == pytest.approx(40.0)
    assert error.end == pytest.approx(0.0, abs=1e-9)
    # Out of the leaders' hull for as long as exp(-(t - 40)^2) is above 1/7.
    (left,) = found.outside
    assert left.uav == 2
    assert left.seconds == pytest.approx(2.0 * math.sqrt(math.log(7.0)), abs=0.02)
    assert not left.at_end
    assert found.word == REMARKS


def test_an_error_in_the_end_fails_the_flight() -> None:
    found = verdict({3: {"z": np.full(len(T100), 886.0)}})
    assert found.word == FAILED
    assert found.tracking[0].end == pytest.approx(114.0)
    assert "(z - z_d): 114 m in the end, UAV 3, 2 m allowed" in found.failures[0]
    # It never was between the leaders.
    assert "hull of the leaders' altitudes left, and outside in the end, for up to 100 s: UAV 3" in found.failures[1]


def test_the_hull_counts_from_when_it_was_entered() -> None:
    between = {7: {"z": HIGH}, 8: {"z": LOW}}
    entering = np.maximum(1000.0, 1200.0 - 10.0 * T100)
    left = verdict(between | {1: {"z": entering}}).outside
    assert left == ()
    again = np.where(np.abs(T100 - 60.0) < 1.005, 1103.0, entering)
    (left_again,) = verdict(between | {1: {"z": again}}).outside
    assert left_again.seconds == pytest.approx(2.01)
    assert left_again.until == pytest.approx(61.0)


def test_a_bound_of_a_signal_that_was_left() -> None:
    mission = mission_of("flight", "prescribed_performance", duration=100.0)
    e2 = np.where((T100 >= 30.0) & (T100 < 30.5), -1.5, 0.5)
    (left,) = verdict({2: {"e2": e2}}, mission).outside
    assert (left.name, left.uav) == ("bound epsilon of e2", 2)
    assert left.seconds == pytest.approx(0.5)
    found = verdict({2: {"e2": np.where(T100 > 99.0, 1.5, 0.0)}}, mission)
    assert found.word == FAILED


def test_time_at_the_limits_by_actuator_and_uav() -> None:
    thrust = np.where(T100 < 30.0, 40.0, np.where(T100 < 40.0, 0.0, 20.0))
    found = verdict({4: {"thrust_command": thrust}, 5: {"elevator_command": np.where(T100 < 1.0, -0.7, 0.0)}})
    shares = {(one.actuator, one.uav): one.share for one in found.saturation}
    assert shares == {("thrust", 4): pytest.approx(0.4, abs=1e-4), ("elevator", 5): pytest.approx(0.01, abs=1e-4)}
    assert found.remarks == ["thrust at its limits for up to 40 % of the time: UAV 4"]


def test_a_limit_cycle_is_named_and_what_the_leader_does_is_none() -> None:
    elevator = {"elevator_command": 0.3 * np.sin(6.0 * T100)}
    found = verdict({1: elevator, 5: elevator})
    assert [(one.signal, one.uav) for one in found.limit_cycles] == [("elevator", 1), ("elevator", 5)]
    assert found.limit_cycles[0].frequency == pytest.approx(6.0, abs=0.1)
    assert found.limit_cycles[0].amplitude == pytest.approx(0.3, rel=0.05)
    assert found.failures == ["limit cycle of elevator, 6 rad/s, up to +-17.1 deg: UAV 1, 5"]
    waving = {8: {"V": 30.0 + 0.5 * np.sin(6.0 * T100)}}
    assert verdict({1: elevator, **waving}).word == AS_IT_SHOULD
    # One that is twice as fast as another that is commanded answers it; one in between does not.
    half = {8: {"V": 30.0 + 0.5 * np.sin(3.0 * T100)}}
    other = {8: {"V": 30.0 + 0.5 * np.sin(4.5 * T100)}}
    assert verdict({1: elevator, **half}).word == AS_IT_SHOULD
    assert verdict({1: elevator, **other}).word == FAILED


def test_lost_aircraft_are_named_with_their_cause() -> None:
    found = verdict(lost={4: (61.5, "airspeed outside the model's valid range")}, until={2: 70.0})
    assert found.word == FAILED
    assert found.failures == [
        "UAV 2 lost at 70.0 s: its recording ends",
        "UAV 4 lost at 61.5 s: airspeed outside the model's valid range",
    ]


def test_all_may_be_lost_and_nothing_be_recorded() -> None:
    everybody = dict.fromkeys(CONTAINMENT.graph.followers, (50.0, "airspeed outside the model's valid range"))
    found = verdict(lost=everybody)
    assert len(found.failures) == 6
    assert found.tracking[0].end is None
    assert json.loads(found.dumps())["tracking"][0]["end"] is None
    assert verdict(until=dict.fromkeys(CONTAINMENT.uavs, -1.0)).word == REMARKS


def test_a_flight_that_ended_before_its_time_has_a_remark() -> None:
    # Processes that are stopped do not end at the same tick.
    found = verdict(until={uav: 60.0 - 0.01 * uav for uav in CONTAINMENT.uavs})
    assert found.word == REMARKS
    assert found.remarks == ["ended at 59.99 of 100 s"]


@pytest.mark.parametrize("scheme", ["demo", "nearest_neighbour", "finite_time_containment", "directed_attitude"])
def test_every_tracking_error_of_a_scheme_can_be_said(scheme: str) -> None:
    mission = resolve(load(scheme, settings=["duration=0.5"]))
    found = fly_in_memory(mission).verdict
    assert [one.name for one in found.tracking] == [one.name for one in mission.scheme.tracking]
    assert all(one.allowed is not None for one in found.tracking)


def test_a_replay_ends_with_the_verdict(demo_run: Run) -> None:
    *_, last = snapshots_of(demo_run, rate=0.007)
    assert last.t < demo_run.end
    assert last.events[-1].text == "verdict: as it should be"


def test_a_scheme_that_declares_what_is_not_recorded_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = (Quantity("z - z_dd", "m", "altitude", bound=1.0),)
    monkeypatch.setattr(CONTAINMENT.scheme.module, "TRACKING", wrong)
    with pytest.raises(ScenarioError, match="scheme = 'containment': TRACKING: 'z - z_dd': there is no column z_dd"):
        mission_of("flight")


def test_a_scheme_that_declares_nothing_is_judged_by_what_it_calls_a_tracking_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delattr(CONTAINMENT.scheme.module, "TRACKING")
    found = verdict({2: {"S1": np.full(len(T100), 5.5), "S5": np.full(len(T100), 0.5)}})
    assert [(one.name, one.allowed, one.too_large) for one in found.tracking] == [("S1", 5.0, True), ("S5", 1.0, False)]
    monkeypatch.setattr(CONTAINMENT.scheme.module, "TRACKING", (), raising=False)
    assert verdict().text == "verdict: with remarks: nothing says what the scheme tracks"


def test_commands_are_planned_as_information_and_failures_as_warnings() -> None:
    told = {text.split(":")[0]: severity for _, _, severity, text in mission_of("flight").events}
    assert told["leader commanded to 1100 m"] == "info"
    assert told["leader begins its cosine in altitude"] == "info"
    assert told["elevator fault"] == "warning"
    attitude = mission_of("flight", "directed_attitude").events
    assert {severity for _, _, severity, text in attitude if text.startswith("commanded to")} == {"info"}


@pytest.mark.parametrize(
    ("scenario", "actuators"),
    [
        ("fire_monitoring", ["bank", "load_factor", "thrust"]),
        ("containment", ["elevator", "thrust"]),
        ("directed_attitude", ["aileron", "elevator", "rudder", "thrust"]),
    ],
)
def test_a_recording_has_columns_of_the_actuators_that_there_are(scenario: str, actuators: list[str]) -> None:
    plant = mission_of("flight", scenario).plant
    names = [column.name for column in columns(plant)]
    assert [name for name in names if name in SLOT] == actuators
    assert [name.removesuffix("_command") for name in names if name.endswith("_command")] == actuators
    # A row is filled with all slots: t, uav, 13 of truth, commands, what acts, conditions.
    width = 2 + 13 + 4 + 4
    found = places(plant)
    assert [found[names.index(name)] for name in actuators] == [19 + SLOT[name] for name in actuators]
    assert found[names.index(f"{actuators[0]}_command")] == 15 + SLOT[actuators[0]]
    assert found[-1] == len(conditions_of(plant)) + width - 1


def test_the_demo_went_as_it_should(demo_run: Run) -> None:
    assert demo_run.verdict.word == AS_IT_SHOULD
    assert demo_run.events[-1]["text"] == "verdict: as it should be"
    told = json.loads((demo_run.path / VERDICT_FILE).read_text())
    assert told == json.loads(demo_run.verdict.dumps())
    assert told["verdict"] == AS_IT_SHOULD


def test_a_lower_loop_twice_as_slow_cycles_in_all_four_aircraft(tmp_path: Path) -> None:
    # Table of chapter 9's reference: "all three 2 x slower: limit cycle, n and mu to their limits".
    slow = ["plant.lag.thrust=10", "plant.lag.bank=2.5", "plant.lag.load_factor=4"]
    flight = fly_in_memory(resolve(load("fire_monitoring", settings=slow)))
    assert flight.verdict.word == FAILED
    assert [one.uav for one in flight.verdict.limit_cycles] == [1, 2, 3, 4]
    assert all(1.0 < one.frequency < 6.0 for one in flight.verdict.limit_cycles)
    run = simulate(flight.mission, tmp_path / "run")
    # From the recording the same is said, and its last event says it.
    assert run.verdict == flight.verdict
    assert run.events[-1]["severity"] == "error"
    assert run.lost == {}


@pytest.mark.parametrize("change", ["gains.k41=80", "plant.delay=5"])
def test_gains_and_delays_that_destabilize_a_containment_flight_are_told(change: str) -> None:
    found = fly_in_memory(resolve(load("containment", settings=[change, "duration=120"]))).verdict
    assert found.word == FAILED
    assert {one.signal for one in found.limit_cycles} == {"elevator"}
