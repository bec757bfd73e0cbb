"""``ftcc fly --json`` from outside: one object per line, and the exit code that it names."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path


def test_standard_output_is_json_from_start_to_end(
    ftcc: Callable[..., subprocess.CompletedProcess[str]], tmp_path: Path
) -> None:
    options = ("--viewer", "none", "--mavlink", "none", "--pack", "auto", "--speed", "max", "--duration", "12")
    flown = ftcc("fly", "demo", "--json", *options, "--out", str(tmp_path / "run"))
    assert flown.returncode == 0, flown.stdout + flown.stderr
    lines = [json.loads(line) for line in flown.stdout.splitlines()]
    kinds = [line["type"] for line in lines]
    assert (kinds[:3], kinds[-1]) == (["start", "ready", "progress"], "end")
    assert set(kinds[3:-1]) <= {"progress", "event"}
    assert "leader commanded to 1080 m" in [line["text"] for line in lines if line["type"] == "event"]
    end = lines[-1]
    assert (end["t"], end["ticks"], end["exit_code"]) == (12.0, 8 * 1201, 0)
    assert end["verdict"] == json.loads((tmp_path / "run" / "verdict.json").read_text())["verdict"]
