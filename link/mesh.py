"""The mesh: one Zenoh peer per process, linked along the edges of the communication graph and to nobody else.

No multicast, no gossip, no router, loopback unless told otherwise. In real time a ring keeps the newest records; in
lockstep a queue keeps every record, in order. Both are polled: a callback per record would cost a thread switch each.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

from ftcc.link.mavlink import LOOPBACK

__all__ = ["Mesh"]

_RING = 16
"""Records kept of each sender in real time."""
_QUEUE = 1024
"""Records kept of each sender in lockstep; a sender is held back long before that."""


class Mesh:
    """The peer of a process that flies the UAVs ``own``.

    Parameters
    ----------
    swarm : str
        Name of the run; part of every key, so that two swarms never mix.
    own : ids of this process's UAVs.
    hears : ids of other processes' UAVs whose records are wanted.
    heard_by : pairs (own UAV, other process's UAV that hears it); the peer is ready when all of them have subscribed.
    listen : port of this peer, or None if nobody connects to it.
    connect : ports of the peers to connect to.
    ordered : deliver every record in order (lockstep) instead of the newest ones (real time).
    """

    def __init__(
        self,
        swarm: str,
        own: Iterable[int],
        hears: Iterable[int],
        heard_by: Iterable[tuple[int, int]],
        listen: int | None,
        connect: Iterable[int],
        ordered: bool,
    ) -> None:
        import zenoh  # after the fork: a child of a process that had opened Zenoh never sends

        self._zenoh = zenoh
        self._prefix = f"ftcc/{swarm}"
        self._awaited = {f"{self._prefix}/{hearer}/hears/{uav}" for uav, hearer in heard_by}
        self._session = zenoh.open(_configuration(zenoh, listen, connect))
        self._subscribers: list[Any] = []
        self._tokens: list[Any] = []
        hears = list(hears)
        own = list(own)
        for uav in hears:
            handler: Any = zenoh.handlers.FifoChannel(_QUEUE) if ordered else zenoh.handlers.RingChannel(_RING)
            self._subscribers.append(
                self._session.declare_subscriber(
                    f"{self._prefix}/{uav}/shared", handler, allowed_origin=zenoh.Locality.REMOTE
                )
            )
        self._publishers = {
            uav: self._session.declare_publisher(
                f"{self._prefix}/{uav}/shared", congestion_control=zenoh.CongestionControl.BLOCK, express=True
            )
            for uav in own
        }
        self._liveliness = self._session.liveliness().declare_subscriber(
            f"{self._prefix}/*/hears/*", self._greeted, history=True
        )
        # A token says "my subscription stands"; the sender waits for it before the flight.
        for uav in own:
            for sender in hears:
                self._tokens.append(self._session.liveliness().declare_token(f"{self._prefix}/{uav}/hears/{sender}"))

    def _greeted(self, sample: Any) -> None:
        if sample.kind == self._zenoh.SampleKind.PUT:
            self._awaited.discard(str(sample.key_expr))

    @property
    def ready(self) -> bool:
        """Whether all who hear this process's UAVs have subscribed."""
        return not self._awaited

    @property
    def awaited(self) -> list[str]:
        """Keys of the neighbours who have not subscribed yet."""
        return sorted(self._awaited)

    def publish(self, uav: int, payload: bytes) -> None:
        """Put a record of the process's UAV ``uav`` on the mesh."""
        self._publishers[uav].put(payload)

    def receive(self) -> list[bytes]:
        """The records that have arrived since the last call, those of one sender in order."""
        return [bytes(sample.payload) for ring in self._subscribers for sample in iter(ring.try_recv, None)]

    def close(self) -> None:
        """Drain and leave; closing with records unread would take seconds."""
        self.receive()
        for declared in (*self._tokens, self._liveliness, *self._subscribers, *self._publishers.values()):
            declared.undeclare()
        self._session.close()


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
