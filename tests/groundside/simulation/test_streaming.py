"""A recording that is written block by block, and read column by column: the same numbers, and little memory."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from ftcc.groundside.claims.claims import evaluate
from ftcc.groundside.cli.app import main
from ftcc.groundside.results import Run, column_reader, merging
from ftcc.groundside.results.table import TableWriter
from ftcc.groundside.scenario.loading import load
from ftcc.groundside.scenario.mission import Mission, resolve
from ftcc.groundside.simulation import fly_in_memory, to_disk

SECONDS = 12.0


def mission(*settings: str) -> Mission:
    return resolve(load("demo", settings=settings, duration=SECONDS))


def of_a_loss() -> Mission:
    """UAV 1 is lost after a while: from then on it has no rows."""
    return mission("start.uav.1.gamma=0.5", "plant.guards.flight_path_angle=0.501", "channel.loss=0.3")


@pytest.mark.parametrize("block", [1, 8 * 7, 8 * 100, 8 * 1201])
def test_blocks_of_any_size_give_the_table_of_the_flight(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block: int
) -> None:
    flown = of_a_loss()
    flight = fly_in_memory(flown)
    assert flight.lost
    monkeypatch.setattr(to_disk, "_BLOCK", block)
    recorded = to_disk.fly_to_disk(flown, tmp_path)
    if block == 1:
        assert pq.read_metadata(tmp_path / "signals.parquet").num_row_groups == 1201
    for table, values in (
        (recorded.signals, flight.table()),
        (pq.read_table(tmp_path / "links.parquet"), flight.link_table()),
    ):
        assert set(table.column_names) == set(values)
        for name, column in values.items():
            np.testing.assert_array_equal(table.column(name).to_numpy(), column, strict=True)
    assert recorded.lost == flight.lost
    assert recorded.verdict == flight.verdict
    assert Run(tmp_path).verdict == flight.verdict
    ours, theirs = (evaluate(one, flown.claims, flown.case, flown.graph) for one in (recorded, flight))
    assert ours == theirs


@pytest.mark.parametrize("memory", [0, 400_000, 1 << 30])
def test_columns_are_the_same_whatever_is_kept_of_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, memory: int
) -> None:
    flown = of_a_loss()
    monkeypatch.setattr(to_disk, "_BLOCK", 8 * 250)
    to_disk.fly_to_disk(flown, tmp_path)
    flight = fly_in_memory(flown)
    monkeypatch.setattr(column_reader, "_MEMORY", memory)
    recorded = Run(tmp_path)
    for name in recorded.names[2:] * 2:
        for uav in recorded.uavs:
            np.testing.assert_array_equal(recorded.column(name, uav), flight.column(name, uav))
    kept = sum(values.nbytes for values in recorded._columns._cache.values())
    assert kept == recorded._columns._cached_bytes
    assert kept <= max(memory, 8 * 1201)


def test_parts_are_joined_block_by_block(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from tests.groundside.results.test_run import write_parts

    whole = to_disk.fly_to_disk(of_a_loss(), tmp_path / "whole")

    def keep(uav: int, role: str) -> int | None:
        return {(2, "autopilot"): 700, (3, "vehicle"): 500, (5, "vehicle"): 0}.get((uav, role))

    tables = []
    for block in (8, 8 * 321, 1 << 20):
        monkeypatch.setattr(merging, "_BLOCK", block)
        tables.append(write_parts(whole, tmp_path / f"{block}", keep).signals)
    for table in tables[:2]:
        for name in table.column_names:
            np.testing.assert_array_equal(*(one.column(name).to_numpy() for one in (table, tables[2])), strict=True)


def peak(tmp_path: Path, seconds: float) -> float:
    """Peak of memory while a flight of so many seconds is flown and recorded, but not yet judged, MB."""
    program = (
        "import resource, sys\n"
        "from ftcc.groundside.simulation import to_disk\n"
        "from ftcc.groundside.scenario.mission import resolve\n"
        "from ftcc.groundside.scenario.loading import load\n"
        "to_disk._BLOCK = 8 * 500\n"
        "def ended(*_): print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3)\n"
        "to_disk._conclude = ended\n"
        "to_disk.fly_to_disk(resolve(load('containment', duration=float(sys.argv[1]))), sys.argv[2])\n"
    )
    command = [sys.executable, "-c", program, str(seconds), str(tmp_path / f"{seconds:g}")]
    return float(subprocess.run(command, capture_output=True, check=True, text=True).stdout)


def test_a_long_flight_takes_no_more_memory_than_a_short_one(tmp_path: Path) -> None:
    """At 0.3 MB a second, a recording in memory would take 170 MB more."""
    peak(tmp_path, 1.0)  # compiled
    assert peak(tmp_path, 600.0) - peak(tmp_path, 20.0) < 30.0


def test_ctrl_c_while_a_block_is_written_leaves_whole_blocks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(to_disk, "_BLOCK", 8 * 100)
    write = TableWriter.write
    blocks: list[int] = []

    def interrupted(self: TableWriter, values: Any) -> None:
        blocks.append(len(values["t"]))
        if len(blocks) == 4:
            os.kill(os.getpid(), signal.SIGINT)
        write(self, values)

    monkeypatch.setattr(TableWriter, "write", interrupted)
    # As at a terminal: whoever started the tests may have had Ctrl-C ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        recorded = to_disk.fly_to_disk(mission(), tmp_path)
    finally:
        signal.signal(signal.SIGINT, before)
    rows = recorded.signals.num_rows
    assert rows == 8 * 200 < 8 * 1201
    assert "interrupted" in [event["text"] for event in recorded.events]


def test_a_disk_that_gets_full_ends_in_one_line_and_leaves_nothing_half_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(self: TableWriter, values: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(TableWriter, "write", full)
    monkeypatch.setattr(sys, "argv", ["ftcc", "simulate", "containment", "--duration", "1", "--out", str(tmp_path)])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2
    assert "cannot be written: No space left on device; free some space, or give --out" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
