"""Scenarios: one clear message for everything that can be wrong."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from ftcc.groundside.scenario.loading import ScenarioError, load
from ftcc.groundside.scenario.mission import resolve

Document = dict[str, Any]
Edited = Callable[..., Path]


def refused(name: str | Path, *fragments: str, **options: Any) -> None:
    """Loading and resolving must fail with a message that contains all fragments."""
    with pytest.raises(ScenarioError) as caught:
        resolve(load(name, **options))
    for fragment in fragments:
        assert fragment in str(caught.value)


def test_unknown_scenario_names_those_that_exist() -> None:
    refused("contanment", "contanment", "containment", "demo")


def test_missing_file() -> None:
    refused("nowhere/mine.toml", "nowhere/mine.toml", "no such file")


def test_malformed_toml_is_reported_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "broken.toml"
    path.write_text("title = 'x'\nduration = = 4\n")
    refused(path, "broken.toml", "line 2")


@pytest.mark.parametrize(
    ("options", "fragments"),
    [
        ({"form": "monograf"}, ["form = 'monograf'", "flight, monograph"]),
        ({"variants": ["Q"]}, ["variant = Q", "P, off, loss30"]),
        ({"form": "monograph", "variants": ["P"]}, ["variant = P", "flight", "not in monograph"]),
        ({"settings": ["gains.k99=1"]}, ["no gain 'k99'", "k11"]),
        ({"settings": ["chanel.loss=0.1"]}, ["chanel", "no such field", "channel"]),
        ({"settings": ["channel.los=0.1"]}, ["channel.los = 0.1", "loss, burst_start"]),
        ({"settings": ["channel.loss=1.5"]}, ["channel.loss = 1.5", "less than or equal to 1"]),
        ({"settings": ["faults.7.at=1"]}, ["faults.7.at", "2 entries"]),
        ({"settings": ["loss"]}, ["--set loss", "key.path=value"]),
        ({"settings": ["rates.control_rate=-100"]}, ["rates.control_rate = -100", "greater than 0", "Hz"]),
        ({"settings": ["rates.control_rate=300"]}, ["rates.control_rate = 300", "whole microseconds", "333.333 Hz"]),
        (
            {"settings": ["rates.control_rate=30"]},
            ["rates.control_rate = 30", "near it is 30.303 Hz, a period of 33 ms"],
        ),
        (
            {"settings": ["rates.control_rate=2000"]},
            ["rates.control_rate = 2000", "at least 1 ms", "MAVLink"],
        ),
        ({"settings": ["rates.control_rate=80"]}, ["rates.plant_step = 0.001", "12.5 ms into whole steps"]),
        ({"settings": ["rates.plant_step=0.0003333"]}, ["rates.plant_step = 0.0003333", "whole microseconds"]),
        ({"form": "monograph", "settings": ["rates.control_rate=3000"]}, ["rates.control_rate = 3000"]),
        ({"form": "monograph", "settings": ["rates.exchange_rate=20"]}, ["rates.exchange_rate = 20", "every tick"]),
        ({"settings": ["rates.exchange_rate=30"]}, ["rates.exchange_rate = 30", "multiple of the control period"]),
        ({"settings": ["rates.latency=0.001"]}, ["rates.latency = 0.001", "at least one control period, 0.01"]),
        ({"settings": ["rates.latency=1.6"]}, ["rates.latency = 1.6", "30 exchange periods, 1.5 s"]),
        ({"settings": ["channel.delay=1.0", "channel.jitter=0.6"]}, ["channel:", "delay 1 + jitter 0.6", "1.5 s"]),
        ({"settings": ["rates.plant_step=0.003"]}, ["rates.plant_step = 0.003", "10 ms"]),
        ({"settings": ["record_rate=70"]}, ["record_rate = 70", "whole multiple"]),
        ({"settings": ["gains.k11=nan"]}, ["gains.k11 = nan", "finite"]),
        ({"settings": ["gains.k11=inf"]}, ["gains.k11 = inf", "finite"]),
        ({"settings": ["gains.k11=0"]}, ["gain k11 = 0", "must be above 0"]),
        ({"settings": ["gains.beta2=1.5"]}, ["gain beta2 = 1.5", "climb rate"]),
        ({"settings": ["gains.k11='high'"]}, ["gains.k11 = 'high'", "valid number"]),
        ({"settings": ["gains.uav.3.k99=1"]}, ["gains.uav.3: ", "no gain 'k99'", "k11"]),
        ({"settings": ["gains.uav.3.k11=nan"]}, ["gains.uav.3.k11 = nan", "finite"]),
        ({"settings": ["gains.uav.9.k11=1.0"]}, ["gains.uav: UAV 9 is not a follower", "1, 2, 3"]),
        ({"settings": ["gains.uav.7.k11=1.0"]}, ["gains.uav: UAV 7 is not a follower"]),
        ({"settings": ["gains.uav.3.k11=0"]}, ["UAV 3: gain k11 = 0", "must be above 0"]),
        ({"settings": ["gains.uav.x.k11=1"]}, ["gains.uav.x", "valid integer"]),
        ({"settings": ["switches.magic=false"]}, ["switches.magic", "fault_tolerance"]),
        ({"settings": ["faults.0.actuator='rudder'"]}, ["faults.0.actuator = 'rudder'", "thrust, elevator"]),
        ({"settings": ["faults.0.actuator='flap'"]}, ["faults.0.actuator = 'flap'", "'thrust', 'elevator'"]),
        ({"settings": ["faults.0.uav=7"]}, ["faults.0.uav = 7", "followers are 1, 2, 3"]),
        ({"settings": ["plant.limits.aileron=[-0.5, 0.5]"]}, ["has no aileron", "thrust, elevator"]),
        ({"settings": ["plant.rate_limits.rudder=1.0"]}, ["has no rudder", "thrust, elevator"]),
        ({"settings": ["plant.model='glider'"]}, ["plant.model = 'glider'", "attitude, jsbsim, longitudinal"]),
        ({"settings": ["plant.coefficients={CLx=1.2}"]}, ["plant.coefficients: CLx", "CLa", "and all"]),
        ({"settings": ["start.mu=0.1"]}, ["start.mu: the plant has no such state", "theta"]),
        (
            {"settings": ["noise.factor=1", "noise.alpha=0.1"]},
            ["noise.alpha: is computed from other measured channels"],
        ),
        (
            {"variants": ["sixdof"], "settings": ["start.alpha=0.1"]},
            ["start of UAV 1", "theta and alpha are both given"],
        ),
        ({"settings": ["plant.limits.elevator=[0.7, -0.7]"]}, ["lower limit must be below"]),
        ({"settings": ["start.z='high'"]}, ["start.z = 'high'", "valid number", "m, altitude"]),
        ({"settings": ["start.uav.9={z=1000}"]}, ["start.uav", "UAV 9 is not a follower"]),
        ({"settings": ["scheme='unheard'"]}, ["scheme = 'unheard'", "containment"]),
        ({"settings": ["airframe='jet'"]}, ["airframe = 'jet'", "reference_25kg"]),
        ({"duration": -1.0}, ["duration = -1.0", "greater than 0"]),
        ({"seed": -1}, ["seed = -1"]),
        ({"settings": ["mission.V=12"]}, ["faults.0", "no level trim"]),
    ],
    ids=lambda value: str(value)[:60] if isinstance(value, dict) else "",
)
def test_bad_choices_are_refused_with_field_value_and_what_is_allowed(
    options: dict[str, Any], fragments: list[str]
) -> None:
    refused("containment", "containment.toml", *fragments, **options)


def _unknown_uav(document: Document) -> None:
    document["graph"]["edges"][0]["between"] = [1, 9]


def _unreachable(document: Document) -> None:
    document["graph"]["edges"] = [edge for edge in document["graph"]["edges"] if 2 not in edge.get("between", [])]


def _one_way(document: Document) -> None:
    document["graph"]["edges"][0] = {"from": 1, "to": 2, "weight": 0.4}


def _half_an_edge(document: Document) -> None:
    document["graph"]["edges"][0] = {"from": 1, "weight": 0.4}


def _twice(document: Document) -> None:
    document["graph"]["edges"].append({"from": 2, "to": 1, "weight": 0.4})


def _zero_weight(document: Document) -> None:
    document["graph"]["edges"][2]["weight"] = 0.0


def _same_id(document: Document) -> None:
    document["uavs"]["leaders"] = [6, 8]


def _id_zero(document: Document) -> None:
    document["uavs"]["followers"] = [0, 2, 3, 4, 5, 6]


def _cut_of_no_edge(document: Document) -> None:
    document["link_events"] = [{"kind": "cut", "edge": [1, 4], "at": 10.0}]


def _cut_of_nothing(document: Document) -> None:
    document["link_events"] = [{"kind": "cut", "at": 10.0}]


def _degrade_without_change(document: Document) -> None:
    document["link_events"] = [{"kind": "degrade", "uav": 1, "at": 10.0}]


def _ends_before_it_begins(document: Document) -> None:
    document["link_events"] = [{"kind": "cut", "uav": 1, "at": 10.0, "until": 5.0}]


def _slow_link(document: Document) -> None:
    document["link_events"] = [{"kind": "degrade", "uav": 1, "at": 10.0, "delay": 2.0}]


def _fault_before_the_disturbances(document: Document) -> None:
    document["faults"][0]["at"] = 15.0


def _dead_elevator(document: Document) -> None:
    document["faults"][0]["effectiveness"] = 0.0


def _no_start(document: Document) -> None:
    del document["start"]["V"]


def _no_title(document: Document) -> None:
    del document["title"]


def _unknown_metric(document: Document) -> None:
    document["claims"][0]["metric"] = "biggest"


def _unknown_column(document: Document) -> None:
    document["claims"][0]["signal"] = "z - z_q"


def _no_arithmetic(document: Document) -> None:
    document["claims"][0]["signal"] = "__import__('os').system('true')"


def _no_tolerance(document: Document) -> None:
    document["claims"][0]["tolerance"] = "about right"


def _no_threshold(document: Document) -> None:
    del document["claims"][0]["threshold"]


def _claim_for_no_case(document: Document) -> None:
    document["claims"][0]["expected"] = {"flihgt": 7.2}


def _claims_of_no_case(document: Document) -> None:
    document["variant"] = {"again": {"claims_of": "flight+again"}}


def _form_is_no_table(document: Document) -> None:
    document["form"] = "flight"


def _unheard_trigger(document: Document) -> None:
    document["leaders"]["7"]["commands"] = [{"uav": 8, "x": 500.0, "altitude": 1050.0}]


@pytest.mark.parametrize(
    ("change", "fragments"),
    [
        (_unknown_uav, ["graph.edges.0", "no UAV 9", "1, 2, 3, 4, 5, 6, 7, 8"]),
        (_unreachable, ["every follower is reached from at least one leader", "no leader reaches UAV 2"]),
        (_one_way, ["undirected", "edge"]),
        (_half_an_edge, ["graph.edges.0", "between = [a, b]"]),
        (_twice, ["graph.edges.10", "edge 2 -> 1 is listed twice"]),
        (_zero_weight, ["graph.edges.2.weight = 0.0", "greater than 0"]),
        (_same_id, ["uavs: UAV 6 is listed twice"]),
        (_id_zero, ["uavs.followers.0 = 0", "greater than or equal to 1"]),
        (_cut_of_no_edge, ["link_events.0.edge = [1, 4]", "no such edge"]),
        (_cut_of_nothing, ["link_events.0", "uav = n or edge"]),
        (_degrade_without_change, ["link_events.0", "loss"]),
        (_ends_before_it_begins, ["link_events.0", "later than"]),
        (_slow_link, ["link_events.0", "delay 2", "1.5 s"]),
        (_fault_before_the_disturbances, ["faults.0", "UAV 1", "t = 15 s", "-0.781", "-0.7 to 0.7", "without_trim"]),
        (_dead_elevator, ["faults.0", "no level trim"]),
        (_no_start, ["start.V: is missing"]),
        (_no_title, ["title: is missing"]),
        (_unknown_metric, ["claims.0", "no metric 'biggest'", "max_abs"]),
        (_unknown_column, ["claims.0", "no column z_q", "z_r"]),
        (_no_arithmetic, ["claims.0", "functions are abs"]),
        (_no_tolerance, ["claims.0", "'about right' is not a tolerance", "15 %"]),
        (_no_threshold, ["claims.0", "needs a threshold"]),
        (_claim_for_no_case, ["claims.0.expected", "'flihgt'", "flight"]),
        (_claims_of_no_case, ["variant.again.claims_of = 'flight+again'", "other variants"]),
        (_form_is_no_table, ["form = 'flight'", "[form.NAME]"]),
        (_unheard_trigger, ["leaders.7.commands", "no edge 8 -> 7"]),
    ],
    ids=lambda value: value.__name__.lstrip("_") if callable(value) else "",
)
def test_bad_scenarios_are_refused_with_field_value_and_what_is_allowed(
    edited: Edited, change: Callable[[Document], None], fragments: list[str]
) -> None:
    refused(edited(change), "edited.toml", *fragments)


def test_a_fault_without_trim_flies_on_demand_with_a_warning(edited: Edited) -> None:
    def change(document: Document) -> None:
        document["faults"][0] |= {"at": 15.0, "without_trim": True}

    (warning,) = resolve(load(edited(change))).warnings
    assert "no level trim" in warning


def test_a_fault_is_checked_again_when_a_disturbance_follows_it(edited: Edited) -> None:
    def change(document: Document) -> None:
        # -0.197 rad before the disturbances is within reach of this elevator, -0.046 rad after them is not.
        document["faults"][0] |= {"at": 15.0, "effectiveness": 0.4, "bias": -0.4}

    refused(edited(change), "t = 25 s", "(-0.046 - -0.4)/0.4 = 0.885")


def test_everything_that_is_wrong_is_told_at_once() -> None:
    with pytest.raises(ScenarioError) as caught:
        resolve(load("containment", settings=["rates.exchange_rate=30", "record_rate=70", "faults.0.uav=8"]))
    assert len(caught.value.problems) == 3


def test_a_fault_must_leave_a_trim_at_the_speeds_that_leaders_change_to() -> None:
    """Chapter 4: UAV 2 could not hold 30 m/s without d2, but flies at 40 m/s when its elevator fails; d2 acts later."""
    assert not any("trim" in text for text in resolve(load("nearest_neighbour")).warnings)
    with pytest.raises(ScenarioError, match=r"UAV 2 no level trim at 30 m/s and t = 160 s.*-1\.015 rad"):
        resolve(load("nearest_neighbour", settings=["disturbances=[]"]))
