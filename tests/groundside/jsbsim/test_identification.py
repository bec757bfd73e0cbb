"""Identification: our own aircraft comes back as its sheet, and JSBSim's with modes that are theirs."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from typer.testing import CliRunner

pytest.importorskip("jsbsim", reason="JSBSim is not installed")

from ftcc.airside.schemes import find
from ftcc.groundside.cli import app
from ftcc.groundside.jsbsim import Actuator, identify, scale_of, scaled_gains, sheet_text, write_aircraft
from ftcc.groundside.scenario import load_airframe
from ftcc.groundside.schema import AirframeSheet, record_of
from ftcc.link.airframe import Airframe
from ftcc.sim.jsbsim.aircraft import Aircraft
from ftcc.sim.jsbsim.linear import linear_modes
from ftcc.sim.linear_modes import modes

SHEET = load_airframe("reference_25kg", Path("here"))
assert isinstance(SHEET, AirframeSheet)
STILL = {name: Actuator(-0.8, 0.8) for name in ("aileron", "elevator", "rudder")} | {"thrust": Actuator(0.0, 120.0)}


def test_our_own_aircraft_comes_back_as_its_sheet(tmp_path: Path) -> None:
    """Written for JSBSim, and identified from JSBSim's accelerations: every coefficient, and mass and inertia."""
    (file, *_) = write_aircraft(SHEET, "mine", tmp_path, actuators=STILL, airspeeds=[])
    found = identify(Aircraft(str(file)), 25.0, 1000.0)
    ours = record_of(SHEET, Airframe)
    for name, value in ours._asdict().items():
        assert getattr(found.airframe, name) == pytest.approx(value, rel=1e-4, abs=1e-5), name
    assert min(fit.determination for fit in found.fits.values()) > 1.0 - 1e-9
    assert found.controls.thrust.most == pytest.approx(120.0, rel=1e-3)


@pytest.mark.parametrize(("name", "V", "altitude"), [("c172p", 50.0, 1000.0), ("737", 180.0, 3000.0)])
def test_the_fitted_model_has_the_modes_of_jsbsims_aircraft(name: str, V: float, altitude: float) -> None:
    found = identify(Aircraft(name), V, altitude)
    ours = {mode.name: mode for mode in modes(found.airframe, V)}
    theirs = {mode.name: mode for mode in linear_modes(found.aircraft, found.controls, V, altitude)}
    for mode in ("short period", "roll", "Dutch roll"):
        assert abs(ours[mode].eigenvalue - theirs[mode].eigenvalue) < 0.03 * abs(theirs[mode].eigenvalue), mode
    # The engine is in the slow ones: its thrust falls with speed, ours does not.
    assert abs(ours["phugoid"].eigenvalue - theirs["phugoid"].eigenvalue) < 0.15 * abs(theirs["phugoid"].eigenvalue)


@pytest.mark.parametrize(("name", "V", "altitude"), [("c172p", 50.0, 1000.0), ("737", 180.0, 3000.0)])
def test_the_shipped_sheets_are_what_the_command_writes(name: str, V: float, altitude: float) -> None:
    shipped = load_airframe(f"jsbsim_{name}", Path("here"))
    fresh = tomllib.loads(sheet_text(identify(Aircraft(name), V, altitude)))
    for field, value in fresh.items():
        assert getattr(shipped, field) == (value if field == "title" else pytest.approx(value, rel=1e-3, abs=1e-6))


def test_gains_scale_by_their_units() -> None:
    scale = scale_of(record_of(SHEET, Airframe), 30.0)
    assert scale.time == pytest.approx(1.0, abs=2e-3)
    assert (scale.speed, scale.mass) == (1.0, 1.0)
    slow = scale._replace(time=4.0, speed=3.0, mass=10.0)
    wanted = {"1/s": 0.25, "rad/s^2": 1 / 16, "m": 12.0, "m/s": 3.0, "m/s^2": 0.75, "s": 4.0, "m s": 48.0}
    wanted |= {"s^(1/2)": 2.0, "rad^(1/2)/s^(3/2)": 1 / 8, "s/rad": 4.0, "-": 1.0, "rad": 1.0}
    wanted |= {"N": 7.5, "N/m": 7.5 / 12.0, "N s^2/m": 10.0}
    assert slow.factor("m^(1-r)/s") is None
    assert {unit: slow.factor(unit) for unit in wanted} == pytest.approx(wanted)
    changed, unknown = scaled_gains(find("containment"), "flight", slow)
    assert changed["k11"] == pytest.approx(0.75)
    assert "l1" not in changed
    assert "z_start" not in changed
    assert unknown == []


def test_the_command_writes_sheet_and_figure(tmp_path: Path) -> None:
    sheet, figure = tmp_path / "mine.toml", tmp_path / "fit.png"
    arguments = ["identify", "c172p", "--airspeed", "50", "--out", str(sheet), "--plot", str(figure)]
    done = CliRunner().invoke(app, [*arguments, "--gains", "fire_monitoring"])
    assert done.exit_code == 0, done.output
    assert "short period" in done.output
    assert "not scaled, for want of a unit that the rule knows: kap2" in done.output
    assert isinstance(load_airframe(str(sheet), tmp_path / "x"), AirframeSheet)
    assert figure.stat().st_size > 20_000


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["c171", "--airspeed", "50"], "JSBSim has no aircraft 'c171'"),
        (["c172p", "--airspeed", "nan"], "must be a positive number"),
        (["c172p", "--airspeed", "15"], "no level flight at 15 m/s"),
        (["c172p", "--airspeed", "50", "--gains", "nothing"], "--gains nothing"),
    ],
)
def test_bad_input_is_one_line(arguments: list[str], message: str) -> None:
    done = CliRunner().invoke(app, ["identify", *arguments])
    assert done.exit_code == 2
    assert message in done.output
    assert done.output.count("\n") == 1


def test_airframe_shows_level_flight_and_modes_of_an_aircraft_of_jsbsim() -> None:
    done = CliRunner().invoke(app, ["airframe", "jsbsim:c172p", "--airspeed", "40", "--airspeed", "50"])
    assert done.exit_code == 0, done.output
    assert "c172p of JSBSim at 1000 m" in done.output
    assert "Dutch roll" in done.output
    assert "915." in done.output


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["jsbsim:c171"], "JSBSim has no aircraft 'c171'"),
        (["jsbsim:c172p", "--airspeed", "20"], "no level flight at 20 m/s"),
        (["jsbsim:c172p", "--coefficient", "all=1.1"], "are for our airframes"),
        (["jsbsim:c172p", "--altitude", "nan"], "--altitude nan"),
    ],
)
def test_airframe_refuses_in_one_line(arguments: list[str], message: str) -> None:
    done = CliRunner().invoke(app, ["airframe", *arguments])
    assert done.exit_code == 2
    assert message in done.output
