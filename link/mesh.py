"""The mesh: one Zenoh peer per process, linked along the edges of the communication graph and to no others.

No multicast, no gossip, no router, loopback only. A process puts one transmission on the mesh per exchange and
subscribes to the processes of its in-neighbours. Zenoh's thread keeps what arrives and writes to a pipe: so a process
can wait for the mesh and for its sockets at once.
"""

from __future__ import annotations

import collections
import contextlib
import json
import os
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from ftcc.link.mavlink import LOOPBACK

__all__ = ["Mesh"]

_RING = 16
"""Transmissions kept of each sender in real time."""

_RINGS = 64
"""Bytes read from the pipe at a time: there are one or two."""
_RUNTIME = "(" + ", ".join(f"{pool}: (handover: app)" for pool in ("acc", "rx", "tx", "net")) + ")"
"""One thread for all of Zenoh's work: to hand a record from one to another costs more than to send it."""


class Mesh:
    """The peer of the process ``own``; the id of its first UAV is the name of a process.

    Parameters
    ----------
    swarm : str
        Name of the run; part of every key, so that two swarms never mix.
    own : name of this process.
    hears : names of the processes whose transmissions this one receives.
    heard_by : names of those that receive this one's; the peer is ready when all of them have subscribed.
    listen : port of this peer, or None if nobody connects to it.
    connect : ports of the peers to connect to.
    ordered : deliver every transmission in order (lockstep) instead of the newest ones (real time).
    """

    def __init__(
        self,
        swarm: str,
        own: int,
        hears: Iterable[int],
        heard_by: Iterable[int],
        listen: int | None,
        connect: Iterable[int],
        ordered: bool,
    ) -> None:
        os.environ.setdefault("ZENOH_RUNTIME", _RUNTIME)
        import zenoh  # after the fork: the child of a process that has opened Zenoh never sends

        self._zenoh = zenoh
        prefix = f"ftcc/{swarm}"
        hears = list(hears)
        self._awaited = {f"{prefix}/{hearer}/hears/{own}" for hearer in heard_by}
        self._arrived: dict[int, collections.deque[bytes]] = {
            sender: collections.deque(maxlen=None if ordered else _RING) for sender in hears
        }
        self._bell, self._button = os.pipe()
        self._rung = False
        for end in (self._bell, self._button):
            os.set_blocking(end, False)
        self.mail = np.zeros(1, np.int64)
        """(1,): 1 where something has arrived since the last `receive`; compiled code looks here between two ticks."""
        self._session = zenoh.open(_configuration(zenoh, listen, connect))
        self._subscribers = [
            self._session.declare_subscriber(
                f"{prefix}/{sender}/shared", self._keeper(sender), allowed_origin=zenoh.Locality.REMOTE
            )
            for sender in hears
        ]
        self._publisher = self._session.declare_publisher(
            f"{prefix}/{own}/shared", congestion_control=zenoh.CongestionControl.BLOCK, express=True
        )
        self._liveliness = self._session.liveliness().declare_subscriber(
            f"{prefix}/*/hears/{own}", self._greeted, history=True
        )
        # A token says "my subscription stands"; the sender waits for it before the flight.
        self._tokens = [self._session.liveliness().declare_token(f"{prefix}/{own}/hears/{sender}") for sender in hears]

    def _keeper(self, sender: int) -> Callable[[Any], None]:
        """The handler, in Zenoh's thread, of samples of ``sender``: keep it, and write to the pipe."""
        arrived = self._arrived[sender]

        def keep(sample: Any) -> None:
            arrived.append(bytes(sample.payload))
            self.mail[0] = 1
            if not self._rung:
                self._rung = True
                os.write(self._button, b".")

        return keep

    def _greeted(self, sample: Any) -> None:
        if sample.kind == self._zenoh.SampleKind.PUT:
            self._awaited.discard(str(sample.key_expr))

    def fileno(self) -> int:
        """For ``select``: readable once something has arrived since the last `receive`."""
        return self._bell

    @property
    def ready(self) -> bool:
        """Whether all that receive from this process have subscribed."""
        return not self._awaited

    @property
    def awaited(self) -> list[str]:
        """Keys of those that have not subscribed yet."""
        return sorted(self._awaited)

    def publish(self, payload: bytes) -> None:
        """Put a transmission on the mesh."""
        self._publisher.put(payload)

    def receive(self) -> list[tuple[int, bytes]]:
        """The transmissions that have arrived since the last call, with their senders; those of one in order."""
        # In this order: what arrives from here on is written again. If Zenoh's thread is just about to write, there is
        # nothing to read yet, and the process wakes up once more in vain.
        self._rung = False
        with contextlib.suppress(BlockingIOError):
            os.read(self._bell, _RINGS)
        self.mail[0] = 0
        received = []
        for sender, arrived in self._arrived.items():
            while arrived:
                received.append((sender, arrived.popleft()))
        return received

    def close(self) -> None:
        """Leave the mesh."""
        declarations: list[Any] = [*self._tokens, self._liveliness, *self._subscribers, self._publisher]
        for declared in declarations:
            declared.undeclare()
        self._session.close()
        os.close(self._bell)
        os.close(self._button)


def _configuration(zenoh: Any, listen: int | None, connect: Iterable[int]) -> Any:
    settings: Mapping[str, Any] = {
        "mode": "peer",
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}, "delay": 0},
        "listen": {"endpoints": [f"tcp/{LOOPBACK}:{listen}"] if listen else []},
        "connect": {
            "endpoints": [f"tcp/{LOOPBACK}:{port}" for port in connect],
            "retry": {"period_init_ms": 100, "period_max_ms": 200, "period_increase_factor": 1.5},
        },
        "transport": {"link": {"tx": {"lease": 1000}}, "shared_memory": {"enabled": False}},
    }
    return zenoh.Config.from_json5(json.dumps(settings))
