"""Scenarios: merging, and one clear message for everything that can be wrong."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from ftcc.groundside.mission import resolve
from ftcc.groundside.scenario import ScenarioError, load, shipped
from ftcc.sim.airframe import Airframe

Document = dict[str, Any]
Edited = Callable[..., Path]


def refused(name: str | Path, *fragments: str, **options: Any) -> None:
    """Loading and resolving must fail with a message that contains all fragments."""
    with pytest.raises(ScenarioError) as caught:
        resolve(load(name, **options))
    for fragment in fragments:
        assert fragment in str(caught.value)


# --- what can be chosen ----------------------------------------------------------------------------------------------


def test_settings_come_after_variants_and_variants_after_the_form() -> None:
    plan = load("containment", variants=["P"]).plan
    assert plan.gains.common["k11"] == 7.3
    assert plan.rates.control_rate == 200.0
    assert plan.rates.exchange_rate == 20.0
    plan = load("containment", variants=["P"], settings=["gains.k11=5", "faults.1.at=240.5", "scheme=other"]).plan
    assert (plan.gains.common["k11"], plan.faults[1].at, plan.scheme) == (5.0, 240.5, "other")


def test_variants_apply_in_the_order_of_the_file_and_name_the_case_so() -> None:
    assert load("containment", variants=["loss30", "off", "P"]).case == "flight+P+off+loss30"


def test_a_variant_may_change_one_form_only(edited: Edited) -> None:
    def change(document: Document) -> None:
        document["form"]["monograph"] = {"rates": {"control_rate": 1000.0}}
        del document["rates"]["exchange_rate"], document["rates"]["latency"]
        document["variant"] = {"strong": {"gains": {"k11": 4.0}, "monograph": {"gains": {"k12": 5.0}}}}

    path = edited(change)
    assert load(path, form="flight", variants=["strong"]).plan.gains.common == {"in_flight": 1.0, "k11": 4.0}
    assert load(path, form="monograph", variants=["strong"]).plan.gains.common == {
        "in_flight": 1.0,
        "k11": 4.0,
        "k12": 5.0,
    }


def test_a_flown_scenario_flies_again_as_it_was_flown(tmp_path: Path) -> None:
    flown = resolve(load("containment", variants=["P", "loss30"], settings=["gains.k11=6.0"], seed=5, duration=20.0))
    path = tmp_path / "scenario.toml"
    path.write_text(flown.toml)
    again = resolve(load(path))
    assert (again.name, again.case, again.timing) == (flown.name, flown.case, flown.timing)
    assert again.vehicles == flown.vehicles
    assert again.autopilots == flown.autopilots
    assert again.claims == flown.claims
    assert resolve(load(tmp_path)).toml == flown.toml
    refused(path, "form flight", variants=["off"])


def test_both_shipped_scenarios_can_fly() -> None:
    assert {"containment", "demo"} <= set(shipped())
    assert resolve(load("demo")).warnings == ()


# --- what a mission is made of ---------------------------------------------------------------------------------------


def test_the_time_grid_of_each_form() -> None:
    flight = resolve(load("containment")).timing
    assert (flight.period_us, flight.exchange_us, flight.latency_us, flight.ticks) == (10000, 50000, 50000, 40000)
    printed = resolve(load("containment", form="monograph"))
    assert (printed.timing.period_us, printed.timing.exchange_us, printed.timing.latency_us) == (1000, 1000, 0)
    assert not printed.wire
    fine = resolve(load("containment", form="monograph", settings=["rates.control_rate=2000", "rates.plant_step=5e-4"]))
    assert (fine.timing.period_us, fine.timing.step_us, fine.timing.record_every) == (500, 500, 20)


def test_actuators_start_at_the_trim() -> None:
    first = resolve(load("containment")).vehicles[0]
    assert first.command == pytest.approx((0.0, -0.19688, 0.0, 21.303), abs=1e-3)
    assert first.lag[1] == 20.0


def test_each_uav_flies_with_the_common_gains_but_for_its_own() -> None:
    settings = ["gains.uav.3={k11=3.5, k12=4.0}", "gains.uav.5.k11=6.0"]
    plain, own = resolve(load("containment")), resolve(load("containment", settings=settings))
    names = own.scheme.gains_type._fields
    changed = {
        spec.uav: {
            name: after for name, before, after in zip(names, common.gains, spec.gains, strict=True) if before != after
        }
        for common, spec in zip(plain.autopilots, own.autopilots, strict=True)
    }
    assert {uav: gains for uav, gains in changed.items() if gains} == {3: {"k11": 3.5, "k12": 4.0}, 5: {"k11": 6.0}}


def test_a_variant_flies_another_plant_and_keeps_the_claims_of_its_case() -> None:
    plane, six = resolve(load("containment")), resolve(load("containment", variants=["sixdof"]))
    assert (plane.plant, six.plant) == ("longitudinal", "attitude")
    assert [(c.name, c.expected["flight+sixdof"], c.tolerance) for c in six.claims] == [
        (c.name, c.expected["flight"], c.tolerance) for c in plane.claims
    ]
    assert [spec.course for spec in six.autopilots] == [0.0] * 6 + [None] * 2
    assert {spec.course for spec in plane.autopilots} == {None}


def test_the_true_aircraft_differs_from_the_one_that_laws_know() -> None:
    settings = ["plant.coefficients={all=1.2, CLde=1.0}", "plant.rate_limits.elevator=4.0"]
    mission = resolve(load("containment", variants=["sixdof"], settings=settings))
    true = Airframe(*mission.vehicles[0].airframe)
    known = mission.autopilots[0].model
    assert true.CLa == pytest.approx(1.2 * known.CLa)
    assert true.CLde == known.CLde
    assert mission.vehicles[0].rate == (math.inf, 4.0, math.inf, math.inf)
    assert mission.vehicles[0].command == pytest.approx((0.0, -0.150914, 0.0, 23.310), abs=1e-3)


def test_a_vehicle_may_hold_its_speed_itself() -> None:
    settings = ["plant.autothrottle={airspeed=24.0, gain=10.0, thrust=20.0}"]
    assert resolve(load("containment", settings=settings)).vehicles[0].autothrottle == (10.0, 24.0, 20.0)


def test_a_switch_that_is_off_is_off_for_every_uav() -> None:
    mission = resolve(load("containment", settings=["gains.uav.3.observers=1", "switches.fault_tolerance=false"]))
    observers = mission.scheme.gains_type._fields.index("observers")
    assert {spec.gains[observers] for spec in mission.autopilots} == {0.0}


@pytest.mark.parametrize("variants", [[], ["P", "off"]])
def test_a_recorded_scenario_holds_every_gain_by_value_and_flies_with_the_same(
    variants: list[str], tmp_path: Path
) -> None:
    mission = resolve(load("containment", form="flight", variants=variants, settings=["gains.uav.3.k11=3.5"]))
    path = tmp_path / "scenario.toml"
    path.write_text(mission.toml)
    again = load(path)
    assert set(again.plan.gains.common) == set(mission.scheme.gains_type._fields)
    assert resolve(again).autopilots == mission.autopilots


def test_a_cut_radio_and_a_cut_edge_become_changes_at_the_right_receivers() -> None:
    radio = resolve(load("containment", variants=["P", "cut_uav3_5s"]))
    events = {spec.uav: spec.link_events for spec in radio.autopilots if spec.link_events}
    assert list(events) == [3]
    assert [(e.at_us, e.sender, e.channel.blocked) for e in events[3]] == [
        (30_000_000, None, 1.0),
        (35_000_000, None, 0.0),
    ]
    demo = {spec.uav: spec.link_events for spec in resolve(load("demo")).autopilots if spec.link_events}
    assert list(demo) == [4]
    assert [(e.at_us, e.sender, e.channel.blocked) for e in demo[4]] == [(76_000_000, 8, 1.0), (84_000_000, 8, 0.0)]


def test_overlapping_link_events_leave_the_rest_in_force_when_one_ends(edited: Edited) -> None:
    def change(document: Document) -> None:
        document["channel"] = {"loss": 0.1}
        document["link_events"] = [
            {"kind": "degrade", "edge": [1, 2], "at": 10.0, "until": 40.0, "loss": 0.5, "delay": 0.02},
            {"kind": "cut", "edge": [1, 2], "directed": True, "at": 20.0, "until": 30.0},
        ]

    changes = {spec.uav: spec.link_events for spec in resolve(load(edited(change))).autopilots if spec.link_events}
    assert [(c.at_us // 1_000_000, c.channel.loss, c.channel.blocked) for c in changes[2]] == [
        (10, 0.5, 0.0),
        (20, 0.5, 1.0),
        (30, 0.5, 0.0),
        (40, 0.1, 0.0),
    ]
    assert [(c.at_us // 1_000_000, c.channel.delay) for c in changes[1]] == [(10, 0.02), (40, 0.0)]


# --- what is refused -------------------------------------------------------------------------------------------------


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
        ({"settings": ["rates.control_rate=300"]}, ["rates.control_rate = 300", "3.33333 ms", "multiple of 1 ms"]),
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
        ({"settings": ["gains.k11=0"]}, ["gain k11 = 0", "must be > 0"]),
        ({"settings": ["gains.beta2=1.5"]}, ["gain beta2 = 1.5", "climb rate"]),
        ({"settings": ["gains.k11='high'"]}, ["gains.k11 = 'high'", "valid number"]),
        ({"settings": ["gains.uav.3.k99=1"]}, ["gains.uav.3: ", "no gain 'k99'", "k11"]),
        ({"settings": ["gains.uav.3.k11=nan"]}, ["gains.uav.3.k11 = nan", "finite"]),
        ({"settings": ["gains.uav.9.k11=1.0"]}, ["gains.uav: UAV 9 is no follower", "1, 2, 3"]),
        ({"settings": ["gains.uav.7.k11=1.0"]}, ["gains.uav: UAV 7 is no follower"]),
        ({"settings": ["gains.uav.3.k11=0"]}, ["UAV 3: gain k11 = 0", "must be > 0"]),
        ({"settings": ["gains.uav.x.k11=1"]}, ["gains.uav.x", "valid integer"]),
        ({"settings": ["switches.magic=false"]}, ["switches.magic", "fault_tolerance"]),
        ({"settings": ["faults.0.actuator='rudder'"]}, ["faults.0.actuator = 'rudder'", "thrust, elevator"]),
        ({"settings": ["faults.0.actuator='flap'"]}, ["faults.0.actuator = 'flap'", "'thrust', 'elevator'"]),
        ({"settings": ["faults.0.uav=7"]}, ["faults.0.uav = 7", "followers are 1, 2, 3"]),
        ({"settings": ["plant.limits.aileron=[-0.5, 0.5]"]}, ["has no aileron", "thrust, elevator"]),
        ({"settings": ["plant.rate_limits.rudder=1.0"]}, ["has no rudder", "thrust, elevator"]),
        ({"settings": ["plant.model='glider'"]}, ["plant.model = 'glider'", "attitude, longitudinal"]),
        ({"settings": ["plant.coefficients={CLx=1.2}"]}, ["plant.coefficients: CLx", "CLa", "and all"]),
        ({"settings": ["start.mu=0.1"]}, ["start.mu: the plant has no such state", "theta"]),
        ({"settings": ["noise.factor=1", "noise.alpha=0.1"]}, ["noise.alpha: follows from the other channels"]),
        (
            {"variants": ["sixdof"], "settings": ["start.alpha=0.1"]},
            ["start of UAV 1", "theta and alpha are both given"],
        ),
        ({"settings": ["plant.limits.elevator=[0.7, -0.7]"]}, ["lower limit must be below"]),
        ({"settings": ["start.z='high'"]}, ["start.z = 'high'", "valid number", "m, altitude"]),
        ({"settings": ["start.uav.9={z=1000}"]}, ["start.uav", "UAV 9 is no follower"]),
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
        (_twice, ["graph.edges.10", "edge 2 -> 1 stands there twice"]),
        (_zero_weight, ["graph.edges.2.weight = 0.0", "greater than 0"]),
        (_same_id, ["uavs: 6 stands there twice"]),
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
        (_no_tolerance, ["claims.0", "'about right' is no tolerance", "15 %"]),
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
