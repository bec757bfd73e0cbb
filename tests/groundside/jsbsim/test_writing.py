"""Airframe sheets as JSBSim aircraft: what is written, and what is refused. Needs no JSBSim."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ftcc.groundside.cli import app, main
from ftcc.groundside.jsbsim import STANDARD_TRAVEL, ActuatorError, AircraftError, actuators_of, write_aircraft
from ftcc.groundside.scenario import load, load_airframe
from ftcc.groundside.schema import AirframeSheet, PointMassSheet
from ftcc.link.airframe import Airframe, parameters

SHEET = load_airframe("reference_25kg", Path("here"))
POINT = load_airframe("point_20kg", Path("here"))
assert isinstance(SHEET, AirframeSheet)


def number(element: ET.Element | None) -> float:
    assert element is not None
    assert element.text is not None
    return float(element.text)


def test_every_coefficient_of_the_sheet_is_a_term_under_its_own_name(tmp_path: Path) -> None:
    (file, *_) = write_aircraft(SHEET, "mine", tmp_path)
    aircraft = ET.parse(file).getroot()
    found = {}
    for function in aircraft.iter("function"):
        name = function.get("name", "")
        if name.startswith("aero/coefficient/"):
            found[name.rpartition("/")[2]] = number(function.find("product/value"))
    wanted = {name: getattr(SHEET, name) for name in parameters(Airframe) if name.startswith("C")}
    assert found == wanted


def test_mass_inertia_density_and_gravity_in_its_units(tmp_path: Path) -> None:
    (file, *_) = write_aircraft(SHEET, "mine", tmp_path)
    aircraft, slug, foot = ET.parse(file).getroot(), 14.593902937206365, 0.3048
    assert number(aircraft.find("mass_balance/emptywt")) / 32.174049 * slug == pytest.approx(SHEET.m, rel=1e-12)
    for key, value in (("ixx", SHEET.Ix), ("iyy", SHEET.Iy), ("izz", SHEET.Iz), ("ixz", SHEET.Ixz)):
        assert number(aircraft.find(f"mass_balance/{key}")) * slug * foot**2 == pytest.approx(value, rel=1e-12)
    density = next(one for one in aircraft.iter("property") if one.text == "atmosphere/override/density")
    assert float(density.get("value", "")) * slug / foot**3 == pytest.approx(SHEET.rho, rel=1e-12)
    for planet in (aircraft.find("planet"), ET.parse(file.with_name("flat_earth.xml")).getroot()):
        assert planet is not None
        radius = number(planet.find("equatorial_radius"))
        assert number(planet.find("GM")) / radius**2 * foot == pytest.approx(SHEET.g, rel=1e-12)


def test_actuators_are_those_of_a_scenario(tmp_path: Path) -> None:
    scenario = load("containment", settings=["plant.lag.elevator=12.5", "plant.rate_limits.elevator=2"])
    actuators = actuators_of(scenario.plan, SHEET.T_max)
    assert actuators["elevator"] == (-0.7, 0.7, 12.5, 2.0)
    assert actuators["thrust"][:2] == (0.0, 40.0)
    assert actuators["rudder"][:2] == (-STANDARD_TRAVEL, STANDARD_TRAVEL), "the scenario gives none"
    (file, *_) = write_aircraft(SHEET, "mine", tmp_path, actuators=actuators)
    text = file.read_text()
    assert "elevator: travel -0.7 to 0.7 rad (-40.11 to 40.11 deg), lag 12.5 rad/s, at most 2 rad/s" in text
    assert "aileron: travel -0.523599 to 0.523599 rad (-30 to 30 deg), no lag, no rate limit" in text
    (clip,) = (one for one in ET.fromstring(text).iter("pure_gain") if one.get("name") == "fcs/thrust-n-commanded")
    assert (number(clip.find("gain")), number(clip.find("clipto/max"))) == (120.0, 40.0)


def test_actuators_of_second_order_are_refused() -> None:
    scenario = load("containment", settings=["plant.lag.elevator=12.5", "plant.damping.elevator=0.7"])
    with pytest.raises(ActuatorError, match=r"plant.damping.elevator = 0.7: must be 0"):
        actuators_of(scenario.plan, SHEET.T_max)


def test_what_cannot_be_written_leaves_nothing(tmp_path: Path) -> None:
    assert isinstance(POINT, PointMassSheet)
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "notes.txt").write_text("mine")
    for sheet, name, speeds, text in (
        (POINT, "point", (), "point: is a point mass"),
        (SHEET, "../out", (), "must be a name"),
        (SHEET, "slow", (18.0,), "level flight at 18 m/s needs elevator -0.6209 rad, and its travel is -0.5236"),
        (SHEET, "slower", (5.0,), "no level trim at 5 m/s"),
        (SHEET, "taken", (), "exists and is not an empty folder"),
    ):
        with pytest.raises(AircraftError, match=text):
            write_aircraft(sheet, name, tmp_path, airspeeds=speeds)
    assert [path.name for path in tmp_path.rglob("*")] == ["taken", "notes.txt"]


def test_on_the_command_line(tmp_path: Path) -> None:
    arguments = ["airframe", "--coefficient", "CLa=1.1", "--jsbsim", str(tmp_path), "--actuators", "containment"]
    result = CliRunner().invoke(app, arguments, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    place = tmp_path / "reference_25kg"
    assert f"<value>{1.1 * 4.6333}</value>" in (place / "reference_25kg.xml").read_text()
    assert {path.name for path in place.glob("*_2*.xml")} == {
        "reference_25kg.xml", "level_22.xml", "level_25.xml", "fly_22.xml", "fly_25.xml",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["point_20kg", "--jsbsim", "x"], "is a point mass"),
        (["--actuators", "containment"], "--actuators: is for the aircraft that --jsbsim DIR writes"),
        (["--airspeed", "18", "--jsbsim", "x"], "needs elevator -0.6209 rad"),
        (["--jsbsim", "x", "--actuators", "nothing"], "there is no such scenario"),
        (["--jsbsim", "/dev/null"], "/dev/null/reference_25kg: cannot be written"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    arguments: list[str], text: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["ftcc", "airframe", *arguments])
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 2
    assert text in " ".join(capsys.readouterr().err.split())
    assert not any(tmp_path.iterdir())
