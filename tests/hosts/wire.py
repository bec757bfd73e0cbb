"""A bad wire between two network interfaces: ``python wire.py INNER OUTER`` hands every frame from one to the other.

Lines of JSON on its standard input say how bad the wire is (`Weather`); it ends when its input ends. It does what the
kernel's ``netem`` does, which many kernels are built without, and draws from a seed.
"""

from __future__ import annotations

import contextlib
import heapq
import itertools
import json
import os
import random
import select
import socket
import sys
from dataclasses import asdict, dataclass

__all__ = ["Weather"]

_EVERY_PROTOCOL = 3
_SOL_PACKET, _VNET_HDR, _IGNORE_OUTGOING = 263, 15, 23
"""Of <linux/if_packet.h>. With the header, a frame keeps the state of its checksum, which the sender left to be filled
in by hardware that is not there."""
_FRAME = 1 << 17
_RECEIVE_BUFFER_FORCE, _BUFFER = 33, 1 << 24


@dataclass(frozen=True)
class Weather:
    """How a wire treats frames, in both directions."""

    delay: float = 0.0
    """s, of each frame."""
    loss: float = 0.0
    """Probability that a frame is lost."""
    reorder: float = 0.0
    """Probability that a frame does not wait for ``delay`` and so overtakes those before it, as with netem."""
    seed: int = 1


class _Wire:
    """Frames under way between two interfaces."""

    def __init__(self, names: list[str]) -> None:
        self.sockets = [_open(name) for name in names]
        self.set(Weather())
        self._order = itertools.count()
        self._under_way: list[tuple[float, int, bytes, socket.socket]] = []

    def set(self, weather: Weather) -> None:
        self._weather = weather
        self._chance = random.Random(weather.seed)

    def take(self, source: socket.socket, now: float) -> None:
        """Read a frame; lose it, or put it on its way."""
        try:
            frame = source.recv(_FRAME)
        except OSError as error:  # the interface has gone, and the wire with it soon
            print(f"no frame: {error}", file=sys.stderr)
            return
        if self._chance.random() < self._weather.loss:
            return
        overtakes = self._chance.random() < self._weather.reorder
        target = self.sockets[1 - self.sockets.index(source)]
        delay = 0.0 if overtakes else self._weather.delay
        heapq.heappush(self._under_way, (now + delay, next(self._order), frame, target))

    def deliver(self, now: float) -> float | None:
        """Hand over what is due; returns the seconds until more is, or None."""
        while self._under_way and self._under_way[0][0] <= now:
            _, _, frame, target = heapq.heappop(self._under_way)
            try:
                target.send(frame)
            except OSError as error:  # an interface that is down takes nothing: the frame is lost
                print(f"lost a frame of {len(frame)} bytes: {error}", file=sys.stderr)
        return self._under_way[0][0] - now if self._under_way else None


def _open(name: str) -> socket.socket:
    opened = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(_EVERY_PROTOCOL))
    opened.setsockopt(_SOL_PACKET, _VNET_HDR, 1)
    opened.setsockopt(_SOL_PACKET, _IGNORE_OUTGOING, 1)
    # Frames of a flight come in bursts; the system's largest buffer may be too small for them.
    with contextlib.suppress(PermissionError):
        opened.setsockopt(socket.SOL_SOCKET, _RECEIVE_BUFFER_FORCE, _BUFFER)
    opened.bind((name, 0))
    return opened


def main(names: list[str]) -> None:
    """Hand frames over until the standard input ends."""
    import time

    wire = _Wire(names)
    orders = sys.stdin.fileno()
    wait: float | None = None
    print("ready", flush=True)
    while True:
        readable, _, _ = select.select([orders, *wire.sockets], [], [], wait)
        now = time.monotonic()
        for ready in readable:
            if ready == orders:
                line = os.read(orders, 4096)
                if not line:
                    return
                wire.set(Weather(**json.loads(line)))
                print("ready", flush=True)
            else:
                wire.take(ready, now)
        wait = wire.deliver(now)


def to_json(weather: Weather) -> str:
    """The line that tells a wire its weather."""
    return json.dumps(asdict(weather)) + "\n"


if __name__ == "__main__":
    main(sys.argv[1:])
