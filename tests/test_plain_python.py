"""Compiled and plain Python fly the same flight, bit for bit: every shipped scenario, in every form."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.plain_python import CASES, digest

SECONDS = 1.0

# The first start compiles every law.
pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]


@pytest.fixture(scope="module")
def in_plain_python() -> dict[tuple[str, ...], str]:
    """Hashes of all cases, flown without numba."""
    program = subprocess.run(
        [sys.executable, "-m", "tests.support.plain_python", str(SECONDS)],
        cwd=Path(__file__).parents[1],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert program.returncode == 0, program.stderr
    rows = [line.split() for line in program.stdout.splitlines()]
    return {(scenario, form): bits for scenario, form, bits in rows}


@pytest.mark.parametrize(("scenario", "form"), CASES)
def test_the_first_second_has_the_same_bits(
    scenario: str, form: str, in_plain_python: dict[tuple[str, ...], str]
) -> None:
    assert digest(scenario, form, SECONDS) == in_plain_python[scenario, form]
