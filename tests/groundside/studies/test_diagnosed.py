"""What a study asks diagnosis: numbers, bounds, and that the headline is none of its business."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from ftcc.groundside.studies import fly_study, open_folder, plan_study
from ftcc.groundside.studies.answers import HEADLINE, NOT_FAILED
from ftcc.groundside.studies.diagnosed import is_right, known_faults
from ftcc.groundside.studies.results import Study
from ftcc.groundside.verdict import Alarm, FaultFound

FOUND = ("loss", math.inf, 10.3, 11.0, "loss", 16.0, "loss")
FAULT = FaultFound(1, "elevator", 10.0, 40.0, *FOUND, 0.62, 0.02, 0.0, 0.01, 0.6, 0.0)
ALARM = Alarm(1, "thrust", 11.0, 12.0, "faulty", "bias", ("elevator",))


@pytest.mark.parametrize(
    ("fault", "alarms", "right"),
    [
        ({}, {}, True),
        ({"kind": "bias"}, {}, False),
        ({"kind": "none"}, {}, False),
        ({}, {"uav": 1}, False),
        ({}, {"uav": 2}, True),
        ({}, {"state": "undetermined"}, True),
        ({}, {"kind": "sensor"}, True),
        ({}, {"begin": 9.0}, True),
    ],
)
def test_another_kind_or_actuator_is_wrong(fault: dict[str, Any], alarms: dict[str, Any], right: bool) -> None:
    assert is_right(replace(FAULT, **fault), [replace(ALARM, **alarms)] if alarms else []) is right


def test_only_determined_estimates_count() -> None:
    vague, gone = replace(FAULT, effectiveness_sd=0.3), replace(FAULT, kind_compared="none")
    stuck, slow = replace(FAULT, true_kind="stuck"), replace(FAULT, true_kind="slow")
    assert known_faults([FAULT, vague, gone, stuck, slow], 0.1) == [FAULT]


def test_a_study_with_diagnosis_has_its_numbers_beside_the_headline(tmp_path: Path) -> None:
    fault = 'faults=[{at=5.0, uav=2, actuator="elevator", kind="off", without_trim=true}]'
    plan = plan_study(
        "containment",
        {"diagnosis.on": [True, False]},
        settings=[fault, "disturbances=[]"],
        duration=12.0,
    )
    folder = open_folder(plan, tmp_path / "study")
    assert fly_study(plan, folder, jobs=1)
    answers = Study(folder).answers
    assert answers.titles.index(NOT_FAILED) < answers.titles.index("detection delay")
    with_it, without = answers.table.to_pylist()
    assert 0.0 < with_it["detection delay"] < 2.0
    isolated = with_it["isolation delay"]
    assert with_it["isolation delay holds"] is (isolated is not None and isolated < 2.0)
    assert with_it["detection delay holds"] is (with_it["detection delay"] < 0.5)
    assert with_it["false alarms"] == 0.0
    assert with_it["navigation faults taken for an actuator's"] is None
    assert without["detection delay"] is without["detection delay holds"] is None
    assert (answers.holds(HEADLINE)[0] == answers.holds(NOT_FAILED)[0]).all(), "no claim reaches so short a flight"


def test_a_study_without_diagnosis_asks_nothing_of_it() -> None:
    plan = plan_study("containment", duration=12.0)
    assert plan.asked == plan.claims
