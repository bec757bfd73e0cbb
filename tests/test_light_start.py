"""What a start loads: a command that only tells nothing that flies, a child process nothing of the ground."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

GROUND = {"pydantic", "typer", "click", "rich", "jinja2", "matplotlib", "rerun", "tomli_w", "scipy.optimize"}
"""What only the ground checks, shows or computes with."""

HEAVY = {"numba", "numpy", "scipy", "pydantic", "pyarrow", "pymavlink", "zenoh", "rerun", "matplotlib"}
"""Each takes longer to load than a command that only tells has to answer."""

PRELOADED = {"FTCC_PRELOAD_SCHEME": "containment", "FTCC_PRELOAD_PLANT": "longitudinal", "FTCC_PRELOAD_ACTIVE": ""}


def loaded(program: str, **environment: str) -> set[str]:
    """The modules that a program has loaded when it ends."""
    hidden = ("FTCC_PRELOAD_SCHEME", "NUMBA_DISABLE_JIT")
    finished = subprocess.run(
        [sys.executable, "-c", f"import sys\n{program}\nprint('loaded', *sys.modules)"],
        env={name: value for name, value in os.environ.items() if name not in hidden} | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert finished.returncode == 0, finished.stderr
    return set(finished.stdout.splitlines()[-1].removeprefix("loaded ").split())


def test_what_is_forked_has_loaded_nothing_that_its_children_do_not_need():
    """Whatever it loads costs every swarm its start."""
    found = loaded("import ftcc.groundside.swarm.preload", **PRELOADED)
    assert {"numba", "pyarrow"} <= found
    assert not found & GROUND
    assert not [
        name for name in found if name.startswith(("ftcc.groundside.schema", "ftcc.groundside.scenario.loading"))
    ]


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="counts threads as Linux shows them")
def test_what_is_forked_has_no_threads():
    """Not Python's alone: of those that a library starts, such as Arrow's allocator, no child would have any."""
    loaded(
        "import os, ftcc.groundside.swarm.preload\nassert len(os.listdir('/proc/self/task')) == 1",
        **PRELOADED,
        OPENBLAS_NUM_THREADS="1",
    )


@pytest.mark.parametrize("command", ["list", "ps", "--help"])
def test_a_command_that_only_tells_loads_nothing_that_checks_or_flies(command, tmp_path, monkeypatch):
    monkeypatch.setenv("FTCC_RUNTIME_DIR", str(tmp_path))
    program = f"from ftcc.groundside.cli import app; app([{command!r}], standalone_mode=False)"
    loaded(program)  # the first list after an edit asks the schemes themselves
    assert not loaded(program) & HEAVY
