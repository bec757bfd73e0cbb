"""The mesh: one Zenoh peer per process, linked along the edges of the communication graph and to no others.

No multicast, no gossip, no router; loopback, unless the swarm flies on several computers. A process puts one
transmission on the mesh per exchange and subscribes to the processes of its in-neighbours. Zenoh's thread keeps what
arrives and writes to a pipe: so a process can wait for the mesh and for its sockets at once.
"""

from __future__ import annotations

import collections
import contextlib
import json
import os
import time
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from ftcc.link.linger import close_at_once, linger_again
from ftcc.link.traffic import Traffic

__all__ = ["Mesh", "configuration", "import_zenoh", "port_of"]

_RING = 16
"""Transmissions kept of each sender in real time."""

_RINGS = 64
"""Bytes read from the pipe at a time: there are one or two."""
_RUNTIME = "(" + ", ".join(f"{pool}: (handover: app)" for pool in ("acc", "rx", "tx", "net")) + ")"
"""One thread for all of Zenoh's work: to hand a record from one to another costs more than to send it."""


def import_zenoh() -> Any:
    """The module zenoh, to be imported after a fork: the child of a process that has opened Zenoh never sends."""
    os.environ.setdefault("ZENOH_RUNTIME", _RUNTIME)
    import zenoh

    return zenoh


class Mesh:
    """The peer of the process ``own``; the id of its first UAV is the name of a process.

    Parameters
    ----------
    swarm : str
        Name of the run; part of every key, so that two swarms never mix.
    own : name of this process.
    hears : names of the processes whose transmissions this one receives.
    heard_by : names of those that receive this one's; the peer is ready when all of them have subscribed.
    listen : endpoint of this peer, such as "tcp/127.0.0.1:20008", or None if nobody connects to it.
    connect : endpoints of the peers to connect to.
    ordered : deliver every transmission in order (lockstep) instead of the newest ones (real time).
    timeout : wall time after which a link over which nothing comes counts as broken, s.
    far : names of processes on other computers, whose traffic is measured.
    security : further settings of Zenoh, see `mesh_security`; empty: links are not encrypted.
    """

    def __init__(
        self,
        swarm: str,
        own: int,
        hears: Iterable[int],
        heard_by: Iterable[int],
        listen: str | None,
        connect: Iterable[str],
        ordered: bool,
        timeout: float = 1.0,
        far: Iterable[int] = (),
        security: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        zenoh = import_zenoh()

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
        far = set(far)
        self.traffic = {sender: Traffic() for sender in hears if sender in far}
        """By sender on another computer: what the network does to its transmissions."""
        self._dated = bool(far)
        self._session = zenoh.open(configuration(zenoh, listen, connect, timeout, security))
        self._links = [close_at_once(self._session)] if far else []
        self._subscribers = [
            self._session.declare_subscriber(
                f"{prefix}/{sender}/shared", self._keeper(sender), allowed_origin=zenoh.Locality.REMOTE
            )
            for sender in hears
        ]
        self._publisher = self._session.declare_publisher(
            f"{prefix}/{own}/shared",
            # In real time a computer that is gone holds up nobody.
            congestion_control=zenoh.CongestionControl.DROP if far and not ordered else zenoh.CongestionControl.BLOCK,
            express=True,
        )
        self._liveliness = self._session.liveliness().declare_subscriber(
            f"{prefix}/*/hears/{own}", self._greeted, history=True
        )
        # A token says "my subscription stands"; the sender waits for it before the flight.
        self._tokens = [self._session.liveliness().declare_token(f"{prefix}/{own}/hears/{sender}") for sender in hears]

    def _keeper(self, sender: int) -> Callable[[Any], None]:
        """The handler, in Zenoh's thread, of samples of ``sender``: keep it, and write to the pipe."""
        arrived, traffic = self._arrived[sender], self.traffic.get(sender)

        def keep(sample: Any) -> None:
            if traffic is not None and sample.attachment is not None:
                traffic.arrived(int.from_bytes(bytes(sample.attachment), "little"))
            arrived.append(bytes(sample.payload))
            self.mail[0] = 1
            if not self._rung:
                self._rung = True
                os.write(self._button, b".")

        return keep

    def _greeted(self, sample: Any) -> None:
        if sample.kind == self._zenoh.SampleKind.PUT:
            self._awaited.discard(str(sample.key_expr))

    @property
    def session(self) -> Any:
        """Zenoh's session."""
        return self._session

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
        if self._dated:
            self._publisher.put(payload, attachment=time.time_ns().to_bytes(8, "little"))
        else:
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
        declarations: list[Any] = [*self._links, *self._tokens, self._liveliness, *self._subscribers, self._publisher]
        for declared in declarations:
            declared.undeclare()
        if self._links:
            linger_again()
        self._session.close()
        os.close(self._bell)
        os.close(self._button)


def configuration(
    zenoh: Any, listen: str | None, connect: Iterable[str], timeout: float, security: Mapping[str, Any]
) -> Any:
    """Zenoh's configuration of a peer that speaks by the given endpoints alone; parameters as of `Mesh`."""
    settings: Mapping[str, Any] = {
        "mode": "peer",
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}, "delay": 0},
        "listen": {"endpoints": [listen] if listen else []},
        "connect": {
            "endpoints": list(connect),
            # For ever, and an attempt into a dead link is given up soon.
            "timeout_ms": -1,
            "exit_on_failure": False,
            "retry": {"period_init_ms": 100, "period_max_ms": 200, "period_increase_factor": 1.5},
        },
        "transport": {
            "unicast": {"open_timeout": 2000, "accept_timeout": 2000},
            "link": {
                "tx": {
                    "lease": round(1000.0 * timeout),
                    # A link that is full for longer is closed; not later than one over which nothing comes.
                    "queue": {"congestion_control": {"block": {"wait_before_close": round(9e5 * max(timeout, 5.0))}}},
                }
            },
            "shared_memory": {"enabled": False},
        },
    }
    return zenoh.Config.from_json5(json.dumps(merged(settings, security)))


def port_of(endpoint: str) -> int:
    """The port of an endpoint such as "tls/10.0.0.1:7447"."""
    return int(endpoint.rpartition(":")[2])


def merged(settings: Mapping[str, Any], more: Mapping[str, Any]) -> dict[str, Any]:
    """``settings`` with ``more``, table by table."""
    result = dict(settings)
    for name, value in more.items():
        before = result.get(name)
        if isinstance(before, Mapping) and isinstance(value, Mapping):
            value = merged(before, value)
        result[name] = value
    return result
