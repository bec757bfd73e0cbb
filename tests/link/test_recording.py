"""Parts and event logs: what can be read of them, also after the writer was killed."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from ftcc.link.recording import (
    ROWS,
    Column,
    EventLog,
    PartWriter,
    Recorder,
    is_full,
    part_path,
    read_events,
    read_part,
)

COLUMNS = (Column("t", "s", "simulated time"), Column("uav", "-", "id"), Column("z", "m", "altitude, up"))


def test_a_part_gives_back_its_rows_units_and_meanings(tmp_path: Path) -> None:
    path = part_path(tmp_path, 3, "vehicle")
    writer = PartWriter(path, COLUMNS)
    rows = np.array([(k / 100, 3, 1000.0 + k) for k in range(1234)])
    writer.write(rows[:500])
    writer.write(rows[500:500])
    writer.write(rows[500:])
    writer.close()
    writer.close()
    table = read_part(path)
    assert path == tmp_path / "parts" / "3-vehicle.arrows"
    assert table.column("z").to_pylist() == [1000.0 + k for k in range(1234)]
    assert set(table.column("uav").to_pylist()) == {3}
    assert table.schema.field("z").metadata == {b"unit": b"m", b"meaning": b"altitude, up"}
    assert table.schema.metadata[b"ftcc.schema"] == b"1"


@pytest.mark.parametrize("torn", [1, 100, 2000])
def test_a_part_whose_writer_was_killed_is_whole_up_to_its_last_batch(tmp_path: Path, torn: int) -> None:
    path = part_path(tmp_path, 1, "vehicle")
    writer = PartWriter(path, COLUMNS)
    rows = np.array([(k / 100, 1, math.pi * k) for k in range(700)])
    writer.write(rows[:500])
    whole = path.stat().st_size
    writer.write(rows[500:])
    with path.open("r+b") as file:
        file.truncate(whole + torn)
    table = read_part(path)
    assert table.column("z").to_pylist() == [math.pi * k for k in range(500)]


def test_a_recorder_writes_the_rows_that_each_uav_has_filled(tmp_path: Path) -> None:
    paths = [part_path(tmp_path, uav, "vehicle") for uav in (1, 2)]
    recorder = Recorder([paths[0], None, paths[1]], COLUMNS, on_trouble=pytest.fail)
    rows = recorder.rows
    for k in range(ROWS):
        assert not is_full(rows)
        rows.values[0, rows.filled[0]] = (k / 100, 1, k)
        rows.filled[0] += 1
    rows.values[2, 0] = (0.0, 2, -1.0)
    rows.filled[2] = 1
    assert is_full(rows)
    recorder.write()
    assert rows.filled.tolist() == [0, 0, 0]
    rows.values[0, 0] = (5.0, 1, 7.0)
    rows.filled[0] = 1
    recorder.write_if_due()
    assert rows.filled[0] == 1, "not old"
    recorder.close()
    assert read_part(paths[0]).column("z").to_pylist() == [*map(float, range(ROWS)), 7.0]
    assert read_part(paths[1]).column("z").to_pylist() == [-1.0]


def test_where_the_disk_is_full_a_part_ends_and_the_others_go_on(tmp_path: Path) -> None:
    paths = [tmp_path / "1-vehicle.arrows", tmp_path / "2-vehicle.arrows"]
    paths[1].symlink_to("/dev/full")
    told: list[str] = []
    recorder = Recorder(paths, COLUMNS, on_trouble=told.append)
    for _ in range(2):
        recorder.rows.values[:, 0] = (0.0, 1, 3.0)
        recorder.rows.filled[:] = 1
        recorder.write()
    recorder.close()
    assert read_part(paths[0]).column("z").to_pylist() == [3.0, 3.0]
    assert told == ["2-vehicle.arrows is not written any further: No space left on device"]


def test_a_log_of_events_on_a_full_disk_says_so_and_raises_nothing(tmp_path: Path) -> None:
    path = tmp_path / "events.jsonl"
    path.symlink_to("/dev/full")
    log = EventLog(path)
    log.write(1.0, "elevator fault", 1, "warning")
    assert log.trouble == "No space left on device"
    log.close()


def test_a_part_without_a_schema_is_no_part(tmp_path: Path) -> None:
    path = tmp_path / "1-vehicle.arrows"
    path.write_bytes(b"")
    assert read_part(path) is None


def test_events_come_back_in_order_of_simulated_time_without_a_torn_last_line(tmp_path: Path) -> None:
    path = tmp_path / "events.jsonl"
    log = EventLog(path)
    log.write(80.0, "elevator fault", 1, "warning")
    log.write(0.5, "all ready", late=0)
    log.close()
    with path.open("a") as file:
        file.write('{"t": 90.0, "te')
    events = read_events(path)
    assert [(event["t"], event["uav"], event["severity"], event["text"]) for event in events] == [
        (0.5, None, "info", "all ready"),
        (80.0, 1, "warning", "elevator fault"),
    ]
    assert events[0]["late"] == 0
    assert read_events(tmp_path / "none.jsonl") == []
