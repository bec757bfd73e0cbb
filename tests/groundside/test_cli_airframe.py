"""``ftcc airframe``: what it prints and what it refuses."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from ftcc.groundside.cli import app


def printed(*arguments: str) -> list[list[str]]:
    """Words of each line."""
    result = CliRunner().invoke(app, ["airframe", *arguments], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return [line.split() for line in result.output.splitlines()]


def test_trim_and_modes_side_by_side():
    lines = printed("--airspeed", "18", "--airspeed", "30")
    assert ["30", "0.032175", "1.843", "-0.196882", "-11.280", "21.303"] in lines
    assert ["short", "period", "wn", "rad/s,", "zeta", "7.971,", "0.396", "13.276,", "0.393"] in lines
    assert ["spiral", "1/s", "+0.0653", "-0.0023"] in lines


def test_another_airframe_and_other_coefficients(tmp_path: Path):
    sheet = Path(__file__).parents[2] / "groundside" / "airframes" / "reference_25kg.toml"
    mine = tmp_path / "mine.toml"
    mine.write_text(sheet.read_text().replace("25 kg fixed-wing UAV", "Mine"))
    lines = printed(str(mine), "--airspeed", "30", "--coefficient", "all=1.2", "--coefficient", "CLde=1")
    assert lines[0] == ["Mine"]
    assert lines[3][1:] == ["0.016766", "0.961", "-0.150914", "-8.647", "23.310"]


def test_the_poles_are_drawn(tmp_path: Path):
    printed("--airspeed", "30", "--plot", str(tmp_path / "poles.png"))
    assert (tmp_path / "poles.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["point_20kg"], "point_20kg': is a point mass"),
        (["--airspeed", "5"], "no level trim at 5 m/s"),
        (["--airspeed", "-3"], "must be a positive number"),
        (["--coefficient", "CLa"], "must be NAME=FACTOR"),
        (["--coefficient", "Ix=2"], "Ix: no aerodynamic coefficient; there are CD0"),
        (["--airspeed", "30", "--plot", "/nowhere/x.png"], "--plot /nowhere/x.png: cannot be written"),
    ],
)
def test_what_cannot_be_is_refused_with_the_reason(arguments, text, capsys):
    with pytest.raises(SystemExit) as left:
        app(["airframe", *arguments], standalone_mode=False)
    assert left.value.code == 2
    assert text in " ".join(capsys.readouterr().err.split())
