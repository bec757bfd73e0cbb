"""Distributions: what they give, and every wrong word about them."""

from __future__ import annotations

import pickle
import tomllib
from typing import Any

import numpy as np
import pytest
from scipy import stats

from ftcc.groundside.statistics import Design, Distribution, DistributionError, distribution_of

pytestmark = pytest.mark.filterwarnings("error")

GRID = np.linspace(0.0005, 0.9995, 1000)


@pytest.mark.parametrize(
    ("text", "law"),
    [
        ("uniform(loc=0.3, scale=0.7)", stats.uniform(0.3, 0.7)),
        ("uniform(low=0.3, high=1)", stats.uniform(0.3, 0.7)),
        ("normal(loc=3, scale=0.5)", stats.norm(3, 0.5)),
        ("norm()", stats.norm()),
        ("truncnorm(a=-2, b=2, loc=5, scale=0.1)", stats.truncnorm(-2, 2, 5, 0.1)),
        ("loguniform(a=1e-3, b=10)", stats.loguniform(1e-3, 10)),
        ("beta(a=2, b=3)", stats.beta(2, 3)),
    ],
)
def test_quantiles_and_places_are_those_of_scipy(text: str, law: Any) -> None:
    found = distribution_of(text, "test")
    values = found.values(GRID)
    assert all(type(value) is float for value in values)
    assert values == pytest.approx(law.ppf(GRID), rel=1e-12)
    assert [found.place(value) for value in values] == pytest.approx(GRID, abs=1e-9)
    assert found.ordered


def test_integers_are_those_of_numpy() -> None:
    die = distribution_of("integers(low=1, high=6, endpoint=true)", "test")
    values = die.values(GRID)
    assert all(type(value) is int for value in values)
    assert np.unique(values).tolist() == [1, 2, 3, 4, 5, 6]
    assert np.bincount(values)[1:] == pytest.approx(1000 / 6, abs=1)
    assert [die.place(k) for k in (1, 2, 6)] == pytest.approx([1 / 12, 3 / 12, 11 / 12])
    assert max(distribution_of("integers(low=1, high=6)", "test").values(GRID)) == 5
    assert die.values([0.0]) == [1]


def test_discrete_distributions_give_whole_numbers() -> None:
    found = distribution_of({"distribution": "poisson", "mu": 3}, "test")
    values = found.values(GRID)
    assert all(type(value) is int for value in values)
    assert values == stats.poisson(3).ppf(GRID).tolist()
    assert found.place(2) == pytest.approx(stats.poisson(3).cdf(1) + 0.5 * stats.poisson(3).pmf(2))


def test_a_choice_of_words_keeps_their_order() -> None:
    parts = distribution_of('choice(values=["thrust", "elevator"], p=[0.7, 0.3])', "test")
    assert parts.values([0.0, 0.69, 0.71, 0.99]) == ["thrust", "thrust", "elevator", "elevator"]
    assert [parts.place(part) for part in ("thrust", "elevator")] == pytest.approx([0.35, 0.85])
    assert not parts.ordered


def test_a_choice_of_numbers_is_in_the_order_of_their_size() -> None:
    uavs = distribution_of("choice([8, 1, 2.5], p=[0.5, 0.2, 0.3])", "test")
    assert uavs.values([0.1, 0.3, 0.6]) == [1, 2.5, 8]
    assert [type(value) for value in uavs.values([0.1, 0.3])] == [int, float]
    assert uavs.place(2.5) == pytest.approx(0.35)
    assert uavs.ordered


def test_a_choice_may_be_of_true_and_false() -> None:
    switch = distribution_of("choice([true, False])", "test")
    assert switch.values([0.4, 0.6]) == [True, False]
    assert not switch.ordered
    with pytest.raises(DistributionError, match="1 is none of"):
        switch.place(1)


def test_what_has_no_probability_is_never_drawn() -> None:
    assert set(distribution_of("choice([1, 2, 3], p=[0, 1, 0])", "test").values([0.0, 0.5, 0.999999])) == {2}


def test_toml_and_the_command_line_say_the_same() -> None:
    table = tomllib.loads('x = { distribution = "choice", values = ["a", "b"], p = [0.25, 0.75] }')["x"]
    found = distribution_of(table, "test")
    assert found == distribution_of('choice(["a", "b"], p=[0.25, 0.75])', "test")
    assert found.text == "choice(values=['a', 'b'], p=[0.25, 0.75])"


@pytest.mark.parametrize(
    "text", ["uniform(loc=0.3, scale=0.7)", "integers(low=1, high=3, endpoint=true)", "choice(values=['a', true, -2])"]
)
def test_the_text_can_be_read_again(text: str) -> None:
    found = distribution_of(text, "test")
    assert found.text == text
    assert distribution_of(found.text, "test") == found
    assert pickle.loads(pickle.dumps(found)) == found


def test_a_design_draws_from_it() -> None:
    points = Design("sobol", 1, 1, 1024).points(0, 1024)
    assert np.std(distribution_of("normal(scale=2)", "test").values(points)) == pytest.approx(2.0, rel=0.01)


@pytest.mark.parametrize(
    ("spec", "says"),
    [
        ("unifrm(low=0, high=1)", "no distribution 'unifrm'; near it: .*uniform"),
        ({"distribution": "nosuch"}, "no distribution 'nosuch'"),
        ({"low": 0, "high": 1}, 'the name is missing, such as distribution = "uniform"'),
        ({"distribution": 3}, "the name is missing"),
        ("uniform", "must be such as uniform"),
        ("uniform(low=0, high=1", "must be such as"),
        ("stats.uniform()", "must be such as"),
        ("uniform()()", "must be such as"),
        ("(" * 5000, "must be such as"),
        ("uniform(\0)", "must be such as"),
        ("uniform(**{'low': 0})", "must be such as"),
        ("uniform(0, 1)", "need their names: loc, scale, or low, high"),
        ("choice([1], [1])", "need their names: values, p"),
        ("uniform(low=0, low=1, high=2)", "low of uniform stands twice"),
        ("uniform(low=0, hihg=1)", "no parameter 'hihg' here; it takes loc, scale, or low, high"),
        ("uniform(low=0, scale=1)", "no parameter 'scale' here"),
        ("uniform(low=0)", "uniform needs high"),
        ("truncnorm(loc=1)", "truncnorm needs a and b; it takes a, b, loc, scale"),
        ("poisson(mu=1, scale=2)", "poisson has no parameter 'scale'"),
        ("uniform(low=__import__('os').getpid(), high=1)", "must be a number, a word in quotes"),
        ("uniform(low=1+1, high=9)", r"1 \+ 1 must be a number"),
        ("normal(loc='3')", "loc = '3' of normal must be a number"),
        ("normal(loc=true)", "loc = True of normal must be a number"),
        ("normal(loc=nan)", "nan must be a number"),
        ({"distribution": "normal", "loc": float("nan")}, "loc = nan of normal must be finite"),
        ({"distribution": "normal", "loc": float("-inf")}, "loc = -inf of normal must be finite"),
        ("normal(loc=1e999)", "loc = inf of normal must be finite"),
        ({"distribution": "normal", "loc": 10**400}, "must be finite"),
        ("normal(scale=0)", "scale = 0 of normal must be greater than 0"),
        ("normal(scale=-1)", "scale = -1 of normal"),
        ("uniform(low=1, high=1)", "low = 1 must be less than high = 1"),
        ("beta(a=-1, b=2)", "no beta with a = -1, b = 2; see scipy.stats.beta"),
        ("truncnorm(a=2, b=1)", "no truncnorm with a = 2, b = 1"),
        ("binom(n=2.5, p=0.5)", "no binom with n = 2.5"),
        ("poisson(mu=1, loc=0.5)", "loc = 0.5 of poisson must be a whole number"),
        ("pareto(b=0.001)", "no finite quantile"),
        ("integers(low=1.0, high=3)", "low = 1.0 of integers must be a whole number"),
        ("integers(low=3, high=3)", "must be less than high = 3, which is excluded unless endpoint = true"),
        ("integers(low=4, high=3, endpoint=true)", "low = 4 of integers must be less than high = 3$"),
        ("integers(low=1, high=3, endpoint=1)", "endpoint = 1 of integers must be true or false"),
        ("integers(low=1)", "integers needs high"),
        ("choice()", "choice needs values"),
        ("choice([])", r"values = \[\] of choice must be a list"),
        ("choice('ab')", "values = 'ab' of choice must be a list"),
        ("choice([[1], [2]])", r"\[1\] of choice must be a finite number, a word, true or false"),
        ("choice([1e999])", "inf of choice must be a finite number"),
        ("choice([1, 1.0])", "must differ"),
        ("choice([1, 2], p=[1])", "must be a list of 2 probabilities"),
        ("choice([1, 2], p=[1.5, -0.5])", "1.5 in p of choice must be a probability"),
        ({"distribution": "choice", "values": [1, 2], "p": [float("nan"), 1]}, "nan in p of choice"),
        ("choice([1, 2], p=[0.5, 0.6])", "adds up to 1.1; it must be 1"),
    ],
)
def test_what_cannot_be_drawn_is_refused(spec: Any, says: str) -> None:
    with pytest.raises(DistributionError, match=says) as refused:
        distribution_of(spec, "study.random.wind.mean")
    assert str(refused.value).startswith("study.random.wind.mean: ")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("point", [-0.1, 1.0, float("nan")])
def test_points_are_inside_the_unit_interval(point: float) -> None:
    with pytest.raises(DistributionError, match="points must be from 0 to below 1"):
        Distribution("norm", {}).values([0.5, point])


def test_a_quantile_that_is_infinite_is_refused() -> None:
    with pytest.raises(DistributionError, match="no finite quantile at 0"):
        distribution_of("norm()", "test").values([0.5, 0.0])


@pytest.mark.parametrize("value", ["x", True, float("nan"), None, 10**400])
def test_a_value_that_is_no_number_has_no_place(value: Any) -> None:
    with pytest.raises(DistributionError, match="is no value of"):
        distribution_of("norm()", "test").place(value)
