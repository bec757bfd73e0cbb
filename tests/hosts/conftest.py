"""Hosts of a network that is not there."""

from __future__ import annotations

import pytest

from tests.hosts.network import why_not


@pytest.fixture(scope="session", autouse=True)
def hosts_are_possible() -> None:
    """Skip, with the reason, where this machine lets nobody have namespaces."""
    reason = why_not()
    if reason:
        pytest.skip(reason)
