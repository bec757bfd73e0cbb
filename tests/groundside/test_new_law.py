"""``ftcc new --law``: what it writes passes the linter, flies and meets its claims; what is there already stays."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from ftcc.airside.scheme import quantities
from ftcc.groundside import load, resolve
from ftcc.groundside.cli import main
from tests.sitl.conftest import same_flight
from tests.support.guests import forget_schemes, install

NAME = "my_law"


def new(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> None:
    monkeypatch.setattr(sys, "argv", ["ftcc", "new", *arguments])
    main()


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.delitem(sys.modules, NAME, raising=False)
    with pytest.raises(SystemExit) as ended:
        new(monkeypatch, "--law", NAME, str(tmp_path / "law"))
    assert ended.value.code == 0
    return tmp_path / "law"


@pytest.fixture
def site(package: Path, tmp_path: Path) -> Path:
    """Where the package is installed, as pip would."""
    folder = tmp_path / "site"
    folder.mkdir()
    install(package, folder)
    return folder


def test_it_passes_the_linter(package: Path) -> None:
    assert {path.name for path in package.iterdir()} == {
        f"{NAME}.py", f"{NAME}.toml", f"test_{NAME}.py", "pyproject.toml", "README.md",
    }  # fmt: skip
    for command in (
        ["check", "--select", "E,F,W,I,B,N,PT,RUF,SIM,UP", "--ignore", "N803,N806,N815"],
        ["format", "--check"],
    ):
        subprocess.run([sys.executable, "-m", "ruff", *command, str(package)], check=True)


def test_its_law_is_complete_and_its_scenario_can_fly(
    site: Path, package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(site))
    forget_schemes()
    try:
        mission = resolve(load(package / f"{NAME}.toml"))
        assert mission.warnings == ()
        assert mission.scheme.title.startswith("My law: altitude and airspeed consensus")
        gains = quantities(mission.scheme.gains_type)
        assert all(gain.unit and gain.meaning and gain.published for gain in gains.values())
        assert set(mission.scheme.ranges) == set(gains), "every gain has a range"
    finally:
        monkeypatch.undo()
        forget_schemes()
        sys.modules.pop(NAME, None)


@pytest.mark.slow
def test_its_tests_pass_and_it_flies_as_processes_bit_for_bit(site: Path, package: Path, tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(site), "FTCC_RUNTIME_DIR": str(tmp_path)}

    def typed(*words: str) -> None:
        finished = subprocess.run(
            [sys.executable, "-m", *words], env=environment, cwd=package, capture_output=True, text=True, timeout=280,
            check=False,
        )  # fmt: skip
        assert finished.returncode == 0, finished.stdout + finished.stderr

    typed("pytest", "-q", "-p", "no:cacheprovider")
    cli, options = "ftcc.groundside.cli", ("--duration", "3", "--out")
    typed(cli, "verify", f"{NAME}.toml")
    typed(cli, "new", "ten.toml", "--scheme", NAME, "--followers", "10", "--graph", "grid", "--faults", "2")
    typed(cli, "simulate", f"{NAME}.toml", *options, "simulated")
    typed(cli, "fly", f"{NAME}.toml", "--speed", "max", "--viewer", "none", "--mavlink", "none", *options, "flown")
    assert same_flight(package / "flown", package / "simulated")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--law", "my-law", "new"), "--law my-law: must be a name for a Python module"),
        (("--law", "My_law", "new"), "--law My_law: must be a name for a Python module"),
        (("--law", "lambda", "new"), "--law lambda: must be a name for a Python module"),
        (("--law", "containment", "new"), "--law containment: there is such a scheme already; there are "),
        (("--law", "numpy", "new"), "--law numpy: a Python module has this name already"),
        (("--law", "other_law", "full"), "full: exists and is not an empty folder; what is in it stays as it is"),
        (("--law", "other_law", "full/notes"), "full/notes: exists and is not an empty folder"),
        (("--law", "other_law", "full/notes/new"), "full/notes/new: cannot be written"),
        (("--law", "other_law", "new", "--followers", "3"), "--law: takes no --followers"),
    ],
)
def test_what_cannot_be_is_refused_and_what_is_there_stays(
    arguments: tuple[str, ...],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "notes").write_text("mine")
    with pytest.raises(SystemExit) as ended:
        new(monkeypatch, *arguments)
    assert ended.value.code == 2
    assert said in capsys.readouterr().err
    assert [path.name for path in tmp_path.rglob("*")] == ["full", "notes"]
    assert (tmp_path / "full" / "notes").read_text() == "mine"
