"""Open files: counted before a flight, provided where the system lets it, refused with the number where not."""

from __future__ import annotations

import resource
import sys
from pathlib import Path

import pytest

from ftcc.groundside.cli.app import main
from ftcc.groundside.errors import UserError
from ftcc.groundside.scenario.loading import load
from ftcc.groundside.scenario.mission import resolve
from ftcc.groundside.swarm import registry
from ftcc.groundside.swarm.open_files import TooFewFilesError, files_needed, provide_files


class Limits:
    """Of open files: soft, and hard."""

    def __init__(self, soft: int, hard: int) -> None:
        self.now = soft, hard

    def set(self, _: int, wanted: tuple[int, int]) -> None:
        if wanted[0] > self.now[1]:
            raise ValueError("not allowed to raise maximum limit")
        self.now = wanted


@pytest.fixture
def limits(monkeypatch: pytest.MonkeyPatch) -> Limits:
    found = Limits(50, 100)
    monkeypatch.setattr(resource, "getrlimit", lambda _: found.now)
    monkeypatch.setattr(resource, "setrlimit", found.set)
    return found


def test_every_process_and_every_uav_in_one_counts() -> None:
    """Found in /proc of such flights with a viewer: launchers 78, 42 and 36, autopilots 27, 46 and 63."""
    mission = resolve(load("containment"))
    assert [files_needed(mission, pack, 2) for pack in (1, 4, 8)] == [88, 55, 82]


def test_room_is_made_up_to_what_the_system_allows(limits: Limits) -> None:
    mission = resolve(load("containment"))
    provide_files(mission, 4, 2)
    assert limits.now == (55, 100)
    provide_files(mission, 8, 2)
    assert limits.now == (82, 100)
    limits.now = 50, 87
    with pytest.raises(
        TooFewFilesError, match=r"up to 88 files, 87 are allowed: set `ulimit -n 88` .*or fly with --pack"
    ):
        provide_files(mission, 1, 2)
    limits.now = 20, 30
    with pytest.raises(TooFewFilesError, match=r"limits.conf\)$"):
        provide_files(mission, 1, 2)


def refused(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """What a flight that is refused says; it leaves nothing behind."""
    monkeypatch.setattr(sys, "argv", ["ftcc", "fly", "containment", "--viewer", "none", *arguments])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2
    return capsys.readouterr().err


def test_a_flight_without_room_is_refused_before_it_starts(
    limits: Limits, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    limits.now = 50, 80
    assert "ulimit -n 88" in refused(monkeypatch, capsys, "--out", str(tmp_path / "run"))
    assert not (tmp_path / "run").exists()


def test_a_block_of_ports_that_is_refused_leaves_a_folder_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    assert "must begin from 1 to" in refused(monkeypatch, capsys, "--out", str(tmp_path), "--port", "65500")
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_a_name_that_a_socket_cannot_have_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FTCC_RUNTIME_DIR", str(tmp_path))
    room = 107 - len(str(tmp_path / "ftcc" / ".feed"))
    registry.check_name("x" * room)
    with pytest.raises(UserError, match=f"its name may have at most {room} bytes"):
        registry.check_name("x" * (room + 1))
