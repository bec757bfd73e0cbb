"""The session between the leading computer and a node, with real ones on loopback."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest

from ftcc.groundside.nodes.control_plane import ControlPlane
from ftcc.groundside.nodes.messages import Leaving
from tests.support.ports import free_port


@pytest.fixture
def ends() -> Iterator[tuple[ControlPlane, ControlPlane]]:
    """The lead and a node."""
    place = f"tcp/127.0.0.1:{free_port()}"
    lead = ControlPlane(place, None, 5.0, None, "lead", {})
    node = ControlPlane(None, place, 5.0, None, "node", {})
    yield lead, node
    node.close()
    lead.close()


def test_what_is_no_message_is_dropped_and_told(ends: tuple[ControlPlane, ControlPlane]) -> None:
    """Once for the first, again when there are ten times as many."""
    lead, node = ends
    lead.listen_for_messages("from/a", "a")
    lead.listen_for_bytes("datagrams/a", lambda data: data == b"known")
    told: list[str] = []
    came: list[object] = []
    until = time.monotonic() + 60.0
    while len(told) < 2 or not came:  # what is put before the other end has subscribed is lost
        assert time.monotonic() < until, (told, came)
        node.send_bytes("from/a", b"junk", droppable=False)
        node.send_bytes("datagrams/a", b"stray", droppable=False)
        node.send_bytes("datagrams/a", b"known", droppable=False)
        node.send("from/a", Leaving("it is over"))
        time.sleep(0.02)
        told += lead.refusals()
        came += lead.take()
    assert set(came) == {("a", Leaving("it is over"))}
    first, again = (int(text.split()[0]) for text in told[:2])
    assert told[0] == f"{first} messages between computers were none of ours, and dropped"
    assert again >= 10 * first > 0
