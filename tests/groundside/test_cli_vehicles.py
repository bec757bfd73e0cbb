"""`ftcc vehicles`: what each UAV believes beside the faults that it has."""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from ftcc.groundside.cli.ground import _faults_and_beliefs
from ftcc.groundside.dashboard import Feed, Snapshot
from tests.groundside.dashboard.synthetic_swarm import FAULT_AT, FOLLOWERS, snapshot
from tests.groundside.dashboard.test_diagnosis import believing

Said = tuple[dict[int, tuple[str, str]], dict[int, str]]
"""Faults and beliefs, and who is distrusted, by UAV."""


@pytest.fixture
def asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[Snapshot], Said]:
    """What is listed of a swarm that is as in a snapshot."""
    monkeypatch.setenv("FTCC_RUNTIME_DIR", str(tmp_path))

    def ask(shown: Snapshot) -> Said:
        over = threading.Event()

        def offer() -> None:
            while not over.wait(0.01):
                feed.offer(shown)

        with closing(Feed("swarm")) as feed:
            offering = threading.Thread(target=offer)
            offering.start()
            try:
                return _faults_and_beliefs("swarm")
            finally:
                over.set()
                offering.join()

    return ask


def test_beliefs_stand_beside_faults(asked: Callable[[Snapshot], Said]) -> None:
    words, _ = asked(believing(snapshot(FAULT_AT + 2.0)))
    assert words.pop(1) == ("elevator 70 % +0.35", "elevator loss 75 % +0.3")
    assert words == dict.fromkeys((uav for uav in FOLLOWERS if uav != 1), ("healthy", "healthy"))


def test_without_diagnosis_nothing_is_believed(asked: Callable[[Snapshot], Said]) -> None:
    assert asked(snapshot(FAULT_AT + 2.0)) == ({}, {})


def test_a_swarm_that_shows_nothing_is_listed_without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FTCC_RUNTIME_DIR", str(tmp_path))
    assert _faults_and_beliefs("swarm") == ({}, {})


def test_whom_a_uav_distrusts_is_listed_where_anybody_distrusts(asked: Callable[[Snapshot], Said]) -> None:
    shown = snapshot(5.0)
    receiver = next(uav for uav, state in shown.uavs.items() if state.links)
    state = shown.uavs[receiver]
    sender = min(state.links)
    doubted = {**state.links, sender: dataclasses.replace(state.links[sender], trust=0.1)}
    uavs = {**shown.uavs, receiver: dataclasses.replace(state, links=doubted)}
    _, doubts = asked(dataclasses.replace(shown, uavs=uavs))
    assert doubts == {uav: str(sender) if uav == receiver else "" for uav in shown.uavs}
