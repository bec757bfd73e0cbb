"""The test that detects and the comparison of kinds, on made-up residuals."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ftcc.airside.diagnosis.beliefs import KINDS
from ftcc.airside.diagnosis.decision import SLEWS, SUMS, agreeing, follow, gather, kind_of, sum_up
from ftcc.airside.diagnosis.estimator import surprises_of

DT = 0.01
L = 20.0


def test_a_residual_counts_as_far_as_the_other_confirms_it():
    assert agreeing(0.3, 0.5, 0.0) == 0.3
    assert agreeing(0.3, 0.1, 0.0) == 0.1
    assert agreeing(0.3, -0.1, 0.0) == 0.0
    assert agreeing(-0.3, -0.1, 0.0) == -0.1
    # In gusts the motion as it is confirms less: what the air may have hidden counts.
    assert agreeing(0.3, -0.1, 0.25) == pytest.approx(0.15)


def test_the_sum_rises_by_what_exceeds_the_drift_and_never_falls_below_zero():
    total = 0.0
    for _ in range(100):
        total = sum_up(total, 0.02, 0.03, 1.0, DT)
    assert total == 0.0
    for _ in range(30):
        total = sum_up(total, 0.1, 0.03, 1.0, DT)
    assert total == pytest.approx(0.3 * 0.07)
    assert sum_up(0.0, 50.0, 0.03, 1.0, DT) == pytest.approx(DT * 0.97), "no more counts than a full deflection"


def kind(sums: np.ndarray, off: np.ndarray, square: np.ndarray, deviation: float) -> str:
    """The kind that is found with the estimate by least squares, with five independent samples a second."""
    n, y, u, _, uu, uy = sums
    information = np.array([[uu, u], [u, n]]) / deviation**2 * 5.0 * DT
    spread = np.linalg.pinv(information + 1e-6 * np.eye(2))
    a, b = spread @ (np.array([uy, y]) / deviation**2 * 5.0 * DT)
    x, P = np.array([0.0, 1.0 + a, b, 0.0]), np.zeros((4, 4))
    P[1:3, 1:3] = spread
    surprises = surprises_of(x, P, 1.0, 0.0, (0.02, 0.0))
    return KINDS[kind_of(sums, off, square, deviation, surprises, 1.0 + a, b, DT)]


def decided(actual, seconds: float = 4.0, floor: float = 0.01) -> str:
    """The kind found for an actuator that acts as ``actual(t, u)`` under a lively command, with noise."""
    rng = np.random.default_rng(4)
    sums, off, square = np.zeros(SUMS), np.zeros(len(SLEWS)), np.zeros(len(SLEWS))
    slow, lagging = np.full(len(SLEWS), -0.2), np.zeros(len(SLEWS))
    residual = position = 0.0
    u_before = -0.2
    position = u_before
    for n in range(round(seconds / DT)):
        t = n * DT
        u = -0.2 + 0.2 * math.sin(1.5 * t) + 0.1 * math.sin(4.0 * t)
        residual += L * DT * (actual(t, u) - u - residual) + 0.01 * math.sqrt(DT) * rng.standard_normal()
        position += L * DT * (u - position)
        gather(sums, residual, position, DT)
        follow(slow, lagging, off, square, residual, u, 0.7, L, DT)
    return kind(sums, off, square, floor)


class Slow:
    """Follows at 0.1 rad/s."""

    def __init__(self) -> None:
        self.at = -0.2

    def __call__(self, t: float, u: float) -> float:
        self.at += min(max(u - self.at, -0.1 * DT), 0.1 * DT)
        return self.at


@pytest.mark.parametrize(
    ("actual", "expected"),
    [
        (lambda t, u: 0.5 * u, "loss"),
        (lambda t, u: u + 0.15, "bias"),
        (lambda t, u: 0.5 * u + 0.2, "loss and bias"),
        (lambda t, u: -0.2, "stuck"),
        (lambda t, u: 0.0, "floating"),
        (Slow(), "slow"),
    ],
    ids=["loss", "bias", "loss and bias", "stuck", "floating", "slow"],
)
def test_each_kind_is_distinguished_from_the_others(actual, expected):
    assert decided(actual) == expected


def test_at_a_constant_position_a_loss_is_not_told_from_a_bias():
    sums, off, square = np.zeros(SUMS), np.zeros(len(SLEWS)), np.zeros(len(SLEWS))
    slow, lagging = np.full(len(SLEWS), -0.2), np.zeros(len(SLEWS))
    for _ in range(400):
        gather(sums, 0.06, -0.2, DT)
        follow(slow, lagging, off, square, 0.06, -0.2, 0.7, L, DT)
    assert kind(sums, off, square, 0.01) == "none"
