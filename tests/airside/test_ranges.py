"""Every gain of every scheme has a range; what lies within it flies, or was warned of."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from ftcc.airside import ranges
from ftcc.airside.ranges import Range
from ftcc.airside.schemes import find, names
from ftcc.groundside import ScenarioError, load, resolve
from ftcc.groundside.simulation import fly_in_memory
from ftcc.sim.plant import DIVERGED, LOST, NUMBER

pytestmark = pytest.mark.slow

CASES = [(scheme, form) for scheme in names() for form in find(scheme).forms]
NOT_A_NUMBER = {LOST[NUMBER], LOST[DIVERGED]}


@pytest.mark.parametrize("scheme", names())
def test_every_gain_has_a_range_with_a_reason(scheme):
    found = find(scheme)
    assert set(found.ranges) == set(found.gains_type._fields)
    assert all(allowed.why for allowed in found.ranges.values())


@pytest.mark.parametrize(("scheme", "form"), CASES)
def test_published_gains_are_within_their_ranges_and_unremarkable(scheme, form):
    mission = resolve(load(scheme, form=form))
    said = [text for text in mission.warnings if "was flown" in text]
    assert said == []


@pytest.mark.parametrize(("scheme", "form"), CASES)
def test_no_gain_ends_in_a_number_that_is_none_without_a_word(scheme, form):
    """Each gain at 0, with the wrong sign, large and huge: refused, warned of, or a fifth of a second of flight."""
    mission = resolve(load(scheme, form=form, duration=0.2))
    law, (follower, *_) = mission.scheme, mission.autopilots
    gains, told = law.gains_type(*follower.gains), set(mission.warnings)
    walked = 0
    for name, usual in gains._asdict().items():
        for value in (0.0, -usual, 1e2, 1e9):
            problems = law.check(gains._replace(**{name: value}), follower.flight)
            if any(problem.fatal or problem.text not in told for problem in problems):
                continue
            changed = tuple(
                replace(spec, gains=tuple(law.gains_type(*spec.gains)._replace(**{name: value})))
                for spec in mission.autopilots
            )
            reasons = {why for _, why in fly_in_memory(replace(mission, autopilots=changed)).lost.values()}
            assert not reasons & NOT_A_NUMBER, f"{name} = {value}"
            walked += 1
    assert walked > 0


@pytest.mark.parametrize("scheme", names())
@pytest.mark.parametrize("value", ["-inf", "nan"])
def test_a_gain_that_is_no_number_is_refused(scheme, value):
    name = find(scheme).gains_type._fields[0]
    with pytest.raises(ScenarioError, match=rf"gains\.{name} = .*finite number"):
        load(scheme, settings=[f"gains.{name}={value}"])


@pytest.mark.parametrize(
    ("allowed", "good", "bad"),
    [
        (ranges.FEEDBACK, (1e-6, 9999.0), (0.0, -1.0, 1e4, math.nan, math.inf)),
        (ranges.COUPLING, (0.0, 1e4), (-1e-9, 10001.0, math.nan)),
        (ranges.SWITCH, (0.0, 1.0), (0.5, -1.0, 2.0, math.nan)),
        (ranges.STEPS, (1.0, 7.0), (0.0, 1.5, 101.0, math.nan)),
        (ranges.LIMIT, (1e-9, 1e30), (0.0, -1.0, math.inf)),
    ],
)
def test_a_range_holds_what_it_says(allowed: Range, good, bad):
    assert not any(allowed.refusal(value) for value in good)
    assert all(str(allowed) in allowed.refusal(value) for value in bad)


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("gains.shaper=-2", "gain shaper = -2: must be from 0 to 10000, else the filter runs away"),
        ("gains.horizon=-1", "gain horizon = -1: must be at least 0"),
        ("gains.a_max=0", "gain a_max = 0: must be above 0, else nothing is let through"),
        ("gains.guard=-1", "gain guard = -1: must be at least 0"),
        ("gains.kappa=-3", "gain kappa = -3: must be from 0 to 1, else it is no fraction"),
        ("gains.acting=-7", "gain acting = -7: must be 0 or 1, else it is neither on nor off"),
    ],
)
def test_what_is_wrong_with_a_gain_is_said(setting, said):
    with pytest.raises(ScenarioError) as error:
        resolve(load("containment", settings=[setting]))
    assert said in str(error.value)


def test_a_gain_far_from_all_that_was_flown_is_warned_of():
    (remark,) = [text for text in resolve(load("containment", settings=["gains.l1=50"])).warnings if "l1" in text]
    assert remark == "gain l1 = 50: 25 times the largest value that was flown, 2"
