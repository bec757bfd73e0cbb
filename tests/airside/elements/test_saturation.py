"""Auxiliary systems against closed forms and an independent stiff integrator."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ftcc.airside.elements.saturation import (
    auxiliary_step,
    linear_auxiliary_rate,
    squared_auxiliary_step,
    vector_auxiliary_step,
)
from tests.airside.elements.motion import integrated


def test_linear_auxiliary_settles_at_the_excess():
    """(4.19): xi -> g (sat(u) - u) / k."""
    t = np.linspace(0.0, 1.0, 11)
    (xi,) = integrated(lambda t, y: [linear_auxiliary_rate(y[0], 10.0, -50.0, 0.96, 1.2)], [0.0], t)
    assert xi == pytest.approx(1.2 * (1.0 - np.exp(-10.0 * t)), abs=1e-8)


def stiff(start: float, gain: float, error: float, excess: float, t: float) -> float:
    """(3.54) by an implicit integrator of order 5."""
    solution = solve_ivp(
        lambda _, y: -gain * y - (abs(error * excess) + 0.5 * excess**2) / y + excess,
        (0.0, t),
        [start],
        "Radau",
        rtol=1e-9,
        atol=1e-12,
    )
    return float(solution.y[0, -1])


@pytest.mark.parametrize("step", [auxiliary_step, squared_auxiliary_step])
@pytest.mark.parametrize(("gain", "error", "excess", "t"), [(3.0, 0.4, 0.1, 0.4), (1.1, 0.2, -0.05, 0.6)])
def test_both_auxiliary_systems_converge_to_the_printed_equation(step, gain, error, excess, t):
    """Above the threshold; explicit in the input, implicit in the rest: first order in h."""
    expected = stiff(0.6, gain, error, excess, t)
    assert expected > 0.1
    errors = []
    for h in (1e-3, 5e-4):
        state = 0.6
        for _ in range(round(t / h)):
            state = step(state, gain, error, excess, 0.005, h)
        errors.append(abs(state - expected))
    assert errors[0] < 0.01 * expected
    assert errors[1] == pytest.approx(0.5 * errors[0], rel=0.2)


def test_an_excess_restarts_the_state_at_its_threshold_with_the_sign_of_the_excess():
    """Remark 3.3."""
    tiny = 1e-12
    assert auxiliary_step(0.0, 3.0, 0.0, -0.5, 0.01, tiny) == pytest.approx(-0.01, rel=1e-6)
    assert auxiliary_step(-0.004, 3.0, 0.0, 0.5, 0.01, tiny) == pytest.approx(0.01, rel=1e-6)


def test_below_the_threshold_and_without_excess_the_state_holds():
    assert auxiliary_step(0.004, 3.0, 0.3, 0.0, 0.01, 0.01) == 0.004
    assert squared_auxiliary_step(0.004, 3.0, 0.3, 0.0, 0.01, 0.01) == 0.004


@pytest.mark.parametrize("excess", [0.9, -0.9, 300.0])
def test_deep_saturation_is_stepped_without_bursting(excess):
    """The rate (|E du| + du^2/2)/zeta^2 is 1e4 to 1e9 1/s here; the step is 10 ms."""
    state = 0.01
    for _ in range(100):
        state = auxiliary_step(state, 3.0, 0.5, excess, 0.01, 0.01)
        assert abs(state) <= 0.01 + 1e-12


@pytest.mark.parametrize("start", [0.01, -0.01, 0.003, -0.003])
def test_squared_auxiliary_runs_down_to_its_threshold_and_stays_there_with_its_sign(start):
    state = start
    for _ in range(200):
        state = squared_auxiliary_step(state, 1.1, 5.0, -25.0, 0.005, 0.001)
    assert state == pytest.approx(np.copysign(0.005, start))


def test_squared_auxiliary_decays_with_its_gain_when_saturation_ends():
    state = 0.1
    for _ in range(1000):
        state = squared_auxiliary_step(state, 1.1, 5.0, 0.0, 0.005, 0.001)
    assert state == pytest.approx(0.1 * np.exp(-1.1), rel=2e-3)


@pytest.mark.parametrize("power", [0.3, -1.5])
def test_vector_auxiliary_system_is_its_equation(power):
    """(8.29), (8.41) well above the floor, decaying and growing."""
    excess, start = np.array([0.5, -0.3, 0.2]), np.array([1.0, 0.5, -0.5])

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        return -(2.0 + (power + 0.5 * excess @ excess) / max(y @ y, 1e-4)) * y + excess

    t = np.linspace(0.0, 0.2, 3)
    exact = integrated(rates, list(start), t)[:, -1]
    state = tuple(start.tolist())
    for _ in range(2000):
        state = vector_auxiliary_step(state, 2.0, power, tuple(excess.tolist()), 1e-4, 1e-4)
    assert state == pytest.approx(exact, rel=1e-3)


def test_vector_auxiliary_system_rests_without_excess_and_is_stable_at_its_floor():
    assert vector_auxiliary_step((0.0, 0.0, 0.0), 2.0, 0.0, (0.0, 0.0, 0.0), 1e-4, 0.01) == (0.0, 0.0, 0.0)
    state = (1e-3, 0.0, 0.0)
    for _ in range(50):
        state = vector_auxiliary_step(state, 2.0, 10.0, (0.5, 0.0, 0.0), 1e-4, 0.01)
        assert abs(state[0]) < 0.01
