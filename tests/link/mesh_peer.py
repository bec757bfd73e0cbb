"""A process with one peer of the mesh, told what to do line by line: a JSON list in, a JSON value out."""

from __future__ import annotations

import json
import os
import select
import struct
import sys
import time
from typing import Any

import psutil

from ftcc.link.mesh import Mesh


class Peer:
    """The commands; numbered records are a UAV's id and a number."""

    def open(self, **arguments: Any) -> list[str]:
        self.mesh = Mesh(**arguments)
        return self.mesh.awaited

    def wait_until_ready(self, seconds: float) -> bool:
        until = time.monotonic() + seconds
        while not self.mesh.ready and time.monotonic() < until:
            select.select([self.mesh], [], [], 0.05)
            self.mesh.receive()
        return self.mesh.ready

    def awaited(self) -> list[str]:
        return self.mesh.awaited

    def publish(self, uav: int, first: int, last: int) -> None:
        """At most 8 at a time, so that nobody is overrun."""
        for n in range(first, last):
            self.mesh.publish(uav, struct.pack("<ii", uav, n))
            if n % 8 == 7:
                time.sleep(0.0005)

    def receive(self, count: int, seconds: float) -> list[list[int]]:
        """All that comes until ``count`` records are there, woken by the mesh alone."""
        arrived: list[list[int]] = []
        until = time.monotonic() + seconds
        while len(arrived) < count and time.monotonic() < until:
            select.select([self.mesh], [], [], 0.5)
            arrived += [list(struct.unpack("<ii", payload)) for payload in self.mesh.receive()]
        return arrived

    def poll(self, seconds: float) -> list[list[int]]:
        """What one reading gives after a pause: real time."""
        time.sleep(seconds)
        return [list(struct.unpack("<ii", payload)) for payload in self.mesh.receive()]

    def sockets(self) -> list[list[str]]:
        """Kind and local address of every internet socket of this process."""
        return [
            ["UDP" if c.type == 2 else "TCP", c.laddr.ip if c.laddr else "", c.status]
            for c in psutil.Process().net_connections("inet")
        ]

    def close(self) -> float:
        began = time.monotonic()
        self.mesh.close()
        return time.monotonic() - began


if __name__ == "__main__":
    peer = Peer()
    for line in sys.stdin:
        name, arguments = json.loads(line)
        print(json.dumps(getattr(peer, name)(**arguments)), flush=True)
    os._exit(0)
