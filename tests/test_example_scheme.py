"""A scheme from a package of its own flies, and shows itself everywhere, without any other change."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from ftcc.groundside import Run, ScenarioError, load, resolve
from ftcc.groundside.cli.scenarios import list_all
from ftcc.groundside.dashboard.panels import panels_of
from ftcc.groundside.dashboard.subject import Subject
from ftcc.groundside.scenario.mission import Mission
from ftcc.groundside.simulation import PlainPython, simulate
from tests.sitl.conftest import same_flight
from tests.support.guests import EXAMPLE, forget_schemes, install

pytestmark = pytest.mark.slow

SCENARIO = EXAMPLE / "consensus.toml"
SECONDS = 3.0
LAW = (EXAMPLE / "altitude_consensus.py").read_text()

# The same law, written as numba cannot compile it.
PLAIN = LAW.replace(
    "S1, S2 = own.z - s.z_r, own.V - reference.V",
    'errors = {"z": own.z - s.z_r, "V": own.V - reference.V}\n    S1, S2 = errors["z"], errors["V"]',
)

# The same law in numpy, without compilation.
NUMPY = (
    LAW.replace("@compiled\n", "")
    .replace("from typing", "import numpy as np\n\nfrom typing", 1)
    .replace(
        "S1, S2 = own.z - s.z_r, own.V - reference.V",
        "S1, S2 = np.array([own.z, own.V]) - np.array([s.z_r, reference.V])",
    )
)

UNCOMPILED = {
    "plain_consensus": r"numba cannot compile it \(.*plain_consensus\.py:\d+: ",
    "numpy_consensus": r".*numpy_consensus\.py:\d+: start, step and share are without @compiled",
}
"""Why these fly as plain Python."""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder on the path with the example's package in it, and with laws that are not compiled."""
    target = tmp_path_factory.mktemp("site")
    install(EXAMPLE, target, {"plain_consensus": PLAIN, "numpy_consensus": NUMPY})
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(target))
        forget_schemes()
        yield target
    forget_schemes()


def mission(scheme: str, duration: float | None = None) -> Mission:
    return resolve(load(SCENARIO, settings=[f"scheme={scheme}"], duration=duration))


@pytest.fixture(scope="module")
def flown(installed: Path, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """The first seconds of the example in one process."""
    return simulate(mission("altitude_consensus", SECONDS), tmp_path_factory.mktemp("runs") / "example")


def ftcc(installed: Path, runtime: Path, *arguments: str) -> str:
    """The output of a command in an environment in which the package is installed."""
    finished = subprocess.run(
        [sys.executable, "-m", "ftcc.groundside.cli", *arguments],
        env={**os.environ, "PYTHONPATH": str(installed), "FTCC_RUNTIME_DIR": str(runtime), "COLUMNS": "300"},
        capture_output=True,
        text=True,
        timeout=280,
        check=False,
    )
    assert finished.returncode == 0, finished.stdout + finished.stderr
    return finished.stdout + finished.stderr


def test_what_it_claims_holds(installed: Path, tmp_path: Path) -> None:
    run = simulate(mission("altitude_consensus"), tmp_path / "run")
    assert {result.claim.name: result.ok for result in run.claims()} == {
        "altitude tracking": True,
        "altitude behind the leader at the end": True,
    }


def test_it_is_recorded_and_plotted_as_its_file_declares(flown: Run) -> None:
    columns = flown.columns
    assert [columns[name].unit for name in ("z_r", "theta_0", "elevator_0", "thrust_0", "S1", "S2")] == [
        "m", "rad", "rad", "N", "m", "m/s",
    ]  # fmt: skip
    assert columns["S1"].meaning == "altitude tracking error"
    tracking = panels_of(Subject.of(flown.mission))["Tracking"]
    assert {panel.value for panel in tracking} >= {("truth", "z"), ("signals", "S1"), ("signals", "S2")}
    assert tracking[0].second == ("signals", "z_r")
    z, z_r, S1 = (flown.column(name, 2) for name in ("z", "z_r", "S1"))
    assert abs(z - z_r - S1).max() < 1e-3, "errors of the law are those of the aircraft, but for float32"


def test_it_is_listed_and_flies_as_processes_bit_for_bit(installed: Path, flown: Run, tmp_path: Path) -> None:
    assert "Altitude consensus behind a leader" in ftcc(installed, tmp_path, "list")
    options = ("--speed", "max", "--viewer", "none", "--duration", f"{SECONDS:g}")
    ftcc(installed, tmp_path, "fly", str(SCENARIO), *options, "--out", str(tmp_path / "run"))
    assert same_flight(tmp_path / "run", flown.path)


@pytest.mark.parametrize("scheme", UNCOMPILED)
def test_a_scheme_that_is_not_compiled_flies_as_plain_python_with_the_same_bits(
    scheme: str, installed: Path, flown: Run, tmp_path: Path
) -> None:
    refusal = f"scheme {scheme} flies as plain Python"
    with pytest.warns(PlainPython, match=rf"{refusal}, slowly: {UNCOMPILED[scheme]}") as warned:
        run = simulate(mission(scheme, SECONDS), tmp_path / "simulated")
    # Others may be there: of a cache that another process is writing into.
    assert len([one for one in warned if issubclass(one.category, PlainPython)]) == 1
    assert same_flight(run.path, flown.path)

    options = ("--set", f"scheme={scheme}", "--speed", "max", "--viewer", "none", "--duration", f"{SECONDS:g}")
    output = ftcc(installed, tmp_path, "fly", str(SCENARIO), *options, "--out", str(tmp_path / "flown"))
    assert output.count(refusal) == 1, "said once, not by every process"
    assert same_flight(tmp_path / "flown", flown.path)


def test_the_walk_through_quotes_the_example_as_it_is() -> None:
    guide = (Path(__file__).parents[1] / "airside" / "schemes" / "README.md").read_text()
    quotes = re.findall(r"```(?:python|toml)\n(.*?)```", guide, re.DOTALL)
    assert len(quotes) >= 5
    sources = [(EXAMPLE / name).read_text() for name in ("altitude_consensus.py", "pyproject.toml", "consensus.toml")]
    for quote in quotes:
        assert any(quote in source for source in sources), quote


def test_a_package_whose_scheme_is_none_is_told_what_it_lacks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    taken = (EXAMPLE / "altitude_consensus.py").read_text().replace('Q("z_r"', 'Q("z"')
    install(EXAMPLE, tmp_path, {"half_a_scheme": '"""Half a scheme."""\n', "taken_name": taken})
    monkeypatch.syspath_prepend(str(tmp_path))
    forget_schemes()
    try:
        with pytest.raises(ScenarioError, match=r"scheme half_a_scheme .*lacks Gains, State, Output"):
            mission("half_a_scheme")
        with pytest.raises(ScenarioError, match="signals z: every recording has columns of these names already"):
            mission("taken_name")
        list_all()
        assert "lacks Gains, State, Output" in capsys.readouterr().out
    finally:
        monkeypatch.undo()
        forget_schemes()
