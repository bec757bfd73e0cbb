"""Whatever stands in a scenario: it is refused with a sentence, or flies two seconds in numbers that are numbers.

The values are those at the ends of what the schema allows, and plain ones between, alone and in pairs, in every field
of every shipped scenario. ``FTCC_SCENARIOS`` says how many are tried.
"""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Literal, get_args, get_origin

import annotated_types
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies
from pydantic import BaseModel

from ftcc.airside.schemes import find
from ftcc.groundside import ScenarioError, load, resolve
from ftcc.groundside.scenario.loading import shipped
from ftcc.groundside.simulation import fly_in_memory

TRIED = int(os.environ.get("FTCC_SCENARIOS", "60"))
SECONDS = 2.0
NOT_FLOWN = ("title", "claims", "flown")
"""What no flight depends on."""

Change = tuple[str, str]
"""Path and value of a setting."""


def numbers(bounds: list[Any], whole: bool) -> list[str]:
    """The ends of what a field allows, where it has some, and what a user may type by mistake."""
    step = 1.0 if whole else 1e-9
    ends = [1e9, -1e9]
    for bound in bounds:
        for one in getattr(bound, "metadata", ()) or [bound]:
            if isinstance(one, annotated_types.Ge):
                ends.append(float(one.ge))
            elif isinstance(one, annotated_types.Gt):
                ends.append(float(one.gt) + step)
            elif isinstance(one, annotated_types.Le):
                ends.append(float(one.le))
            elif isinstance(one, annotated_types.Lt):
                ends.append(float(one.lt) - step)
    values = [*ends, 0.0, 1.0, -1.0, 0.05, 3.0, 1e3]
    return [str(int(value)) if whole else repr(value) for value in dict.fromkeys(values)]


def values_of(annotation: Any, bounds: list[Any]) -> list[str]:
    """What to try in a field of that type."""
    if get_origin(annotation) is Literal:
        return [f'"{value}"' for value in get_args(annotation)]
    if annotation is bool:
        return ["true", "false"]
    if annotation in (int, float):
        return numbers(bounds, annotation is int)
    return [value for inner in get_args(annotation) for value in values_of(inner, [*bounds, annotation])]


def changes_in(value: Any, path: str) -> Iterator[list[Change]]:
    """The changes that can be made to each field below a value of a plan."""
    if isinstance(value, BaseModel):
        for name, field in type(value).model_fields.items():
            if path or name not in NOT_FLOWN:
                here = f"{path}.{field.alias or name}".lstrip(".")
                yield [(here, text) for text in values_of(field.annotation, list(field.metadata))]
                yield from changes_in(getattr(value, name), here)
    elif isinstance(value, dict):
        for key, inner in value.items():
            yield from changes_in(inner, f"{path}.{key}")
    elif isinstance(value, list | tuple):
        for n, inner in enumerate(value):
            yield from changes_in(inner, f"{path}.{n}")
    elif isinstance(value, float | int) and path.rsplit(".", 1)[-1].isdigit():
        yield [(path, text) for text in numbers([], whole=isinstance(value, int))]


def gains_of(scheme: str) -> Iterator[list[Change]]:
    """The changes that can be made to each gain, given in the scenario or not."""
    for name in find(scheme).gains_type._fields:
        yield [(f"gains.{name}", text) for text in numbers([], whole=False)]


def fields() -> list[tuple[str, str, list[Change]]]:
    """Scenario, form and the changes to one of its fields."""
    found = []
    for name in shipped():
        for form in ("flight", "monograph"):
            try:
                plan = load(name, form=form).plan
            except ScenarioError:
                continue
            changes = [*changes_in(plan, ""), *gains_of(plan.scheme)]
            found += [(name, form, of_field) for of_field in changes if of_field]
    return found


FIELDS = fields()


@strategies.composite
def scenarios(draw: strategies.DrawFn) -> tuple[str, str, list[Change]]:
    """A scenario, a form, and one or two changes."""
    name, form, changes = draw(strategies.sampled_from(FIELDS))
    chosen = [draw(strategies.sampled_from(changes))]
    if draw(strategies.booleans()):
        others = [more for other, its_form, more in FIELDS if (other, its_form) == (name, form)]
        chosen.append(draw(strategies.sampled_from(draw(strategies.sampled_from(others)))))
    return name, form, chosen


@pytest.mark.timeout(900)  # alone, it compiles every law
@settings(max_examples=TRIED, derandomize=True, deadline=None, database=None, suppress_health_check=list(HealthCheck))
@given(scenarios())
def test_it_is_refused_with_a_sentence_or_flies(case: tuple[str, str, list[Change]]) -> None:
    name, form, changes = case
    asked = [f"{path}={value}" for path, value in changes]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            mission = resolve(load(name, form=form, settings=asked))
        except ScenarioError as error:
            problems = error.problems
        else:
            problems = []
    if problems:
        assert all(len(problem) > 20 for problem in problems), problems
        return
    ticks = min(mission.timing.ticks, round(SECONDS / mission.timing.period))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        flight = fly_in_memory(replace(mission, timing=mission.timing._replace(ticks=ticks)))
    for uav in mission.uavs:
        assert uav in flight.lost or np.isfinite(flight.column("z", uav)).all()
        assert all(math.isfinite(at) for at, _ in flight.lost.values())


def test_the_fields_of_every_scenario_are_tried() -> None:
    paths = {path for _, _, changes in FIELDS for path, _ in changes}
    assert {"duration", "rates.latency", "gains.k11", "faults.0.bias", "start.uav.1.V", "fire.spread.0"} <= paths
    assert len(paths) > 500
