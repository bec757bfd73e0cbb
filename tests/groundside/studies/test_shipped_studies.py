"""The studies that ship beside the scenarios: they can be planned, and most of what they draw can fly."""

import pytest

from ftcc.groundside.scenario import read, shipped
from ftcc.groundside.studies import plan_study

STUDIED = (
    "attitude_synchronization",
    "containment",
    "directed_attitude",
    "finite_time_containment",
    "fire_monitoring",
    "nearest_neighbour",
    "prescribed_performance",
)
DRAWS = 20


def test_every_scheme_has_a_study() -> None:
    studied = sorted(name for name, file in shipped().items() if "study" in read(file))
    assert tuple(studied) == tuple(sorted(("active", "liar", *STUDIED)))


@pytest.mark.parametrize("name", STUDIED)
def test_a_shipped_study_asks_something_and_most_of_its_draws_can_fly(name: str) -> None:
    plan = plan_study(name)
    first = [plan.drawn(plan.trial(draw * len(plan.combinations))) for draw in range(DRAWS)]
    assert plan.question.endswith("?")
    assert len(plan.claims) >= 2
    (on, _), (off, _) = plan.documents
    assert set(off.split("+")) == {*on.split("+"), "off"}
    assert len({values for values, _, _ in first}) == DRAWS
    assert sum(mission is not None for _, mission, _ in first) >= DRAWS / 2


def test_the_study_of_active_compares_what_active_fault_tolerance_adds() -> None:
    plan = plan_study("active")
    assert plan.question.endswith("?")
    assert [case for case, _ in plan.documents] == ["flight", "flight+alone", "flight+passive"]
    assert all(plan.drawn(plan.trial(3 * draw))[1] is not None for draw in range(DRAWS)), "the fault needs no trim"


def test_the_study_of_liar_draws_liars_that_can_fly_with_and_without_defence() -> None:
    plan = plan_study("liar")
    assert plan.question.endswith("?")
    assert [case for case, _ in plan.documents] == ["flight", "flight+defended"]
    assert all(plan.drawn(plan.trial(2 * draw))[1] is not None for draw in range(DRAWS))
