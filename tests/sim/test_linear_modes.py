"""Linear modes, against the tables of the reference airframe."""

from __future__ import annotations

import numpy as np
import pytest

from ftcc.sim.airframe import Airframe, scaled
from ftcc.sim.linear_modes import STATES, linearize, modes
from tests.support.swarm import AIRFRAME

HIGHER = scaled(AIRFRAME, {"all": 1.2, "CLde": 1.0})


@pytest.mark.parametrize(
    ("airframe", "V", "short_period", "phugoid", "roll", "dutch_roll", "spiral"),
    [
        (AIRFRAME, 18.0, (7.97, 0.396), (0.703, 0.040), -13.00, (3.31, 0.388), 0.0653),
        (AIRFRAME, 25.0, (11.06, 0.393), (0.509, 0.046), -18.17, (4.51, 0.369), 0.0101),
        (AIRFRAME, 30.0, (13.28, 0.393), (0.424, 0.058), -21.85, (5.38, 0.365), -0.0023),
        (AIRFRAME, 35.0, (15.49, 0.393), (0.364, 0.074), -25.53, (6.25, 0.363), -0.0076),
        (HIGHER, 30.0, (14.77, 0.424), (0.418, 0.066), -26.22, (5.91, 0.398), -0.0069),
    ],
)
def test_modes_are_those_of_the_reference_table(airframe, V, short_period, phugoid, roll, dutch_roll, spiral):
    """To the digits that the table prints."""
    found = {mode.name: mode for mode in modes(airframe, V)}
    assert list(found) == ["short period", "phugoid", "roll", "Dutch roll", "spiral"]
    for name, (frequency, damping), digit in (
        ("short period", short_period, 0.005),
        ("phugoid", phugoid, 0.0005),
        ("Dutch roll", dutch_roll, 0.005),
    ):
        assert found[name].oscillates
        assert found[name].frequency == pytest.approx(frequency, abs=1.1 * digit)
        assert found[name].damping == pytest.approx(damping, abs=0.00055)
    assert found["roll"].eigenvalue == pytest.approx(roll, abs=0.0055)
    assert found["spiral"].eigenvalue == pytest.approx(spiral, abs=0.000055)


def test_linear_model_at_the_trim_of_30_m_per_s():
    """The reference matrix, printed to 1e-5."""
    rows = {
        "V": {"V": -0.05678, "gamma": -9.8, "alpha": -5.40783},
        "chi": {"mu": 0.32667, "beta": -0.43033},
        "gamma": {"V": 0.02172, "alpha": 4.92926},
        "mu": {"p": 0.99948, "r": 0.03217},
        "alpha": {"V": -0.02172, "alpha": -4.92926, "q": 1.0},
        "beta": {"mu": 0.32667, "beta": -0.43033, "p": 0.03217, "r": -0.99948},
        "p": {"beta": -31.87338, "p": -22.01031, "r": 3.36231},
        "q": {"alpha": -149.17434, "q": -5.49353},
        "r": {"beta": 24.69532, "p": -1.38294, "r": -3.33832},
    }
    expected = np.array([[rows[row].get(column, 0.0) for column in STATES] for row in STATES])
    assert linearize(AIRFRAME, 30.0) == pytest.approx(expected, abs=6e-6)


def without(**coefficients: float) -> Airframe:
    return AIRFRAME._replace(**coefficients)


def test_a_tail_heavy_aircraft_has_a_divergent_root_where_its_short_period_was():
    roots = [mode for mode in modes(without(Cma=0.3), 30.0) if mode.name in ("short period", "phugoid")]
    divergent = [mode for mode in roots if mode.eigenvalue.real > 0.0]
    assert len(divergent) == 1
    assert not divergent[0].oscillates
    assert not any(mode.eigenvalue.real > 0.01 for mode in modes(AIRFRAME, 30.0))


def test_without_weathercock_stability_the_dutch_roll_comes_apart_into_two_roots():
    found = [mode for mode in modes(without(Cnb=-0.05, Clb=0.0), 30.0) if mode.name == "Dutch roll"]
    assert len(found) == 2
    assert not any(mode.oscillates for mode in found)


def test_every_root_is_named_once():
    random = np.random.default_rng(6)
    for _ in range(50):
        factors = dict(zip(("Cma", "Cmq", "Cnb", "Clb", "Clp", "Cnr"), random.uniform(-0.5, 1.5, 6).tolist()))
        found = modes(scaled(AIRFRAME, factors), 30.0)
        assert sum(2 if mode.oscillates else 1 for mode in found) == 8
