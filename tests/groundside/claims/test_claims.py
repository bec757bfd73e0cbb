"""Metrics and claims on signals whose numbers are known beforehand."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ftcc.groundside.claims.claims import Result, check_claims, evaluate, tolerance_of
from ftcc.groundside.claims.expressions import check_expression, evaluate_expression
from ftcc.groundside.claims.metrics import METRICS
from ftcc.groundside.schema import Claim
from ftcc.link.graph import Graph

GRAPH = Graph((1, 2), (7, 8), {(1, 7): 3.0, (1, 8): 1.0, (2, 1): 1.0, (1, 2): 1.0})
T = np.arange(0, 1001) / 100.0


@dataclass
class Known:
    """A recording of 10 s at 100 Hz."""

    data: dict[tuple[str, int], NDArray[np.float64]] = field(default_factory=dict)

    @property
    def uavs(self) -> tuple[int, ...]:
        return (1, 2, 7, 8)

    @property
    def names(self) -> tuple[str, ...]:
        return ("t", "z", "x")

    def column(self, name: str, uav: int) -> NDArray[np.float64]:
        if name == "t":
            return T[: len(self.data[("z", uav)])]
        return self.data[(name, uav)]


@pytest.fixture
def known() -> Known:
    return Known(
        {
            ("z", 7): np.full(1001, 1100.0),
            ("z", 8): 1000.0 + 0.0 * T,
            ("z", 1): 1075.0 + np.exp(-T),
            ("z", 2): 1075.0 + 30.0 * (T < 1.0),
            ("x", 1): np.sin(2.0 * math.pi * T),
            ("x", 2): 2.0 * np.sin(2.0 * math.pi * T),
        }
    )


STANDARD: dict[str, Any] = {
    "name": "claim",
    "metric": "max_abs",
    "signal": "x",
    "window": (0.0, 10.0),
    "source": "here",
    "expected": {"flight": 2.0},
    "tolerance": "1 %",
}


def result(known: Known, **fields: Any) -> Result:
    (one,) = evaluate(known, [Claim.model_validate(STANDARD | fields)], "flight", GRAPH)
    return one


def test_the_containment_point_is_the_hull_weights_combination_of_the_leaders(known: Known) -> None:
    np.testing.assert_allclose(evaluate_expression("z_d", known, GRAPH, 1), 1075.0)
    np.testing.assert_allclose(evaluate_expression("z - z_d", known, GRAPH, 1), np.exp(-T), atol=1e-9)
    assert evaluate_expression("hull_distance", known, GRAPH, 2)[[0, 99, 100]].tolist() == [5.0, 5.0, 0.0]


def test_the_same_holds_for_forward_positions(known: Known) -> None:
    known.data |= {("x", 7): 30.0 * T, ("x", 8): 30.0 * T + 100.0, ("x", 2): 30.0 * T - 20.0 * (T < 1.0)}
    np.testing.assert_allclose(evaluate_expression("x_d", known, GRAPH, 1), 30.0 * T + 25.0)
    assert evaluate_expression("hull_distance_x", known, GRAPH, 2)[[0, 99, 100]].tolist() == [20.0, 20.0, 0.0]


@pytest.mark.parametrize(
    ("metric", "threshold", "value"),
    [
        ("max_abs", None, 1.0),
        ("max", None, 1.0),
        ("min", None, -1.0),
        ("mean", None, 0.0),
        ("std", None, math.sqrt(0.5)),
        ("rms", None, math.sqrt(0.5)),
        ("peak_to_peak", None, 2.0),
        ("departure", 1.0, 1.0),
        ("integral_of_square", None, 5.0),
        ("first_time", 0.5, 0.09),
        ("time_until_below", 1.5, 0.0),
        ("duration_above", 0.5, 3.3),
        ("first_time_within", 0.5, 0.0),
        ("mean_change", None, 0.04),
        ("last_time", None, 10.0),
    ],
)
def test_metrics_of_a_sine(known: Known, metric: str, threshold: float | None, value: float) -> None:
    found = METRICS[metric].function(T, known.column("x", 1), threshold or 0.0)
    assert found == pytest.approx(value, abs=0.011)


def test_time_until_below_counts_from_the_windows_beginning_to_the_last_exceedance(known: Known) -> None:
    one = result(
        known,
        metric="time_until_below",
        signal="z - z_d",
        uavs=[1],
        window=[2.0, 9.0],
        threshold=0.05,
        expected={"flight": math.log(20.0) - 2.0},
        tolerance="0.01",
    )
    assert one.ok


def test_a_signal_that_never_settles_fails(known: Known) -> None:
    one = result(known, metric="time_until_below", threshold=0.0001, uavs=[1], signal="1 + x / 10", tolerance="< 5")
    assert (one.value, one.ok) == (None, False)


def test_time_until_settled_counts_until_the_signal_stays_near_its_last_fifth(known: Known) -> None:
    """exp(-t) stays within 0.05 of its mean over 8-10 s, 1e-4, from ln 20 on."""
    settled = METRICS["time_until_settled"].function
    assert settled(T, np.exp(-T), 0.05) == pytest.approx(math.log(20.0), abs=0.02)
    assert settled(T + 30.0, 7.0 - np.exp(-T), 0.05) == pytest.approx(math.log(20.0), abs=0.02)
    assert settled(T, T, 0.5) == math.inf


def test_departure_is_measured_from_the_mean_before(known: Known) -> None:
    """A ramp over 10 s: 9 above its mean over the first 2 s."""
    assert METRICS["departure"].function(T + 29.0, 5.0 + T, 2.0) == pytest.approx(9.0)


def test_an_expression_may_look_at_another_uav_at_the_same_times(known: Known) -> None:
    np.testing.assert_allclose(evaluate_expression("z - z[7]", known, GRAPH, 1), np.exp(-T) - 25.0)
    known.data[("z", 7)] = known.data[("z", 7)][:501]
    np.testing.assert_array_equal(np.isnan(evaluate_expression("z - z[7]", known, GRAPH, 1)), T > 5.0)
    claim = Claim.model_validate(STANDARD | {"signal": "z - z[3]"})
    assert check_claims([claim], GRAPH, ["z"]) == ["claims.0 (claim): uavs 3 do not exist"]


def test_the_worst_uav_decides(known: Known) -> None:
    assert result(known).value == pytest.approx(2.0)
    farthest = result(known, metric="value_at", window=[0.25, 0.25], expected={"flight": 1.0}, tolerance="0.1")
    assert (farthest.value, farthest.ok) == (pytest.approx(2.0), False)


def test_a_list_gives_every_uav_its_own_expected_value(known: Known) -> None:
    one = result(known, metric="value_at", window=[0.25, 0.25], expected={"flight": [1.0, 2.0]}, tolerance="1e-9")
    assert (one.value, one.ok) == (pytest.approx([1.0, 2.0]), True)
    one = result(known, metric="value_at", window=[0.25, 0.25], expected={"flight": [1.0, 1.0]}, tolerance="1e-9")
    assert one.ok is False


def test_a_window_that_was_not_flown_is_neither_held_nor_failed(known: Known) -> None:
    one = result(known, window=[5.0, 20.0])
    assert (one.value, one.ok) == (None, None)


def test_a_uav_that_was_lost_before_the_end_of_the_window_fails(known: Known) -> None:
    known.data[("z", 2)] = known.data[("z", 2)][:300]
    known.data[("x", 2)] = known.data[("x", 2)][:300]
    assert result(known, window=[1.0, 5.0]).ok is False
    assert result(known, window=[1.0, 2.0]).ok is True


def test_nan_fails(known: Known) -> None:
    known.data[("x", 2)][500] = math.nan
    one = result(known)
    assert (one.value, one.ok) == (None, False)


@pytest.mark.parametrize(
    ("text", "value", "allowed"),
    [
        ("15 %", 2.3, True),
        ("15 %", 1.69, False),
        ("0.02", 2.02, True),
        ("0.02", 1.97, False),
        ("0", 2.0, True),
        ("0", 2.0001, False),
        ("10 % or 0.01", 2.2, True),
        ("10 % or 0.3", 2.3, True),
        ("10 % or 0.3", 2.31, False),
        ("< 0.05", 0.04, True),
        ("< 0.05", 0.05, False),
        ("> 3", 3.5, True),
        ("< 1.5 x", 2.9, True),
        ("< 1.5 x", 3.1, False),
        ("15 %", math.nan, False),
        ("< 5", -math.inf, False),
    ],
)
def test_tolerances(text: str, value: float, allowed: bool) -> None:
    assert tolerance_of(text).allows(value, 2.0) is allowed


@pytest.mark.parametrize(
    "text", ["", "x", "15 % x", "< 5 %", "1.5 x", "-3", "1e", "about 3", "0.2 or 3", "< 3 or 4", "10 % or"]
)
def test_no_tolerance(text: str) -> None:
    with pytest.raises(ValueError, match="is not a tolerance"):
        tolerance_of(text)


@pytest.mark.parametrize(
    "expression",
    [
        "z.__class__",
        "z[-1]",
        "z[x]",
        "z[1:2]",
        "(z + x)[1]",
        "(lambda: 1)()",
        "z if z else x",
        "'a'",
        "open('x')",
        "z == x",
        "z +",
        "f(x)",
        "True",
        "z;x",
    ],
)
def test_expressions_are_arithmetic_and_nothing_else(expression: str) -> None:
    with pytest.raises(ValueError, match=r"arithmetic|functions|operators|number|not an expression|z\[4\]"):
        check_expression(expression, ["z", "x"])


def test_expressions_compute(known: Known) -> None:
    np.testing.assert_allclose(
        evaluate_expression("max(abs(-x) ** 2 / 4, 0.1) + 1", known, GRAPH, 2),
        np.maximum(known.column("x", 2) ** 2 / 4, 0.1) + 1,
    )
    assert np.isinf(evaluate_expression("1 / 0", known, GRAPH, 1)).all()


def test_swarm_functions_look_at_all_followers_and_at_the_neighbours(known: Known) -> None:
    """x of UAV 2 is twice that of UAV 1; each hears the other with weight 1, and leaders do not count."""
    x = known.column("x", 1)
    np.testing.assert_allclose(evaluate_expression("total(x ** 2)", known, GRAPH, 2), 5.0 * x**2)
    np.testing.assert_allclose(evaluate_expression("largest(abs(x))", known, GRAPH, 1), 2.0 * abs(x))
    np.testing.assert_allclose(evaluate_expression("disagreement(x)", known, GRAPH, 1), -x)
    np.testing.assert_allclose(
        evaluate_expression("total(3 * x + disagreement(x))", known, GRAPH, 1), 9.0 * x, atol=1e-12
    )
    assert check_claims([Claim.model_validate(STANDARD | {"signal": "total(y)"})], GRAPH, known.names)
    with pytest.raises(ValueError, match="total takes one argument"):
        check_expression("total(x, z)", known.names)


def test_angles_on_both_sides_of_half_a_turn_are_near_each_other(known: Known) -> None:
    """x stands for a bank: 3.1 rad of UAV 1, -3.1 of UAV 2; both hear one another with weight 1."""
    for uav, bank in ((1, 3.1), (2, -3.1)):
        known.data[("x", uav)] = np.full(len(T), bank)
    apart = 6.2 - 2.0 * math.pi
    np.testing.assert_allclose(evaluate_expression("wrapped(x - x[2])", known, GRAPH, 1), apart)
    np.testing.assert_allclose(evaluate_expression("turn_disagreement(x)", known, GRAPH, 1), apart)
    np.testing.assert_allclose(evaluate_expression("turn_disagreement(x)", known, GRAPH, 2), -apart)
    assert evaluate_expression("wrapped(x)", known, GRAPH, 1)[0] == 3.1, "what is within half a turn stays"


def test_when_a_uav_was_lost_can_be_claimed_of_a_flight_that_was_long_enough(known: Known) -> None:
    for name in ("z", "x"):
        known.data[(name, 2)] = known.data[(name, 2)][:691]
    claim = Claim.model_validate(STANDARD | {"metric": "last_time", "signal": "t", "tolerance": "< 8"})
    (one,) = evaluate(known, [claim], "flight", GRAPH, duration=10.0)
    assert (one.value, one.ok) == (6.9, True)
    (short,) = evaluate(known, [claim], "flight", GRAPH, duration=9.0)
    assert short.ok is None, "not flown"


def test_first_time_within_a_threshold() -> None:
    assert METRICS["first_time_within"].function(T, 2.0 - T, 0.5) == pytest.approx(1.5)
    assert METRICS["first_time_within"].function(T, 2.0 + T, 0.5) == math.inf
