"""What the leading computer knows of one node: its share of the swarm, its processes, its place."""

from __future__ import annotations

import dataclasses
import subprocess
from collections.abc import Callable
from typing import Any

from ftcc.groundside.nodes.clock import Offset, with_unix
from ftcc.groundside.nodes.files import Receiver
from ftcc.groundside.nodes.messages import Delivered, ForChild, Kill, Placed
from ftcc.groundside.nodes.plan import NodeFields
from ftcc.groundside.nodes.relay import Relay
from ftcc.groundside.swarm import Child, Part
from ftcc.groundside.text import ids
from ftcc.link.ports import PortBlock

__all__ = ["KnownNode", "RemoteChild", "difference", "files_of", "flown"]


class RemoteChild(Child):
    """A process on a node."""

    def __init__(self, part: Part, send: Callable[[ForChild], None]) -> None:
        super().__init__(part)
        self._send = send

    def send(self, message: Any) -> None:
        self._send(ForChild(self.name, with_unix(message)))

    def kill(self) -> None:
        self._send(ForChild(self.name, Kill()))


@dataclasses.dataclass
class KnownNode:
    """What is known of one node."""

    fields: NodeFields
    vehicles: tuple[int, ...]
    autopilots: tuple[int, ...]
    address: str = ""
    """Numeric; "" until it has joined."""
    placed: Placed | None = None
    relay: Relay | None = None
    children: dict[str, RemoteChild] = dataclasses.field(default_factory=dict)
    receiver: Receiver | None = None
    delivered: Delivered | None = None
    gone: bool = False
    ssh: subprocess.Popen[bytes] | None = None

    @property
    def name(self) -> str:
        return self.fields.name

    @property
    def block(self) -> PortBlock:
        """The ports that it holds."""
        assert self.placed is not None
        return PortBlock(self.placed.port, tuple(sorted({*self.vehicles, *self.autopilots})))

    @property
    def offset(self) -> Offset:
        """This computer's clock minus the node's."""
        assert self.placed is not None
        return Offset(self.placed.offset, self.placed.uncertainty)


def files_of(node: KnownNode) -> Callable[[str], bool]:
    """Return which files may come home from a node: the logs of its processes, and the parts of its UAVs."""
    uavs = {str(uav) for uav in (*node.vehicles, *node.autopilots)}

    def allowed(file: str) -> bool:
        if file.endswith(".log"):
            return file.removesuffix(".log") in node.children
        return file.partition("-")[0] in uavs

    return allowed


def difference(what: str, asked: tuple[int, ...] | None, planned: tuple[int, ...]) -> str:
    """Return how what a node is to fly differs from the plan; "" if it does not."""
    if asked is None or asked == planned:
        return ""
    return f"it is to fly {what} {ids(asked) or 'none'}, the plan has {ids(planned) or 'none'} there"


def flown(node: KnownNode) -> str:
    if node.vehicles == node.autopilots:
        return f"UAVs {ids(node.vehicles)}"
    parts = (("vehicles", node.vehicles), ("autopilots", node.autopilots))
    return " and ".join(f"{what} {ids(uavs)}" for what, uavs in parts if uavs)
