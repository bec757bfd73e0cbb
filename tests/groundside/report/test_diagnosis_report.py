"""Reports of flights with diagnosis: faults beside what was found of them, false alarms, estimates; else nothing."""

from __future__ import annotations

import io
import json
import math
import re
from pathlib import Path

import pytest
from rich.console import Console

from ftcc.groundside import Run
from ftcc.groundside.report import as_json, show
from ftcc.groundside.report.diagnosis import _alarm_row, _row, diagnosis_sections
from ftcc.groundside.report.plates import Plates
from ftcc.groundside.scenario.loading import load
from ftcc.groundside.scenario.mission import resolve
from ftcc.groundside.simulation import simulate
from ftcc.groundside.verdict import Alarm, FaultFound

FAULT = FaultFound(
    uav=1, actuator="elevator", onset=10.0, until=60.0, true_kind="loss and bias", slew=math.inf, detected=10.2,
    isolated=10.8, kind="bias", compared=15.8, kind_compared="loss and bias", effectiveness=0.66,
    effectiveness_sd=0.02, bias=0.2, bias_sd=0.01, true_effectiveness=0.7, true_bias=0.15,
)  # fmt: skip
MISSED = FaultFound(
    uav=2, actuator="thrust", onset=20.0, until=60.0, true_kind="slow", slew=2.0, detected=math.nan, isolated=math.nan,
    kind="none", compared=math.nan, kind_compared="none", effectiveness=math.nan, effectiveness_sd=math.nan,
    bias=math.nan, bias_sd=math.nan, true_effectiveness=1.0, true_bias=0.0,
)  # fmt: skip


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A short flight with a fault of UAV 1."""
    fault = '{at = 6.0, uav = 1, actuator = "elevator", effectiveness = 0.6, bias = 0.1}'
    settings = ["diagnosis.on=true", f"faults=[{fault}]"]
    mission = resolve(load("containment", settings=settings, duration=16.0))
    return simulate(mission, tmp_path_factory.mktemp("runs") / "diagnosed")


def test_a_row_of_the_table_of_faults() -> None:
    row = [(cell.text, cell.mark) for cell in _row(FAULT)]
    assert row == [
        ("1", ""),
        ("elevator", ""),
        ("loss and bias: 70 % +0.15 rad", ""),
        ("10.00", ""),
        ("0.20", ""),
        ("0.80", ""),
        ("bias, later loss and bias", "warning"),
        ("0.66 +- 0.04", ""),
        ("-0.04", "holds"),
        ("0.2 +- 0.02 rad", ""),
        ("+0.05, outside", "fails"),
    ]
    row = [(cell.text, cell.mark) for cell in _row(MISSED)]
    assert row[2:7] == [("slow: at most 2 N/s", ""), ("20.00", ""), ("not", "fails"), ("not", "fails"), ("-", "open")]
    assert {text for text, _ in row[7:]} == {"-"}


def test_a_row_of_the_table_of_false_alarms() -> None:
    alarm = Alarm(3, "thrust", 12.0, 14.5, "faulty", "loss", ("elevator", "navigation"))
    texts = [cell.text for cell in _alarm_row(alarm)]
    assert texts == ["3", "thrust", "12.00", "14.50", "faulty", "loss", "elevator, navigation"]


def test_the_page_has_a_table_and_a_figure_of_the_uav_with_the_fault(run: Run, tmp_path: Path) -> None:
    found, *_ = diagnosis_sections(run, Plates(tmp_path))
    (row,) = found.rows
    assert len(row) == len(found.heads)
    assert (row[0].text, row[1].text, row[3].text) == ("1", "elevator", "6.00")
    assert float(row[4].text) < 2.0
    assert "effectiveness of elevator" in found.svg
    assert (tmp_path / "diagnosis_1.pdf").stat().st_size > 0


def test_terminal_and_json_have_the_fault(run: Run) -> None:
    written = io.StringIO()
    show(Console(file=written, width=200), run, [])
    assert "loss and bias: 60 % +0.1 rad" in re.sub(r"\s+", " ", written.getvalue())
    (fault,) = json.loads(as_json(run, []))["diagnosis"]["faults"]
    assert (fault["uav"], fault["actuator"], fault["true_kind"]) == (1, "elevator", "loss and bias")
    assert fault["slew"] is None
    assert 6.0 < fault["detected"] < 8.0


def test_a_run_without_diagnosis_reports_none(demo_run: Run) -> None:
    written = io.StringIO()
    show(Console(file=written, width=200), demo_run, [])
    assert "diagnosis" not in written.getvalue()
    assert "diagnosis" not in json.loads(as_json(demo_run, []))
