"""What counts as a limit cycle, on signals whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from ftcc.groundside.verdict.oscillation import is_forced, oscillation

T = np.arange(0.0, 300.0, 0.01)
NOISE = np.random.default_rng(1).normal(size=len(T))


@pytest.mark.parametrize("frequency", [0.8, 6.0, 40.0])
def test_a_sine_is_told_by_frequency_and_amplitude(frequency: float) -> None:
    found = oscillation(T, 5.0 + 0.3 * np.sin(frequency * T), floor=0.05)
    assert found is not None
    # A line of the spectrum is 2 pi over a third of the flight wide.
    assert found.frequency == pytest.approx(frequency, abs=0.04)
    assert found.amplitude == pytest.approx(0.3, rel=0.05)


def test_a_cycle_between_limits_and_one_that_begins_late_or_grows_are_found() -> None:
    cycling = np.sign(np.sin(6.0 * T))
    assert oscillation(T, cycling, 0.1) is not None
    assert oscillation(T, np.where(T > 230.0, cycling, 0.0), 0.1) is not None
    assert oscillation(T, np.exp((T - 300.0) / 30.0) * np.sin(6.0 * T), 0.1) is not None


@pytest.mark.parametrize(
    "signal",
    [
        np.sin(6.0 * T) * np.exp(-(T - 200.0) / 40.0),
        np.where((T > 210.0) & (T < 230.0), np.sin(6.0 * T), 0.0),
        np.sin(0.4 * T),
        0.02 * T + np.where(T > 250.0, 1.0, 0.0),
        np.exp(-((T - 260.0) ** 2) / 50.0),
        NOISE,
        np.cumsum(NOISE) / 10.0,
        NOISE + 0.3 * np.sin(6.0 * T),
        0.09 * np.sin(6.0 * T),
        np.full(len(T), 1e3) + 1e-5 * NOISE,
    ],
    ids=["decays", "burst", "drift", "step", "manoeuvre", "noise", "walk", "buried in noise", "ripple", "rounding"],
)
def test_what_is_no_limit_cycle(signal: np.ndarray) -> None:
    assert oscillation(T, signal, floor=0.1) is None


def test_too_few_rows_or_rows_that_are_not_numbers() -> None:
    assert oscillation(T[:60], np.sin(6.0 * T[:60])) is None
    assert oscillation(T, np.full(len(T), np.nan)) is None
    cut = np.where(T > 299.9, np.nan, np.sin(6.0 * T))
    assert oscillation(T, cut, 0.1) is not None


def test_an_answer_comes_at_the_commanded_frequency_or_a_multiple() -> None:
    assert [is_forced(frequency, [0.5]) for frequency in (0.5, 0.99, 1.5, 0.7, 6.0)] == [True] * 3 + [False] * 2
    assert not is_forced(0.5, [])
