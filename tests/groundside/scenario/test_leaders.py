"""Leaders climb over the obstacles that one of them detects; who flies into one is told."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

from ftcc.airside.references.profiles import Trigger
from ftcc.groundside.scenario.loading import ScenarioError, load, read, shipped
from ftcc.groundside.scenario.mission import Mission, resolve
from ftcc.groundside.simulation import simulate


def mission(**options: Any) -> Mission:
    return resolve(load("finite_time_containment", **options))


def triggers(flown: Mission, uav: int) -> tuple[Trigger, ...]:
    (profile,) = (spec.profile for spec in flown.autopilots if spec.uav == uav)
    assert profile is not None
    return profile.triggers


def test_detection_turns_obstacles_into_the_published_commands_by_position() -> None:
    """Detected by the foremost leader 1000 m ahead; left behind when the hindmost has passed (chapter 6)."""
    flown = mission()
    watched = [(6, 1500.0), (5, 4500.0), (6, 8000.0), (5, 12000.0)]
    for uav, altitudes in ((5, (580.0, 500.0, 600.0, 500.0)), (6, (480.0, 400.0, 500.0, 400.0))):
        assert [(t.uav, t.x) for t in triggers(flown, uav)] == watched
        assert [t.altitude for t in triggers(flown, uav)] == list(altitudes)
        assert {t.speed for t in triggers(flown, uav)} == {30.0}


def test_an_obstacle_detected_over_another_one_does_not_let_the_leaders_sink_between() -> None:
    settings = ["obstacles=[{x=[2500.0, 4500.0], top=430.0}, {x=[5000.0, 7000.0], top=450.0}]"]
    found = triggers(mission(settings=settings), 5)
    assert [(t.uav, t.x, t.altitude) for t in found] == [
        (6, 1500.0, 580.0),
        (6, 4000.0, 600.0),
        (5, 4500.0, 600.0),
        (5, 7000.0, 500.0),
    ]


def limits(scenario: str, **options: Any) -> tuple[float, float]:
    """Climb and sink limit of the leaders, which are the same for all of them."""
    profiles = [spec.profile for spec in resolve(load(scenario, **options)).autopilots]
    (both,) = {(profile.climb_limit, profile.sink_limit) for profile in profiles if profile}
    return both


def test_leaders_climb_and_sink_no_faster_than_the_followers_thrust_holds() -> None:
    assert limits("finite_time_containment") == pytest.approx((0.99 * 4.7595, 0.99 * 2.6059), rel=1e-4)


def test_leaders_climb_no_faster_than_the_followers_estimates_follow() -> None:
    """The shaper of the flight form is limited to 2.5 m/s; without it the observer follows 3 m/s."""
    assert limits("containment") == pytest.approx((0.99 * 2.2954, 0.95 * 2.5), rel=1e-4)
    assert limits("containment", settings=["gains.uav.3.beta2=2.2"]) == pytest.approx((0.95 * 2.2, 0.95 * 2.2))


def test_a_limit_that_the_scenario_states_is_taken() -> None:
    settings = ["leaders.5.climb_limit=2.0", "leaders.6.climb_limit=2.0", "leaders.5.sink_limit=9.0"]
    found = limits("finite_time_containment", settings=[*settings, "leaders.6.sink_limit=9.0"])
    assert found == (2.0, 9.0)


STEEP = ["leaders.5.altitude_filter.frequency=0.1", "leaders.6.altitude_filter.frequency=0.1", "claims=[]"]


def test_a_profile_beyond_the_limits_is_held_with_a_warning_and_an_event(tmp_path: Path) -> None:
    flown = mission(
        settings=[*STEEP, "obstacles.0.x=[1160.0, 1200.0]", "obstacles.1.x=[9000.0, 9100.0]"], duration=60.0
    )
    assert "leaders.5: its profile sinks with 2.65 m/s; the followers' thrust holds 2.61 m/s" in flown.warnings[0]
    assert "it is held at 2.58 m/s" in flown.warnings[0]
    run = simulate(flown, tmp_path / "run")
    told = [(event["uav"], event["severity"], event["text"]) for event in run.events if "leader" in event["text"]]
    for uav, up, down in ((5, 580, 500), (6, 480, 400)):
        assert [one for one in told if one[0] == uav] == [
            (uav, "info", f"leader commanded to {up} m, 30 m/s: UAV 6 has passed x = 160 m"),
            (uav, "info", f"leader commanded to {down} m, 30 m/s: UAV 5 has passed x = 1200 m"),
            (uav, "warning", "leader's sink rate held at its limit of 2.58 m/s"),
        ]
        assert np.diff(run.column("z", uav)).min() / 0.01 == pytest.approx(-2.58, abs=0.01)


def test_a_steep_profile_on_demand_comes_with_a_warning() -> None:
    warnings = mission(variants=["steep"]).warnings
    assert len(warnings) == 2
    assert all("they will lose the leaders" in warning for warning in warnings)


def test_a_leader_whose_profile_does_not_clear_an_obstacle_is_warned_about() -> None:
    (warning,) = mission(settings=["obstacles.0.top=500.0"]).warnings
    assert "leaders.6: its profile passes obstacle 1 down to" in warning


def test_another_speed_than_the_missions_is_refused_where_followers_do_not_hear_it() -> None:
    with pytest.raises(ScenarioError, match="the leaders' speed must be constant"):
        resolve(load("containment", settings=["leaders.7.V=28.0", "leaders.8.V=28.0"]))
    both = ["leaders.5.V=28.0", "leaders.6.V=28.0"]
    assert mission(settings=both).warnings == ()


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (["leaders.5.over_obstacles=[580.0]"], "leaders.5.over_obstacles: 1 altitudes for 2 obstacles"),
        (["leaders.5.commands=[{x=10.0, altitude=510.0}]"], "leaders.5: give either over_obstacles or commands"),
        (["leaders.5.V=25.0"], "must fly at the same speed"),
        (["obstacles.0.x=[4500.0, 2500.0]"], "obstacles.0"),
        (["detection_range=0.0"], "detection_range = 0.0"),
    ],
)
def test_what_makes_no_reaction_is_refused(settings: list[str], words: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        mission(settings=settings)
    assert words in str(caught.value)


def test_leaders_that_react_need_a_detection_range_and_each_other(tmp_path: Path) -> None:
    document = read(shipped()["finite_time_containment"])
    del document["detection_range"]
    path = tmp_path / "blind.toml"
    path.write_text(tomli_w.dumps(document))
    with pytest.raises(ScenarioError, match="detection_range: is missing"):
        resolve(load(path))
    document = read(shipped()["finite_time_containment"])
    document["graph"]["edges"].pop()
    path.write_text(tomli_w.dumps(document))
    with pytest.raises(ScenarioError, match="no edge 6 -> 5"):
        resolve(load(path))


def test_who_flies_into_an_obstacle_is_told_and_its_clearance_recorded(tmp_path: Path) -> None:
    settings = ["obstacles=[{x=[100.0, 300.0], top=450.0}, {x=[310.0, 320.0], top=390.0}]", "claims=[]"]
    run = simulate(mission(settings=settings, duration=12.0), tmp_path / "run")
    entered = {event["uav"]: (event["t"], event["text"]) for event in run.events if "entered" in event["text"]}
    assert set(entered) == {2, 3, 4, 6}
    assert entered[4] == (0.0, "UAV 4 entered obstacle zone 1")
    t, x, z, clearance = (run.column(name, 2) for name in ("t", "x", "z", "clearance"))
    assert t[-1] == 12.0
    assert entered[2][0] == pytest.approx(float(t[(x > 100.0) & (z < 450.0)][0]), abs=0.011)
    expected = np.where((x > 100.0) & (x < 300.0), z - 450.0, np.where((x > 310.0) & (x < 320.0), z - 390.0, z))
    np.testing.assert_array_equal(clearance, expected)
    assert json.loads((run.path / "events.jsonl").read_text().splitlines()[-1])["schema"]


def test_without_obstacles_there_is_no_clearance(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="no column clearance"):
        resolve(load("containment", settings=["claims.0.signal='clearance'"]))
