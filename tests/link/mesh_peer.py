"""A process with one peer of the mesh, told what to do line by line: a JSON list in, a JSON value out."""

from __future__ import annotations

import json
import os
import select
import struct
import sys
import time
import traceback
from typing import Any

import psutil

from ftcc.link.mesh import Mesh


class Peer:
    """The commands; numbered transmissions are a process's name and a number."""

    def open(self, *, listen: int | None, connect: list[int], **arguments: Any) -> list[str]:
        here = "tcp/127.0.0.1:{}".format
        self.mesh = Mesh(**arguments, listen=here(listen) if listen else None, connect=[here(port) for port in connect])
        return self.mesh.awaited

    def wait_until_ready(self, seconds: float) -> bool:
        until = time.monotonic() + seconds
        while not self.mesh.ready and time.monotonic() < until:
            time.sleep(0.01)
        return self.mesh.ready

    def awaited(self) -> list[str]:
        return self.mesh.awaited

    def publish(self, own: int, first: int, last: int) -> None:
        for n in range(first, last):
            self.mesh.publish(struct.pack("<ii", own, n))

    def exchange(self, own: int, count: int, ahead: int, seconds: float) -> list[list[int]]:
        """Publish ``count`` records, never more than ``ahead`` beyond those received; what was received."""
        arrived: list[list[int]] = []
        sent = 0
        until = time.monotonic() + seconds
        while (sent < count or len(arrived) < count) and time.monotonic() < until:
            arrived += self._unpacked()
            while sent < min(count, len(arrived) + ahead):
                self.publish(own, sent, sent + 1)
                sent += 1
            time.sleep(0.0002)
        return arrived

    def _unpacked(self) -> list[list[int]]:
        return [list(struct.unpack("<ii", payload)) for _, payload in self.mesh.receive()]

    def receive(self, count: int, seconds: float) -> list[list[int]]:
        """All that comes until ``count`` records are there."""
        arrived: list[list[int]] = []
        until = time.monotonic() + seconds
        while len(arrived) < count and time.monotonic() < until:
            arrived += self._unpacked()
            time.sleep(0.001)
        return arrived

    def sleep(self, seconds: float) -> list[list[int]]:
        """What there is when the mesh has woken this process up, or nothing after ``seconds``."""
        return self._unpacked() if select.select([self.mesh], [], [], seconds)[0] else []

    def poll(self, seconds: float) -> list[list[int]]:
        """What one reading gives after a pause: real time."""
        time.sleep(seconds)
        return self._unpacked()

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
    try:
        for line in sys.stdin:
            name, arguments = json.loads(line)
            print(json.dumps(getattr(peer, name)(**arguments)), flush=True)
    except Exception:
        traceback.print_exc()
    # Threads of Zenoh would keep a process alive that ends in any other way.
    os._exit(1)
