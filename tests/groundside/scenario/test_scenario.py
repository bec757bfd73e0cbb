"""Scenarios: what can be chosen, and the mission that they become; what is refused is in `test_scenario_errors`."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from ftcc.airside.schemes import find
from ftcc.groundside.scenario.loading import ScenarioError, forms_and_variants, load, read, shipped
from ftcc.groundside.scenario.mission import resolve
from ftcc.groundside.simulation import fly_in_memory
from ftcc.sim.airframe import Airframe

Document = dict[str, Any]
Edited = Callable[..., Path]


# --- what can be chosen ----------------------------------------------------------------------------------------------


def test_settings_come_after_variants_and_variants_after_the_form() -> None:
    plan = load("containment", variants=["P"]).plan
    assert plan.gains.common["k11"] == 7.3
    assert plan.rates.control_rate == 200.0
    assert plan.rates.exchange_rate == 20.0
    plan = load("containment", variants=["P"], settings=["gains.k11=5", "faults.1.at=240.5", "scheme=other"]).plan
    assert (plan.gains.common["k11"], plan.faults[1].at, plan.scheme) == (5.0, 240.5, "other")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scheme", "gains", "adapted"),
    [
        ("prescribed_performance", "k12 g11 g21 w24 w44", ("F_gamma", "F_q")),
        ("containment", "k12", ()),
        ("finite_time_containment", "g11 g12 g21 g22 g31 g32 g41 g42 h11 h42", ("chi11", "chi42")),
    ],
)
def test_integrals_adaptation_and_leaks_may_be_taken_out(scheme: str, gains: str, adapted: tuple[str, ...]) -> None:
    without = [f"gains.{gain}=0.0" for gain in gains.split()]
    flight = fly_in_memory(resolve(load(scheme, form="flight", duration=10.0, settings=without)))
    assert flight.lost == {}
    assert all((flight.column(signal, 1) == 0.0).all() for signal in adapted)


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
    with pytest.raises(ScenarioError, match="form flight"):
        load(path, variants=["off"])


@pytest.mark.parametrize("name", shipped())
def test_a_scenario_gives_no_gain_the_value_that_it_has_without(name: str) -> None:
    """The gains of a form stand in its law; a scenario and its variants give what differs, and nothing else."""
    document = read(shipped()[name])
    forms, variants = forms_and_variants(document)
    for form in forms:
        plain = load(name, form=form)
        scheme = find(plain.plan.scheme)
        law = scheme.gains(form, {})._asdict()
        assert [key for key, value in plain.plan.gains.common.items() if law[key] == value] == []
        law |= plain.plan.gains.common
        for variant, block in variants.items():
            given = block.get("gains", {}) | block.get(form, {}).get("gains", {})
            if list(block.get("forms", forms)) == [form]:
                same = [key for key, value in given.items() if key != "uav" and law[key] == value]
                assert same == [], f"variant {variant}"


def test_the_demo_is_shipped_and_can_fly_without_a_warning() -> None:
    assert "demo" in shipped()
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
