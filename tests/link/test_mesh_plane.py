"""The control plane of nodes and the lead, encrypted: each speaks below its own name, and for nobody else."""

from __future__ import annotations

import time

from tests.link.secured import Process
from tests.support.ports import free_port


def hears(peer: Process, text: str, seconds: float = 5.0) -> bool:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if text in peer("all_heard"):
            return True
        time.sleep(0.01)
    return False


def test_the_lead_and_its_nodes_hear_ask_and_see_each_other(start, keys):
    lead, node, port = start(), start(), free_port()
    lead("open_plane", keys=str(keys / "good"), name="lead", nodes=["a"], listen=port)
    node("open_plane", keys=str(keys / "good"), name="node-a", nodes=[], connect=[port])
    assert hears(lead, "ftcc/demo/node/a/alive SampleKind.PUT")
    assert hears(node, "ftcc/demo/lead/alive SampleKind.PUT")
    lead("plane_put", key="ftcc/demo/lead/go", text="now")
    node("plane_put", key="ftcc/demo/node/a/telemetry", text="high")
    assert hears(node, "ftcc/demo/lead/go now")
    lead("plane_put", key="ftcc/demo/lead/to/a/message", text="fly")
    assert hears(node, "ftcc/demo/lead/to/a/message fly")
    assert hears(lead, "ftcc/demo/node/a/telemetry high")
    assert lead("plane_get", key="ftcc/demo/node/a/ask") == ["node-a answers"]
    assert node("plane_get", key="ftcc/demo/lead/ask") == ["lead answers"]
    assert (lead("refused", seconds=0.0), node("refused", seconds=0.0)) == ([], [])
    node.kill()
    assert hears(lead, "ftcc/demo/node/a/alive SampleKind.DELETE")


def test_a_node_is_not_heard_as_another_node(start, keys):
    """Even one that keeps no rules itself."""
    lead, node, port = start(), start(), free_port()
    lead("open_plane", keys=str(keys / "good"), name="lead", nodes=["a", "b"], listen=port)
    node("open_plane", keys=str(keys / "good"), name="node-a", nodes=[], connect=[port], lawless=True)
    assert hears(lead, "ftcc/demo/node/a/alive SampleKind.PUT")
    for _ in range(2):
        node("plane_put", key="ftcc/demo/node/b/telemetry", text="low")
    node("plane_put", key="ftcc/demo/node/a/telemetry", text="last")
    assert hears(lead, "ftcc/demo/node/a/telemetry last")
    assert not [text for text in lead("all_heard") if "/a/" not in text]
    assert ["may not put ftcc/demo/node/b/telemetry", "node-a", 2] in lead("refused", seconds=2.0, reason="put")


def test_a_node_does_not_hear_what_is_for_another(start, keys):
    """Though it asks for it, and keeps no rules itself."""
    lead, node, port = start(), start(), free_port()
    lead("open_plane", keys=str(keys / "good"), name="lead", nodes=["a", "b"], listen=port)
    node("open_plane", keys=str(keys / "good"), name="node-a", nodes=[], connect=[port], lawless=True)
    assert hears(lead, "ftcc/demo/node/a/alive SampleKind.PUT")
    assert ["may not subscribe to ftcc/demo/lead/**", "node-a", 1] in lead("refused", seconds=5.0, reason="subscribe")
    lead("plane_put", key="ftcc/demo/lead/to/b/message", text="secret")
    lead("plane_put", key="ftcc/demo/lead/to/a/message", text="fly")
    assert hears(node, "ftcc/demo/lead/to/a/message fly")
    assert not [text for text in node("all_heard") if "secret" in text]


def test_a_uav_has_no_rights_on_the_control_plane(start, keys):
    lead, uav, port = start(), start(), free_port()
    lead("open_plane", keys=str(keys / "good"), name="lead", nodes=["a"], listen=port)
    uav("open", keys=str(keys / "good"), name="uav-3", own=3, hears=[], heard_by=[], connect=[port], lawless=True)
    assert ["has no rights here", "uav-3 at 127.0.0.1", 1] in lead("refused", seconds=5.0, reason="rights")
    uav("put", key="ftcc/demo/node/a/telemetry", text="evil")
    uav("put", key="ftcc/demo/lead/go", text="evil")
    time.sleep(0.2)
    assert lead("all_heard") == []
