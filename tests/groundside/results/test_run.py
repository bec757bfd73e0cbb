"""A run's folder: the recording's columns and units, merging of parts, exports, flying again."""

from __future__ import annotations

import csv
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy.io import loadmat

from ftcc.airside.process import columns as autopilot_columns
from ftcc.groundside import Run, RunError, export, load, resolve
from ftcc.groundside.results import new_folder
from ftcc.groundside.simulation import fly_in_memory, simulate
from ftcc.link.recording import ROWS, PartWriter, part_path
from ftcc.sim.plants import conditions_of
from ftcc.sim.process import columns as vehicle_columns

TRUTH = ["x", "y", "z", "V", "gamma", "chi", "mu", "alpha", "beta", "theta", "p", "q", "r"]
COMMANDED = ["thrust_command", "elevator_command"]
ACTING = ["thrust", "elevator"]
CONDITIONS = [name for name, _ in conditions_of("longitudinal")]


def write_parts(run: Run, folder: Path, keep: Callable[[int, str], int | None] = lambda uav, role: None) -> Run:
    """What the processes of the same flight would have written, each up to ``keep(uav, role)`` rows."""
    folder.mkdir()
    shutil.copy(run.path / "scenario.toml", folder)
    leaders = run.mission.graph.leaders
    for uav in run.uavs:
        both = {"vehicle": vehicle_columns("longitudinal"), "autopilot": autopilot_columns(run.mission.signals)}
        for role, columns in both.items():
            if role == "autopilot" and uav in leaders:
                continue
            writer = PartWriter(part_path(folder, uav, role), columns)
            table = np.column_stack([run.column(column.name, uav) for column in columns])
            rows = table[: keep(uav, role)]
            for begin in range(0, len(rows), ROWS):
                writer.write(rows[begin : begin + ROWS])
            writer.close()
    return Run(folder)


def test_the_recording_has_a_row_per_tick_and_uav_and_the_columns_in_their_order(demo_run: Run) -> None:
    table = demo_run.signals
    signals = [quantity.name for quantity in demo_run.mission.scheme.signals]
    assert table.column_names == ["t", "uav", *TRUTH, *COMMANDED, *ACTING, *CONDITIONS, *signals]
    assert table.num_rows == 8 * 12001
    assert table.column("t").to_pylist()[:9] == [0.0] * 8 + [0.01]
    assert table.column("uav").to_pylist()[:9] == [1, 2, 3, 4, 5, 6, 7, 8, 1]
    assert demo_run.uavs == (1, 2, 3, 4, 5, 6, 7, 8)
    assert np.isnan(demo_run.column("S1", 7)).all()


def test_units_and_meanings_stand_in_the_file(demo_run: Run) -> None:
    schema = pq.read_schema(demo_run.path / "signals.parquet")
    assert schema.metadata[b"ftcc.schema"] == b"1"
    assert schema.field("z").metadata == {b"unit": b"m", b"meaning": b"altitude, up"}
    assert demo_run.columns["elevator_command"].unit == "rad"
    assert demo_run.columns["thrust"].unit == "N"
    assert demo_run.columns["zhat"].unit == "m"
    assert all(column.unit for column in demo_run.columns.values())


def test_the_recording_is_the_flight(demo_run: Run) -> None:
    flight = fly_in_memory(demo_run.mission)
    for name in ("t", "z", "elevator_command", "elevator", "S1"):
        for uav in (1, 6, 7):
            np.testing.assert_array_equal(demo_run.column(name, uav), flight.column(name, uav))


def test_a_run_that_goes_on_is_merged_anew_and_shows_one_state_at_a_time(demo_run: Run, tmp_path: Path) -> None:
    run = write_parts(demo_run, tmp_path / "goes-on", lambda uav, role: 500)
    then = run.end
    assert run.file.stat().st_mtime_ns == max(part.stat().st_mtime_ns for part in (run.path / "parts").iterdir())
    whole = write_parts(demo_run, tmp_path / "whole")
    shutil.copytree(whole.path / "parts", run.path / "parts", dirs_exist_ok=True)
    assert Run(run.path).end == demo_run.end > then
    assert len(run.column("z", 1)) == len(run.column("t", 1)) == 500


def test_parts_merge_into_the_very_file_that_the_single_process_writes(demo_run: Run, tmp_path: Path) -> None:
    merged = write_parts(demo_run, tmp_path / "parts-run")
    assert merged.signals.schema.equals(demo_run.signals.schema, check_metadata=True)
    for name in demo_run.names:
        ours, theirs = (run.signals.column(name).to_numpy() for run in (merged, demo_run))
        np.testing.assert_array_equal(ours, theirs, strict=True)


def test_what_killed_processes_wrote_is_kept(demo_run: Run, tmp_path: Path) -> None:
    def keep(uav: int, role: str) -> int | None:
        return {(2, "autopilot"): 700, (3, "vehicle"): 500, (3, "autopilot"): 600, (5, "vehicle"): 0}.get((uav, role))

    run = write_parts(demo_run, tmp_path / "killed", keep)
    assert len(run.column("z", 2)) == 12001
    assert np.isfinite(run.column("S1", 2)).sum() == 700
    assert len(run.column("t", 3)) == 600
    assert np.isfinite(run.column("z", 3)).sum() == 500
    assert np.isnan(run.column("z", 5)).all()
    assert len(run.column("z", 1)) == 12001


def test_a_run_without_anything_recorded_says_so(demo_run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "empty"
    folder.mkdir()
    with pytest.raises(RunError, match=r"no scenario\.toml"):
        Run(folder)
    shutil.copy(demo_run.path / "scenario.toml", folder)
    with pytest.raises(RunError, match="nothing was recorded"):
        _ = Run(folder).signals


def test_an_unknown_column_names_those_that_exist(demo_run: Run) -> None:
    with pytest.raises(RunError, match=r"no column 'zz'.*elevator_command"):
        demo_run.column("zz", 1)


def test_a_run_flies_again_bit_for_bit(demo_run: Run, tmp_path: Path) -> None:
    again = simulate(resolve(load(demo_run.path)), tmp_path / "again")
    for name in demo_run.names:
        np.testing.assert_array_equal(
            again.signals.column(name).to_numpy(), demo_run.signals.column(name).to_numpy(), strict=True
        )
    assert again.mission.toml == demo_run.mission.toml


def test_events_tell_what_was_planned(demo_run: Run) -> None:
    told = [(event["t"], event["uav"], event["text"]) for event in demo_run.events]
    assert (40.0, 1, "elevator fault: effectiveness 0.7, bias 0.35 rad") in told
    assert (76.0, None, "link 8 - 4 cut") in told
    assert (84.0, None, "link 8 - 4 restored") in told
    assert demo_run.lost == {}


def test_the_rows_of_a_lost_uav_end_and_the_others_fly_on(tmp_path: Path) -> None:
    settings = ["faults.0.at=20", "faults.0.bias=0.6", "faults.0.without_trim=true"]
    run = simulate(resolve(load("containment", settings=settings, duration=60.0)), tmp_path / "lost")
    assert list(run.lost) == [1]
    assert run.lost[1] == (pytest.approx(26.34), "flight-path angle outside the model's valid range")
    assert run.verdict.failures[0] == "UAV 1 lost at 26.3 s: flight-path angle outside the model's valid range"
    end = run.column("t", 1)[-1]
    assert 20.0 < end < 60.0
    assert all(run.column("t", uav)[-1] == 60.0 for uav in range(2, 9))
    assert np.isfinite(run.column("z", 1)).all()


def test_csv_and_mat_hold_the_same_numbers(demo_run: Run, tmp_path: Path) -> None:
    short = simulate(resolve(load("demo", duration=1.0)), tmp_path / "short")
    export(short, "csv", tmp_path / "flight.csv")
    with (tmp_path / "flight.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 8 * 101
    assert float(rows[8]["z"]) == short.column("z", 1)[1]
    export(short, "mat", tmp_path / "flight.mat")
    contents: dict[str, Any] = loadmat(tmp_path / "flight.mat", squeeze_me=True)
    np.testing.assert_array_equal(contents["uav4"]["elevator"][()], short.column("elevator", 4))
    assert contents["units"]["gamma"][()] == "rad"


def test_the_folder_of_a_new_run_is_never_one_that_holds_a_run(
    demo_run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(RunError, match=r"already holds scenario\.toml"):
        new_folder("demo", demo_run.path)
    monkeypatch.chdir(tmp_path)
    assert len({new_folder("demo") for _ in range(3)}) == 3
    (tmp_path / "file").write_text("")
    with pytest.raises(RunError, match="cannot be written"):
        new_folder("demo", tmp_path / "file" / "run")
