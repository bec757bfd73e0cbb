"""The command line: what it prints, where, and with which exit code."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from ftcc.groundside import Run
from ftcc.groundside.cli import main

Outcome = tuple[int, str, str]


@pytest.fixture
def ftcc(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Callable[..., Outcome]:
    """Run a command in an empty folder: exit code, standard output, standard error."""

    def run(*arguments: object) -> Outcome:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["ftcc", *map(str, arguments)])
        code = 0
        try:
            main()
        except SystemExit as exit_:
            code = int(exit_.code or 0)
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run


def test_list_shows_schemes_scenarios_forms_and_variants(ftcc: Callable[..., Outcome]) -> None:
    code, out, _ = ftcc("list")
    assert code == 0
    for word in ("containment", "demo", "monograph", "loss30", "Distributed fault-tolerant containment control"):
        assert word in out


@pytest.mark.parametrize(("columns", "whole"), [(80, False), (120, True)])
def test_help_lists_the_commands_by_section(
    ftcc: Callable[..., Outcome], monkeypatch: pytest.MonkeyPatch, columns: int, whole: bool
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    code, out, _ = ftcc("--help")
    assert code == 0
    sections = {
        title: re.findall(r"^  (\w+)  ", rows, re.M) for title, rows in re.findall(r"^(.+):\n((?:  .+\n)+)", out, re.M)
    }
    assert list(sections)[:5] == ["Options", "Scenarios", "Flights", "Results", "Commands to a running swarm"]
    assert {"check", "verify"} <= set(sections["Scenarios"])
    assert {"fly", "watch"} <= set(sections["Flights"])
    assert {"report", "export", "compare", "replay"} <= set(sections["Results"])
    assert {"fault", "link", "pause"} <= set(sections["Commands to a running swarm"])
    assert ("List schemes and bundled scenarios, with their forms and variants." in out) == whole


def test_check_names_every_case_that_it_checked(ftcc: Callable[..., Outcome]) -> None:
    code, out, _ = ftcc("check", "demo")
    assert code == 0
    assert "demo flight: 6 followers, 2 leaders" in out
    assert "can fly" in out


def test_simulate_records_where_it_says(ftcc: Callable[..., Outcome], tmp_path: Path) -> None:
    code, out, _ = ftcc("simulate", "demo", "--duration", 2, "--seed", 3, "--set", "channel.loss=0.5")
    assert code == 0
    (folder,) = (tmp_path / "runs").iterdir()
    assert re.fullmatch(r"demo-\d{8}-\d{6}", folder.name)
    assert f"recorded in runs/{folder.name}" in out
    run = Run(folder)
    assert (run.mission.timing.seed, run.mission.timing.duration) == (3, 2.0)
    assert run.scenario.plan.channel.loss == 0.5
    assert run.end == 2.0


def test_simulate_ends_with_1_if_an_aircraft_is_lost(ftcc: Callable[..., Outcome], tmp_path: Path) -> None:
    settings = ("--set", "faults.0.at=20", "--set", "faults.0.bias=0.6", "--set", "faults.0.without_trim=true")
    code, out, err = ftcc("simulate", "containment", "--duration", 40, "--out", tmp_path / "run", *settings)
    assert code == 1
    assert "no level trim" in err
    assert "UAV 1 lost at 26.3 s: flight-path angle outside the model's valid range" in out


@pytest.mark.parametrize(
    ("options", "strict", "code", "verdict"),
    [
        ([], True, 0, "as it should be"),
        (["--set", "gains.k41=80"], False, 0, "failed"),
        (["--set", "gains.k41=80"], True, 3, "failed"),
        (["--variant", "high_5"], True, 0, "with remarks"),
    ],
)
def test_simulate_ends_with_a_verdict_and_strict_by_it(
    ftcc: Callable[..., Outcome], tmp_path: Path, options: list[str], strict: bool, code: int, verdict: str
) -> None:
    given = ("containment", "--duration", 40, "--out", "run", *options)
    result, out, _ = ftcc("simulate", *given, *(["--strict"] if strict else []))
    assert result == code
    assert f"verdict: {verdict}" in out
    assert json.loads((tmp_path / "run" / "verdict.json").read_text())["verdict"] == verdict
    assert ("limit cycle of elevator" in out) == (verdict == "failed")
    assert ftcc("report", "run", "--no-page", *(["--strict"] if strict else []))[0] == code


def test_report_prints_the_claims_and_ends_with_0_if_all_hold(ftcc: Callable[..., Outcome], demo_run: Run) -> None:
    code, out, _ = ftcc("report", demo_run.path, "--no-page")
    assert code == 0
    assert "8 of 8 claims hold" in out
    assert "altitude tracking of UAV 1 at its fault" in out
    assert "link 8 - 4 cut" in out


def test_report_json_has_the_promised_fields(ftcc: Callable[..., Outcome], demo_run: Run) -> None:
    code, out, _ = ftcc("report", demo_run.path, "--json")
    report = json.loads(out)
    assert code == 0
    assert list(report) == ["scenario", "form", "variant", "verdict", "claims"]
    assert report["verdict"]["verdict"] == "as it should be"
    assert (report["scenario"], report["form"], report["variant"]) == ("demo", "flight", "")
    claim = report["claims"][3]
    assert list(claim) == ["name", "uavs", "window", "value", "unit", "expected", "tolerance", "source", "ok"]
    assert claim["uavs"] == [1]
    assert claim["window"] == [40.0, 42.0]
    assert claim["value"] == pytest.approx(0.453, rel=0.15)
    assert (claim["unit"], claim["expected"], claim["tolerance"]) == ("m", 0.453, "15 %")
    assert claim["ok"] is True


def test_report_says_null_for_what_was_not_flown(ftcc: Callable[..., Outcome], tmp_path: Path) -> None:
    assert ftcc("simulate", "demo", "--duration", 30, "--out", tmp_path / "short")[0] == 0
    code, out, _ = ftcc("report", tmp_path / "short", "--json")
    assert code == 0
    assert [claim["ok"] for claim in json.loads(out)["claims"]] == [True, None, True, None, None, None, None, None]
    assert json.loads(out)["claims"][1]["value"] is None


def test_report_ends_with_1_if_a_claim_fails(ftcc: Callable[..., Outcome], tmp_path: Path) -> None:
    ftcc("simulate", "demo", "--duration", 30, "--out", tmp_path / "bad", "--set", "claims.2.expected.flight=0.1")
    code, out, _ = ftcc("report", tmp_path / "bad", "--no-page")
    assert code == 1
    assert "FAILS" in out


def test_report_exports(ftcc: Callable[..., Outcome], tmp_path: Path) -> None:
    ftcc("simulate", "demo", "--duration", 1, "--out", tmp_path / "run")
    code, _, err = ftcc("report", "run", "--csv", "flight.csv", "--mat", "flight.mat")
    assert code == 0
    assert "wrote flight.csv" in err
    assert (tmp_path / "flight.csv").read_text().startswith('"t","uav","x"')
    assert (tmp_path / "flight.mat").stat().st_size > 1000
    assert "wrote run/report/index.html" in err
    assert {path.name for path in (tmp_path / "run" / "report").iterdir()} >= {"altitude.png", "elevator.pdf"}


def test_compare_lays_runs_over_each_other(ftcc: Callable[..., Outcome], tmp_path: Path, demo_run: Run) -> None:
    assert ftcc("simulate", "demo", "--duration", 8, "--out", "lossy", "--set", "channel.loss=0.3")[0] == 0
    code, out, err = ftcc("compare", demo_run.path, "lossy", "--out", "compared")
    assert code == 0
    assert "flight channel.loss=0.3" in out
    assert "wrote compared/index.html" in err
    assert (tmp_path / "compared" / "altitude.svg").exists()


def test_a_run_without_a_row_is_reported_as_far_as_it_goes(
    ftcc: Callable[..., Outcome], tmp_path: Path, demo_run: Run
) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "scenario.toml").write_text((demo_run.path / "scenario.toml").read_text())
    code, _, err = ftcc("report", "run")
    assert code == 1
    assert "nothing was recorded" in err
    assert (tmp_path / "run" / "report" / "index.html").exists()


@pytest.mark.parametrize(
    ("arguments", "fragments"),
    [
        (("simulate", "contanment"), ["contanment", "containment", "demo"]),
        (("simulate", "demo", "--form", "monograph"), ["form = 'monograph'", "flight"]),
        (("simulate", "demo", "--variant", "P"), ["variant = P"]),
        (("simulate", "demo", "--set", "rates.control_rate=-1"), ["rates.control_rate = -1", "greater than 0"]),
        (("simulate", "demo", "--set", "nonsense"), ["--set nonsense", "key.path=value"]),
        (("simulate", "demo", "--duration", "abc"), ["--duration"]),
        (("simulate", "demo", "--out", "/proc/none/run"), ["--out /proc/none/run", "cannot be written"]),
        (("check", "missing.toml"), ["missing.toml", "no such file"]),
        (("report", "nowhere"), ["nowhere", "no scenario.toml"]),
        (("report",), ["RUN"]),
        (("compare", "nowhere"), ["two runs"]),
        (("compare", "nowhere", "elsewhere"), ["nowhere", "not the folder of a run"]),
        (("launch",), ["launch"]),
    ],
    ids=lambda value: " ".join(map(str, value)) if isinstance(value, tuple) else "",
)
def test_bad_input_ends_with_2_and_one_message_on_standard_error(
    ftcc: Callable[..., Outcome], arguments: tuple[str, ...], fragments: list[str], tmp_path: Path
) -> None:
    code, out, err = ftcc(*arguments)
    assert code == 2
    for fragment in fragments:
        assert fragment in err
    assert "Traceback" not in err
    assert out == ""
    assert not (tmp_path / "runs").exists()


def test_simulate_prints_json_lines_and_nothing_else(ftcc: Callable[..., Outcome], tmp_path: Path) -> None:
    code, out, _ = ftcc("simulate", "demo", "--duration", 12, "--json", "--out", tmp_path / "run")
    lines = [json.loads(line) for line in out.splitlines()]
    kinds = [line["type"] for line in lines if line["type"] != "progress"]
    assert kinds == ["start", "ready", "event", "event", "end"]
    assert lines[-2]["text"] == "verdict: as it should be"
    end = lines[-1]
    assert (end["verdict"], end["t"], end["exit_code"], code) == ("as it should be", 12.0, 0, 0)
    assert [claim["ok"] for claim in end["claims"]] == [True, *[None] * 7]
    assert end["run"] == str(tmp_path / "run")
