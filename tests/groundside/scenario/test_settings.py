"""Settings of a script: nested, dotted or as texts, they are the same scenario and the same errors."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftcc.groundside.scenario import ScenarioError, load, setting_texts

THREE_WAYS = [
    {"gains": {"k11": 3.0}, "faults": {0: {"effectiveness": 0.5}}, "switches": {"fault_tolerance": False}},
    {"gains.k11": 3.0, "faults.0.effectiveness": 0.5, "switches.fault_tolerance": False},
    ["gains.k11=3.0", "faults.0.effectiveness=0.5", "switches.fault_tolerance=false"],
]


@pytest.mark.parametrize("settings", THREE_WAYS, ids=["nested", "dotted", "texts"])
def test_nested_tables_dotted_keys_and_texts_are_the_same(settings: Any) -> None:
    scenario = load("containment", settings=settings)
    assert scenario.settings == tuple(THREE_WAYS[2])
    assert (scenario.plan.gains.common["k11"], scenario.plan.faults[0].effectiveness) == (3.0, 0.5)
    assert scenario.document == load("containment", settings=THREE_WAYS[2]).document


def test_a_single_text_is_one_setting_and_variants_may_be_one_text() -> None:
    scenario = load("containment", variants="loss30, off", settings="gains.k11=3.0")
    assert scenario.plan.gains.common["k11"] == 3.0
    assert scenario.variants == load("containment", variants=["off", "loss30"]).variants


def test_numbers_of_numpy_are_numbers() -> None:
    values = {"gains": {"k11": np.float64(3.0)}, "faults": {np.int64(0): {"uav": np.int32(2)}}, "seed": np.uint8(7)}
    assert setting_texts(values) == ("gains.k11=3.0", "faults.0.uav=2", "seed=7")
    assert setting_texts({"switches.fault_tolerance": np.bool_(False)}) == ("switches.fault_tolerance=false",)


VALUES = st.recursive(
    st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(exclude_categories=["Cs"])),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.lists(st.dictionaries(st.from_regex(r"[^.=\s]+", fullmatch=True), inner, max_size=3), max_size=2)
    ),
    max_leaves=6,
)


@given(VALUES)
def test_a_value_arrives_as_it_was_given(value: Any) -> None:
    (text,) = setting_texts({"key.path": value})
    key, _, given_value = text.partition("=")
    assert key == "key.path"
    arrived = tomllib.loads(f"value = {given_value}")["value"]
    assert arrived == value
    assert type(arrived) is type(value)


@pytest.mark.parametrize(
    ("settings", "parts"),
    [
        ({"gains": {"k11": float("nan")}}, ["gains.k11 = nan", "finite"]),
        ({"faults": {0: {"bias": np.float32("inf")}}}, ["faults.0.bias = inf", "finite"]),
        ({"leaders.7.V": [20.0, float("-inf")]}, ["leaders.7.V.1 = -inf", "finite"]),
        ({"gains": {"k11": None}}, ["gains.k11 = None", "must be a number, text"]),
        ({"gains": {"k11": np.zeros(3)}}, ["gains.k11 = array", "must be a number, text"]),
        ({"gains": {"k11": 1j}}, ["gains.k11 = 1j", "must be a number, text"]),
        ({"gains": {True: 1.0}}, ["settings gains: key True", "must be a name"]),
        ({"gains=": 1.0}, ["key 'gains='", "must be a name"]),
        ({"gains..k11": 1.0}, ["key 'gains..k11'", "must be a name"]),
        ({"": 1.0}, ["key ''", "must be a name"]),
        ([3.0], ["settings: 3.0", "must be a text"]),
    ],
)
def test_what_toml_does_not_have_is_refused_with_its_key(settings: Any, parts: list[str]) -> None:
    with pytest.raises(ScenarioError) as refused:
        load("containment", settings=settings)
    for part in ["containment.toml", *parts]:
        assert part in str(refused.value)


@pytest.mark.parametrize(
    ("mapping", "text"),
    [
        ({"gains": {"k99": 3.0}}, "gains.k99=3.0"),
        ({"rates": {"control_rate": -1}}, "rates.control_rate=-1"),
        ({"faults": {9: {"effectiveness": 0.5}}}, "faults.9.effectiveness=0.5"),
        ({"scheme": 'no "such" scheme'}, 'scheme="no \\"such\\" scheme"'),
    ],
)
def test_errors_are_those_of_the_command_line(mapping: Any, text: str) -> None:
    from ftcc.groundside.scenario import resolve

    said = []
    for settings in (mapping, [text]):
        with pytest.raises(ScenarioError) as refused:
            resolve(load("containment", settings=settings))
        said.append(str(refused.value))
    assert said[0] == said[1]
