"""What one noisy flight shows by accident, over many seeds: reference table 8.9, factor 1, published gains."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ftcc.groundside import study

pytestmark = pytest.mark.slow

TRACKING = "altitude tracking with noise, factor 1"
SEEDS = 40


def test_the_mean_of_the_largest_errors_under_noise(tmp_path: Path):
    """0.474 m, standard error 0.008 m; single flights from 0.39 to 0.65 m, of which the reference tells one."""
    flown = study("containment", form="flight", variants=("P", "noise"), seeds=SEEDS, jobs=2, folder=tmp_path).table
    assert flown.column("error").to_pylist() == [None] * SEEDS
    errors = flown.column(TRACKING).to_numpy()
    standard_error = errors.std(ddof=1) / np.sqrt(SEEDS)
    assert standard_error == pytest.approx(0.008, abs=0.003)
    assert errors.mean() == pytest.approx(0.474, abs=4.0 * 0.008)
    assert errors.min() > 0.35
    assert errors.max() < 0.70
