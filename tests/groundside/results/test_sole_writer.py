"""Two who write into one folder of results: the second is refused, and what the first writes stays."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from ftcc.groundside.cli.app import main
from ftcc.groundside.report.report import write_report
from ftcc.groundside.results import Run, RunError, new_folder
from ftcc.groundside.results.folders import BusyFolderError, sole_writer

HOLD = """
import sys, time
from ftcc.groundside.results import new_folder
new_folder("other", sys.argv[1])
print("held", flush=True)
time.sleep(60.0)
"""


@pytest.fixture
def held(tmp_path: Path) -> Iterator[Path]:
    """A folder in which another process has begun a run of which nothing is there yet."""
    folder = tmp_path / "run"
    process = subprocess.Popen([sys.executable, "-c", HOLD, str(folder)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    yield folder
    process.kill()
    process.wait()


@pytest.mark.parametrize("command", ["simulate", "study", "fly"])
def test_who_comes_second_is_refused_with_exit_code_2(
    held: Path, command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["ftcc", command, "demo", "--duration", "1", "--out", str(held)])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2
    assert f"{held}: another process is writing there" in capsys.readouterr().err
    assert not list(held.iterdir())


def test_the_death_of_the_first_lets_go(tmp_path: Path) -> None:
    process = subprocess.Popen([sys.executable, "-c", HOLD, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    process.stdout.readline()
    with pytest.raises(BusyFolderError):
        new_folder("demo", tmp_path)
    process.kill()
    process.wait()
    assert new_folder("demo", tmp_path) == tmp_path
    assert new_folder("demo", tmp_path) == tmp_path, "its own folder is open to a process"


def test_a_page_that_another_process_writes_is_not_mixed_with_another(tmp_path: Path) -> None:
    (tmp_path / "scenario.toml").write_text("")
    with sole_writer(tmp_path / "report"), pytest.raises(BusyFolderError):
        write_report(Run(tmp_path))
    with sole_writer(tmp_path / "report"):
        pass


@pytest.mark.parametrize("file", ["scenario.toml", "study.parquet"])
def test_a_study_does_not_replace_a_run_nor_a_run_a_study(tmp_path: Path, file: str) -> None:
    (tmp_path / file).write_text("")
    with pytest.raises(RunError, match=f"already holds {file}"):
        new_folder("demo", tmp_path, "studies")


def test_a_present_folder_that_cannot_be_written_says_what_to_give(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs").write_text("a file")
    with pytest.raises(RunError, match=r"^runs: cannot be written: .*; choose another folder with --out"):
        new_folder("demo")
