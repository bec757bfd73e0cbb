"""The fractional operator against exact solutions, and beside Gruenwald-Letnikov."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ftcc.airside.elements.fractional import (
    COLUMNS,
    fractional_integral,
    fractional_rate,
    number_of_poles,
    remember,
    set_poles,
)
from ftcc.link.compiled import compiled

WIDE, NARROW = (1e-3, 1e3, 3.0), (1e-3, 30.0, 2.0)
"""Slowest and fastest pole (rad/s), poles per decade: of plant A and of plant B."""

H = 0.01
T = np.arange(0.0, 60.0 + 0.5 * H, H)
ONE, RAMP = np.ones_like(T), T


def bank(order: float, band: tuple[float, float, float], h: float = H) -> np.ndarray:
    filled = np.zeros((1 + number_of_poles(*band), COLUMNS))
    set_poles(filled, order, *band, h)
    return filled


@compiled
def integrate(poles, signal, out):
    before = 0.0
    for k in range(signal.shape[0]):
        if k > 0:
            remember(poles, 0, signal[k], before)
        out[k] = fractional_integral(poles, 0, signal[k])
        before = signal[k]


def integral(order: float, band: tuple[float, float, float], signal: np.ndarray) -> np.ndarray:
    out = np.zeros_like(signal)
    integrate(bank(order, band), signal, out)
    return out


def gruenwald_letnikov(order: float, signal: np.ndarray, memory: float = math.inf) -> np.ndarray:
    """D^-order by the definition, with the last ``memory`` seconds of the signal."""
    n = len(signal)
    weights = np.cumprod(np.concatenate(([1.0], (np.arange(1, n) - 1.0 + order) / np.arange(1, n))))
    weights[np.arange(n) * H > memory] = 0.0
    size = 2 * n
    return H**order * np.fft.irfft(np.fft.rfft(weights, size) * np.fft.rfft(signal, size), size)[:n]


def exact(order: float, power: int) -> np.ndarray:
    """D^-order of t^power."""
    return math.gamma(1.0 + power) * T ** (power + order) / math.gamma(1.0 + power + order)


def worst(found: np.ndarray, order: float, power: int) -> float:
    """Largest relative error from 0.1 to 60 s."""
    late = T >= 0.1 - 1e-9
    return float(np.abs(found[late] / exact(order, power)[late] - 1.0).max())


def test_reference_poles():
    """Reference section 5.1, a = 0.2: number of poles, direct term, sum of the weights, slowest pole."""
    for band, poles, direct, weights in ((WIDE, 20, 0.2176233, 78.61602), (NARROW, 11, 0.4225409, 5.427135)):
        filled = bank(0.2, band)
        assert number_of_poles(*band) == poles
        assert filled[0, 6] == pytest.approx(direct, rel=1e-6)
        assert filled[1:, 1].sum() == pytest.approx(weights, rel=1e-6)
    assert bank(0.2, WIDE)[1, 0] == pytest.approx(3.027965e-4, rel=1e-6)


@pytest.mark.parametrize(
    ("band", "order", "of_one", "of_ramp"),
    [
        (WIDE, 0.2, 3.3e-4, 6.9e-3),
        (WIDE, 0.5, 6.7e-4, 5.3e-3),
        (NARROW, 0.2, 1.4e-3, 2.2e-2),
        (NARROW, 0.5, 3.4e-3, 2.4e-2),
    ],
)
def test_error_of_the_integral_is_as_tabulated(band, order, of_one, of_ramp):
    """Reference table 5.1."""
    assert worst(integral(order, band, ONE), order, 0) == pytest.approx(of_one, rel=0.05)
    assert worst(integral(order, band, RAMP), order, 1) == pytest.approx(of_ramp, rel=0.05)


@pytest.mark.parametrize(("order", "full", "short"), [(0.2, 1.2e-2, 2.0e-1), (0.5, 3.7e-2, 4.2e-1)])
def test_better_than_gruenwald_letnikov_which_may_not_forget(order, full, short):
    """Reference table 5.1: with the whole history, and with the last 20 s of it."""
    by_definition = worst(gruenwald_letnikov(order, ONE), order, 0)
    assert by_definition == pytest.approx(full, rel=0.05)
    assert worst(gruenwald_letnikov(order, ONE, 20.0), order, 0) == pytest.approx(short, rel=0.05)
    assert worst(integral(order, WIDE, ONE), order, 0) < 0.1 * by_definition


def test_order_zero_is_no_operator():
    filled = bank(0.0, WIDE)
    remember(filled, 0, 5.0, 3.0)
    assert fractional_integral(filled, 0, 0.7) == 0.7
    assert fractional_rate(filled, 0, 0.7, -2.0) == -2.0


def test_the_derivative_is_that_of_the_integral():
    """In steps of h their difference falls with h^2, as that of a central difference does."""

    def error(h: float) -> float:
        filled = bank(0.2, NARROW, h)
        t = np.arange(0.0, 3.0, h)
        integrals, rates = [], []
        for k, now in enumerate(t):
            if k > 0:
                remember(filled, 0, math.sin(now), math.sin(t[k - 1]))
            integrals.append(fractional_integral(filled, 0, math.sin(now)))
            rates.append(fractional_rate(filled, 0, math.sin(now), math.cos(now)))
        return float(np.abs(np.gradient(integrals, h) - rates)[round(0.2 / h) : -1].max())

    assert error(0.01) < 2e-3
    assert error(0.005) < 0.3 * error(0.01)


def mittag_leffler(order: float, z: float) -> float:
    """E_order(z) by its series; its terms cancel, 1e-11 of them remains down to z = -21."""
    return math.fsum(z**k / math.gamma(1.0 + order * k) for k in range(100))


@compiled
def close_loop(poles, h, out):
    """e' = -D^-a (4 e) from e = 1, by Heun's rule."""
    e = 1.0
    for k in range(out.shape[0]):
        out[k] = e
        ahead = e - h * fractional_integral(poles, 0, 4.0 * e)
        slope = -fractional_integral(poles, 0, 4.0 * e)
        remember(poles, 0, 4.0 * ahead, 4.0 * e)
        e += 0.5 * h * (slope - fractional_integral(poles, 0, 4.0 * ahead))


@pytest.mark.parametrize(("band", "h", "error"), [(WIDE, 1e-3, 1.2e-4), (WIDE, 1e-2, 1.5e-3), (NARROW, 1e-2, 4.3e-3)])
def test_a_closed_loop_follows_the_mittag_leffler_function(band, h, error):
    """D^1.2 e + 4 e = 0 from e = 1 at rest is E_1.2(-4 t^1.2); reference section 5.1."""
    t = np.arange(0.0, 4.0, h)
    e = np.zeros_like(t)
    close_loop(bank(0.2, band, h), h, e)
    sample = np.arange(0, len(t), max(1, round(0.05 / h)))
    found = np.array([mittag_leffler(1.2, -4.0 * time**1.2) for time in t[sample]])
    assert np.abs(e[sample] - found).max() < 1.3 * error


def test_a_bank_keeps_its_memory_unless_its_poles_change():
    filled = bank(0.2, NARROW)
    remember(filled, 1, 1.0, 0.0)
    kept = filled[:, 5].copy()
    set_poles(filled, 0.3, *NARROW, H)
    assert np.array_equal(filled[:, 5], kept)
    set_poles(filled, 0.3, 1e-3, 20.0, 2.0, H)
    assert not filled[1:, 5].any()
