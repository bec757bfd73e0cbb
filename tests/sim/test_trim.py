"""Level trim, against the table of the reference airframe."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

import ftcc.groundside
from ftcc.sim.airframe import Airframe, longitudinal_rates
from ftcc.sim.trim import TrimError, steady_climb, trim


@pytest.fixture(scope="module")
def airframe() -> Airframe:
    sheet = Path(ftcc.groundside.__file__).parent / "airframes" / "reference_25kg.toml"
    values = tomllib.loads(sheet.read_text())
    return Airframe(**{name: float(values[name]) for name in Airframe._fields})


@pytest.mark.parametrize(
    ("V", "alpha", "elevator", "thrust"),
    [
        (18.0, 0.174315, -0.620912, 21.087),
        (22.0, 0.101472, -0.403610, 18.768),
        (25.0, 0.067750, -0.303011, 18.904),
        (30.0, 0.032175, -0.196882, 21.303),
        (35.0, 0.010653, -0.132678, 25.581),
    ],
)
def test_trim_table_of_the_reference_airframe(
    airframe: Airframe, V: float, alpha: float, elevator: float, thrust: float
) -> None:
    level = trim(airframe, V)
    assert level.alpha == pytest.approx(alpha, abs=1e-5)
    assert level.elevator == pytest.approx(elevator, abs=1e-5)
    assert level.thrust == pytest.approx(thrust, abs=1e-3)


def test_trim_with_all_aerodynamic_coefficients_but_the_elevator_lift_twenty_percent_higher(airframe: Airframe) -> None:
    higher = {
        name: 1.2 * getattr(airframe, name) for name in Airframe._fields if name.startswith("C") and name != "CLde"
    }
    level = trim(airframe._replace(**higher), 30.0)
    assert level.alpha == pytest.approx(0.016766, abs=1e-5)
    assert level.elevator == pytest.approx(-0.150914, abs=1e-5)
    assert level.thrust == pytest.approx(23.310, abs=1e-3)


def test_trim_under_the_disturbances_of_chapter_5_is_an_equilibrium(airframe: Airframe) -> None:
    level = trim(airframe, 30.0, d1=0.2, d2=0.2, d3=0.1)
    assert level.elevator == pytest.approx(-0.046, abs=5e-4)
    rates = longitudinal_rates(30.0, 0.0, level.alpha, 0.0, level.thrust, level.elevator, 0.2, 0.2, 0.1, airframe)
    assert [rates[0], rates[2], rates[3], rates[5]] == pytest.approx([0.0] * 4, abs=1e-9)


def test_no_trim_where_the_lift_cannot_carry_the_weight(airframe: Airframe) -> None:
    with pytest.raises(TrimError, match="no level trim at 5 m/s"):
        trim(airframe, 5.0)


def test_thrust_of_level_trim_holds_the_altitude(airframe: Airframe) -> None:
    assert steady_climb(airframe, 30.0, trim(airframe, 30.0).thrust) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("thrust", "climb"), [(60.0, 4.7), (0.0, -2.6)])
def test_what_the_thrust_limits_of_chapter_6_allow(airframe: Airframe, thrust: float, climb: float) -> None:
    """Reference section 2: sustained climb of 4.7 m/s, descent of 2.6 m/s at 30 m/s."""
    assert steady_climb(airframe, 30.0, thrust) == pytest.approx(climb, abs=0.1)


def test_a_thrust_that_no_path_angle_balances(airframe: Airframe) -> None:
    with pytest.raises(TrimError, match="no steady climb"):
        steady_climb(airframe, 30.0, 2000.0)
