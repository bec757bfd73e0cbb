"""What the tests of secured meshes share: processes with a peer, and keys."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from ftcc.link.mesh_authority import add_certificates, new_authority
from tests.link.secured import Process


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[[], Process]]:
    processes: list[Process] = []

    def one() -> Process:
        processes.append(Process(tmp_path / f"{len(processes)}.log"))
        return processes[-1]

    yield one
    for process in processes:
        process.kill()


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of folders: good, foreign, and copies of the good one in which UAV 2's certificate is out of time."""
    root = tmp_path_factory.mktemp("keys")
    for folder in ("good", "foreign"):
        new_authority(root / folder, "demo")
        add_certificates(root / folder, ["uav-1", "uav-2", "uav-3", "uav-7", "node-a", "lead"])
    for folder, begin, days in (("expired", 0.0, -0.01), ("early", 1.0, 1.0)):
        shutil.copytree(root / "good", root / folder)
        add_certificates(root / folder, ["uav-2"], days=days, begin_days=begin, renew=True)
    return root
