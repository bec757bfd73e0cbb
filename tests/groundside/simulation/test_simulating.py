"""`simulate` from a script: what ``ftcc simulate`` does, in memory or in a folder, with the same errors."""

from __future__ import annotations

import dataclasses
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from ftcc.groundside import (
    Flight,
    MissingPackageError,
    Run,
    ScenarioError,
    ScenarioWarning,
    fly_in_memory,
    load,
    resolve,
    simulate,
)
from ftcc.groundside.cli.app import main
from ftcc.groundside.results import RunError

CHOICES: dict[str, Any] = {
    "variants": ["loss30"],
    "settings": {"gains.k11": 3.0, "faults": {0: {"effectiveness": 0.9, "at": 0.5}}},
    "seed": 7,
    "duration": 1.5,
}


@pytest.fixture(scope="module")
def flight() -> Flight:
    return simulate("containment", **CHOICES)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return simulate("containment", tmp_path_factory.mktemp("runs") / "flown", **CHOICES)


def bits(table: Any) -> dict[str, bytes]:
    return {name: table.column(name).to_numpy().tobytes() for name in table.column_names}


def test_memory_folder_and_command_line_fly_the_same(
    flight: Flight, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "run"
    options = ["--variant", "loss30", "--seed", "7", "--duration", "1.5", "--set", "gains.k11=3.0"]
    options += ["--set", "faults.0.effectiveness=0.9", "--set", "faults.0.at=0.5"]
    monkeypatch.setattr(sys, "argv", ["ftcc", "simulate", "containment", "--out", str(out), *options])
    with pytest.raises(SystemExit):
        main()
    commanded = pq.read_table(out / "signals.parquet")
    assert bits(commanded) == bits(run.to_arrow()) == bits(flight.to_arrow())
    assert Run(out).scenario.settings == run.scenario.settings


def test_tables_of_memory_and_folder_are_equal_in_units_too(flight: Flight, run: Run) -> None:
    ours, theirs = flight.to_arrow(), run.to_arrow()
    assert ours.schema.equals(theirs.schema, check_metadata=True)
    assert ours.schema.field("z").metadata[b"unit"] == b"m"
    assert bits(ours) == bits(theirs)  # nan too, which pyarrow's equals does not call equal
    rows = ours["uav"].to_numpy() == 3
    assert np.array_equal(ours["z"].to_numpy()[rows], flight.column("z", 3))
    assert set(ours.column_names) == {"t", "uav", *flight.names}


def test_pandas_and_polars_have_the_rows_of_arrow(flight: Flight, run: Run) -> None:
    pytest.importorskip("pandas")
    pytest.importorskip("polars")
    table = run.to_arrow()
    for recording in (flight, run):
        frame, other = recording.to_pandas(), recording.to_polars()
        assert list(frame.columns) == list(other.columns) == table.column_names
        for name in table.column_names:
            assert frame[name].to_numpy().tobytes() == other[name].to_numpy().tobytes() == bits(table)[name]
        assert frame.attrs["units"]["z"] == "m"


def test_xarray_has_a_row_per_time_and_a_column_per_uav(flight: Flight, run: Run) -> None:
    pytest.importorskip("xarray")
    for recording in (flight, run):
        data = recording.to_xarray()
        assert dict(data.sizes) == {"time": 151, "uav": 8}
        assert set(data.data_vars) == set(recording.to_arrow().column_names) - {"t", "uav"}
        for uav in recording.uavs:
            for name in ("z", "S1"):
                np.testing.assert_array_equal(data[name].sel(uav=uav), recording.column(name, uav))
        np.testing.assert_array_equal(data.time, recording.column("t", 1))
        assert (data.z.attrs["units"], data.time.attrs["units"]) == ("m", "s")
        assert data.attrs == {"scenario": "containment", "case": "flight+loss30", "seed": 7}


def test_xarray_has_nan_after_a_uav_was_lost(flight: Flight) -> None:
    pytest.importorskip("xarray")
    truth = flight.truth.copy()
    truth[100:, 2] = np.nan
    z = dataclasses.replace(flight, truth=truth).to_xarray().z
    assert np.isnan(z[100:, 2]).all()
    assert np.isfinite(z[:100]).all()
    assert np.isfinite(z.sel(uav=[1, 2, 4])).all()


@pytest.mark.parametrize("package", ["pandas", "polars", "xarray"])
def test_a_package_that_is_missing_is_one_sentence(
    flight: Flight, monkeypatch: pytest.MonkeyPatch, package: str
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingPackageError) as missing:
        getattr(flight, f"to_{package}")()
    assert str(missing.value) == (
        f"to_{package}: {package} is not installed; install it with: pip install {package}, or use to_arrow()"
    )


def test_claims_and_verdict_are_objects(tmp_path: Path) -> None:
    flight = simulate("demo")
    run = simulate("demo", tmp_path / "run")
    assert flight.claims() == run.claims() == Run(run.path).claims()
    assert len(flight.claims()) == 8
    assert all(result.ok for result in flight.claims())
    assert flight.verdict == run.verdict == Run(run.path).verdict
    assert flight.verdict.word == "as it should be"


def test_a_mission_or_a_scenario_is_flown_as_it_is(flight: Flight) -> None:
    scenario = load("containment", **CHOICES)
    mission = resolve(scenario)
    for given in (scenario, mission):
        assert bits(simulate(given).to_arrow()) == bits(flight.to_arrow())
        with pytest.raises(TypeError, match="seed: give it to load"):
            simulate(given, seed=3)
    assert bits(fly_in_memory(mission).to_arrow()) == bits(flight.to_arrow())


@pytest.mark.parametrize(
    ("scenario", "options"),
    [
        ("contanment", {}),
        ("demo", {"form": "monograph"}),
        ("demo", {"variants": "P"}),
        ("demo", {"settings": {"rates": {"control_rate": -1}}}),
        ("containment", {"settings": {"leaders.7.V": 28.0, "leaders.8.V": 28.0}}),
    ],
)
@pytest.mark.parametrize("recorded", [False, True])
def test_an_error_is_an_exception_with_the_text_of_the_command_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    scenario: str,
    options: Any,
    recorded: bool,
) -> None:
    with pytest.raises(ScenarioError) as refused:
        simulate(scenario, folder=tmp_path / "run" if recorded else None, **options)
    assert not (tmp_path / "run").exists()
    given = ["--form", options["form"]] if "form" in options else []
    given += ["--variant", options["variants"]] if "variants" in options else []
    if "settings" in options:
        from ftcc.groundside.scenario import setting_texts

        given += [part for text in setting_texts(options["settings"]) for part in ("--set", text)]
    monkeypatch.setattr(sys, "argv", ["ftcc", "simulate", scenario, *given])
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert capsys.readouterr().err.strip() == f"ftcc: {refused.value}"


def test_a_folder_that_holds_a_run_is_refused_and_one_that_was_flown_is_free_again(run: Run, tmp_path: Path) -> None:
    before = (run.path / "signals.parquet").read_bytes()
    with pytest.raises(RunError, match=r"already holds scenario\.toml"):
        simulate("demo", run.path, duration=0.5)
    assert (run.path / "signals.parquet").read_bytes() == before
    flown = simulate("demo", tmp_path / "run", duration=0.5)
    (flown.path / "scenario.toml").unlink()
    assert simulate("demo", tmp_path / "run", duration=0.5).names == flown.names


def test_what_a_scenario_remarks_is_a_warning_once_per_flight() -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        simulate("containment", settings={"gains.l1": 50.0}, duration=0.1)
    (warned,) = [one for one in caught if issubclass(one.category, ScenarioWarning)]
    assert "containment: " in str(warned.message)
    assert "l1" in str(warned.message)
    assert warned.filename == __file__


def test_progress_is_reported_and_ctrl_c_ends_a_flight_in_memory() -> None:
    times: list[float] = []
    simulate("containment", duration=0.5, progress=times.append)
    assert times == sorted(times)
    assert times[-1] == 0.5

    def interrupt(t: float) -> None:
        if t > 0.2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate("containment", duration=0.5, progress=interrupt)
