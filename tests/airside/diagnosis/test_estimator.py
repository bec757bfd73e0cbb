"""The joint filter against the two-stage filter of the literature, written independently, and against least squares."""

from __future__ import annotations

import numpy as np
import pytest

from ftcc.airside.diagnosis.estimator import RHO, STATES, B, C, Y, correct, predict, widen

DT = 0.01


def data(ticks: int, seed: int = 1):
    """Steps, drifts, positions of an actuator of effectiveness 0.6 and bias 0.1 with noisy measurements."""
    rng = np.random.default_rng(seed)
    t = np.arange(ticks) * DT
    positions = -0.2 + 0.15 * np.sin(2.0 * t) + 0.05 * np.sin(7.0 * t)
    drifts = 0.2 * np.cos(0.5 * t)
    motion = np.concatenate([[0.0], np.cumsum(DT * (drifts + 0.6 * positions + 0.1))])
    measured = motion + 0.001 * rng.standard_normal(ticks + 1)
    return np.diff(measured), drifts, positions


def two_stage(steps, drifts, positions, noise, spread, p_rho, p_b):
    """Bias-free filter, bias filter and their coupling, eqs. (8)-(20) of Wu, Zhang, Zhou 2000, for a constant bias."""
    x, P = 0.0, 2.0 * noise * noise
    b, Pb = np.array([1.0, 0.0]), np.diag([p_rho**2, p_b**2])
    V = np.zeros(2)
    rows = []
    for step, drift, position in zip(steps, drifts, positions, strict=True):
        E = DT * np.array([position, 1.0])
        # Bias-free prediction: the bias enters by the coupling alone, so V(k+1|k) = W(k) = V(k|k) + E.
        W = V + E
        x = x + DT * drift - step
        P = P + spread**2 * DT
        H = W
        S = P + noise**2
        r = -x
        Kb = Pb @ H / (H @ Pb @ H + S)
        b = b + Kb * (r - H @ b)
        Pb = Pb - np.outer(Kb, H @ Pb)
        K = P / S
        x, P = x + K * r, (1.0 - K) * P
        V = W - K * H
        rows.append((*b, x + V @ b))
    return np.array(rows), Pb


def test_the_joint_filter_is_the_two_stage_filter():
    noise, spread, p_rho, p_b = 0.001, 0.002, 0.6, 0.3
    steps, drifts, positions = data(800)
    expected, covariance = two_stage(steps, drifts, positions, noise, spread, p_rho, p_b)
    x = np.zeros(STATES)
    x[RHO] = 1.0
    P = np.zeros((STATES, STATES))
    P[Y, Y], P[RHO, RHO], P[B, B] = 2.0 * noise * noise, p_rho**2, p_b**2
    for n in range(len(steps)):
        predict(x, P, DT, steps[n], drifts[n], 0.0, positions[n], spread)
        correct(x, P, noise, True)
        np.testing.assert_allclose([x[RHO], x[B], x[Y]], expected[n], rtol=1e-7, atol=1e-10)
    np.testing.assert_allclose(P[1:3, 1:3], covariance, rtol=1e-6)
    assert x[RHO] == pytest.approx(0.6, abs=3.0 * np.sqrt(P[RHO, RHO]))
    assert x[B] == pytest.approx(0.1, abs=3.0 * np.sqrt(P[B, B]))


def test_without_excitation_effectiveness_stays_undetermined():
    """At a constant position only the sum of loss and bias is seen: the covariance says so."""
    x, P = np.zeros(STATES), np.diag([1e-6, 0.36, 0.09, 0.0])
    x[RHO] = 1.0
    for _ in range(1000):
        predict(x, P, DT, DT * (-0.14 + 0.1), 0.0, 0.0, -0.2, 1e-4)
        correct(x, P, 1e-4, True)
    total = x[RHO] * -0.2 + x[B]
    assert total == pytest.approx(-0.04, abs=1e-3)
    assert np.sqrt(P[RHO, RHO]) > 0.5
    seen = np.array([-0.2, 1.0])
    assert np.sqrt(seen @ P[1:3, 1:3] @ seen) < 1e-3


def test_what_is_considered_is_not_learned_but_counted():
    steps, drifts, positions = data(400)
    x, P = np.zeros(STATES), np.diag([1e-6, 0.01, 0.09, 0.01])
    x[RHO] = 1.0
    other, Q = x.copy(), P.copy()
    Q[C, C] = Q[RHO, RHO] = 0.0
    for n in range(len(steps)):
        for state, covariance in ((x, P), (other, Q)):
            predict(state, covariance, DT, steps[n], drifts[n], 0.3, positions[n], 1e-3)
            correct(state, covariance, 1e-3, False)
    assert (x[RHO], x[C]) == (1.0, 0.0)
    assert P[RHO, RHO] == 0.01
    assert P[C, C] == 0.01
    assert P[B, B] > 10.0 * Q[B, B]
    np.testing.assert_allclose(P, P.T, atol=1e-15)


def test_the_stated_band_covers_the_truth_in_95_of_100():
    inside = 0
    for seed in range(300):
        steps, drifts, positions = data(300, seed)
        x, P = np.zeros(STATES), np.diag([2e-6, 0.36, 0.09, 0.0])
        x[RHO] = 1.0
        for n in range(len(steps)):
            predict(x, P, DT, steps[n], drifts[n], 0.0, positions[n], 0.0)
            correct(x, P, 0.001, True)
        inside += abs(x[RHO] - 0.6) < 2.0 * np.sqrt(P[RHO, RHO])
    assert 0.92 * 300 < inside < 0.985 * 300


def test_widening_makes_room_for_a_jump():
    P = np.zeros((STATES, STATES))
    widen(P, B, 0.3)
    assert P[B, B] == pytest.approx(0.09)
    assert np.count_nonzero(P) == 1
