"""Dryden turbulence here and in JSBSim: the same sizes, exactly; what differs in the filters is on the page."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import welch

from ftcc.groundside.scenario.wind import low_altitude
from tests.support.referee_air import MILSPEC, SPEED, TUSTIN, dryden_spectra, jsbsim_air, our_air

pytestmark = pytest.mark.skipif(find_spec("jsbsim") is None, reason="JSBSim is not installed (extra jsbsim)")

DT, STEPS = 0.01, 4000


BREATH = 1e-6
"""By which winds are multiplied: then turbulence does not change the airspeed, which the filters take."""


def draws(altitude: float, wind: float, longer: float = 1.0) -> NDArray[np.float64]:
    """The normal numbers (steps - 1, 3) that JSBSim drew, by its recursion with our sizes, lengths times ``longer``.

    MIL-STD-1797A: x' = (1 - a) x + sigma sqrt(2 a) n, with a = dt V/L along, and 2 dt V/L across.
    """
    air = jsbsim_air(MILSPEC, STEPS, DT, altitude=altitude, wind=wind)
    deviation, length = low_altitude(wind, altitude)
    x = air.speed * [1.0, 1.0, -1.0]  # it draws the component down
    a = DT * SPEED / (longer * np.array(length)) * [1.0, 2.0, 2.0]
    return (x[1:] - (1.0 - a) * x[:-1]) / (np.array(deviation) * np.sqrt(2.0 * a))


def test_scale_lengths_and_deviations_near_the_ground_are_jsbsims() -> None:
    """From turbulence at three altitudes, in two winds, our sizes get the same numbers back: those that it drew."""
    drawn = draws(50.0, 6.0 * BREATH)
    for altitude, wind in ((10.0, 6.0), (250.0, 14.0)):
        assert draws(altitude, wind * BREATH) == pytest.approx(drawn, abs=1e-6)
    assert drawn.std(axis=0) == pytest.approx([1.0] * 3, abs=4.0 / np.sqrt(2.0 * STEPS))
    assert np.abs(draws(50.0, 6.0 * BREATH, longer=1.01) - drawn).mean() > 1e-3, "one per cent would be seen"


def test_spectra_are_those_of_the_specification_here_and_by_tustins_rule_there() -> None:
    """Averages over bands of an octave, within four standard deviations and the bend of a spectrum in its band."""
    sizes = low_altitude(10.0, 30.0)
    steps = 60_000
    series = {
        "ours": our_air(steps, DT, *sizes).speed,
        "tustin": jsbsim_air(TUSTIN, steps, DT, altitude=30.0, wind=10.0).speed,
    }
    for name, air in series.items():
        frequency, found = welch(air, 1.0 / DT, nperseg=4096, axis=0)
        exact = dryden_spectra(2.0 * np.pi * frequency, *sizes)
        for low in (0.1, 0.2, 0.4, 0.8, 1.6, 3.2):
            band = (frequency >= low) & (frequency < 2.0 * low)
            ratio = (found[band] / exact.T[band]).mean(axis=0)
            # Welch averages about steps / 2048 segments that overlap by half.
            spread = 1.0 / np.sqrt(band.sum() * 0.75 * steps / 2048)
            assert ratio == pytest.approx([1.0] * 3, abs=4.0 * spread + 0.04), (name, low)
