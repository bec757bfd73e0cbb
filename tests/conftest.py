"""Which tests are slow: those with real processes, clients and browsers, and those that say so themselves."""

from __future__ import annotations

from pathlib import Path

import pytest

SLOW_FOLDERS = ("sitl", "hosts", "clients", "browser")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark every test of `SLOW_FOLDERS` as slow."""
    here = Path(__file__).parent
    for item in items:
        if item.path.relative_to(here).parts[0] in SLOW_FOLDERS:
            item.add_marker(pytest.mark.slow)
