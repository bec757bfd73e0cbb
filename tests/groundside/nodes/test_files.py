"""Recordings come home whole, or it is said; nothing else is written."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from ftcc.groundside.nodes.files import FileError, Receiver, pieces, recorded_files


@pytest.fixture
def node(tmp_path: Path) -> Path:
    folder = tmp_path / "node"
    for name in ("parts", "logs"):
        (folder / name).mkdir(parents=True)
    noise = np.random.default_rng(1).bytes(600_000)
    (folder / "parts" / "1-vehicle.arrows").write_bytes(noise)
    (folder / "logs" / "uav1-vehicle.log").write_bytes(b"")
    (folder / "scenario.toml").write_text("stays")
    return folder


def home(tmp_path: Path) -> Path:
    folder = tmp_path / "home"
    folder.mkdir()
    return folder


def test_files_arrive_in_pieces(node: Path, tmp_path: Path) -> None:
    target = home(tmp_path)
    receiver = Receiver(target, lambda _: True)
    files = recorded_files(node)
    assert [file.name for file in files] == ["uav1-vehicle.log", "1-vehicle.arrows"]
    for file in files:
        for piece in pieces(node, file):
            receiver.take(piece)
    assert sorted(receiver.complete) == ["logs/uav1-vehicle.log", "parts/1-vehicle.arrows"]
    for file in files:
        assert (target / file.relative_to(node)).read_bytes() == file.read_bytes()


def test_a_missing_or_changed_piece_is_noticed(node: Path, tmp_path: Path) -> None:
    sent = list(pieces(node, node / "parts" / "1-vehicle.arrows"))
    assert len(sent) == 4
    receiver = Receiver(home(tmp_path), lambda _: True)
    receiver.take(sent[0])
    with pytest.raises(FileError, match="a piece is missing"):
        receiver.take(sent[2])
    receiver.take(sent[1][:-1] + b"x")
    receiver.take(sent[2])
    with pytest.raises(FileError, match="incomplete"):
        receiver.take(sent[3])
    assert receiver.complete == []


@pytest.mark.parametrize(
    "name", ["scenario.toml", "../x", "parts/../../x", "parts/", "parts/a/b", "parts/.x", "/etc/passwd", "parts/2-x"]
)
def test_no_other_file_is_written(name: str, tmp_path: Path) -> None:
    target = home(tmp_path)
    receiver = Receiver(target, lambda file: file.startswith("1-"))
    with pytest.raises(FileError):
        receiver.take(json.dumps({"name": name, "offset": 0}).encode() + b"\nx")
    with pytest.raises(FileError):
        receiver.take(b"nonsense")
    assert list(target.iterdir()) == []
