"""How the leading computer and the nodes reach each other: one Zenoh session each, linked to the lead alone.

Messages of the gate, datagrams and files travel under keys of their own. What arrives is kept for the main loop, which
waits for a descriptor; datagrams are handed on at once, in Zenoh's thread.
"""

from __future__ import annotations

import collections
import contextlib
import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from ftcc.groundside.nodes.messages import MessageError, decode, encode
from ftcc.link.linger import close_at_once, linger_again
from ftcc.link.mesh import configuration, import_zenoh
from ftcc.link.mesh_door import Door
from ftcc.link.mesh_keys import LEAD
from ftcc.link.mesh_refusals import RefusalCounter, RefusalTexts
from ftcc.link.mesh_security import Credentials, Rights, security

__all__ = ["PLANE", "Bell", "ControlPlane", "for_node", "from_node"]

PLANE = "nodes"
"""Takes the place of a swarm's name in keys."""
_PREFIX = f"ftcc/{PLANE}"
_JOIN = f"{_PREFIX}/lead/join"
_CLOCK = f"{_PREFIX}/lead/clock"
_LEAD_ALIVE = f"{_PREFIX}/lead/alive"


def for_node(name: str, what: str) -> str:
    """Return the key of what the lead sends to a node: "message", "datagram"."""
    return f"{_PREFIX}/lead/to/{name}/{what}"


def from_node(name: str, what: str) -> str:
    """Return the key of what a node sends: "message", "datagram", "file"; or its token, "alive"."""
    return f"{_PREFIX}/node/{name}/{what}"


class Bell:
    """Wakes up who waits for a descriptor, from any thread."""

    def __init__(self) -> None:
        self._event = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)

    def ring(self) -> None:
        """Make the descriptor readable."""
        os.eventfd_write(self._event, 1)

    def silence(self) -> None:
        """Make it unreadable until the next `ring`."""
        with contextlib.suppress(BlockingIOError):
            os.eventfd_read(self._event)

    def fileno(self) -> int:
        """Return the descriptor, for ``select``."""
        return self._event

    def close(self) -> None:
        """Free the descriptor."""
        os.close(self._event)


class ControlPlane:
    """One end.

    Parameters
    ----------
    listen, connect : endpoints of Zenoh, such as "tls/10.0.0.1:7447"; the lead listens, a node connects.
    timeout : silence after which a link counts as broken, wall s.
    tls : folder of keys, or None: nothing is encrypted.
    own : the name in this end's certificate.
    others : what may pass between this end and others, by the names in their certificates, see `access_control`.
    """

    def __init__(
        self,
        listen: str | None,
        connect: str | None,
        timeout: float,
        tls: Path | None,
        own: str,
        others: Mapping[str, Rights],
    ) -> None:
        self._texts: RefusalTexts | None = None
        refusals = None
        settings: Mapping[str, Any] = {}
        if tls is not None:
            settings = security(Credentials(tls, own), others)
            refusals = RefusalCounter(others, {connect: LEAD} if connect else {}, messages=False)
        self._zenoh = import_zenoh()
        connects = [connect] if connect else []
        self._session = self._zenoh.open(configuration(self._zenoh, listen, connects, timeout, settings))
        if refusals is not None:
            refusals.watch(self._session)
            self._texts = RefusalTexts(refusals)
        self._arrived: collections.deque[tuple[str, Any]] = collections.deque()
        self._bell = Bell()
        self._declared: list[Any] = [close_at_once(self._session)]
        self._foreign, self._next_foreign = 0, 1

    def fileno(self) -> int:
        """Return a descriptor that is readable where something has come."""
        return self._bell.fileno()

    def take(self) -> list[tuple[str, Any]]:
        """Return what has come since the last call: each with the name of its sender."""
        self._bell.silence()
        came = []
        while self._arrived:
            came.append(self._arrived.popleft())
        return came

    def refusals(self) -> list[str]:
        """Return what there is to tell of who and what was refused; to be called often, mostly nothing."""
        texts = [] if self._texts is None else self._texts.due()
        if self._foreign >= self._next_foreign:
            texts.append(f"{self._foreign} messages between computers were none of ours, and dropped")
            self._next_foreign = 10 * self._foreign
        return texts

    def drop(self) -> None:
        """Count something that came and belongs nowhere; from any thread."""
        self._foreign += 1

    def ignore_others(self, port: int, addresses: Iterable[str]) -> None:
        """From here on ignore callers at this end's port from other addresses, where links are encrypted."""
        if self._texts is not None:
            self._texts.door = Door(port, addresses)

    def keep(self, sender: str, what: Any) -> None:
        """Keep something for `take`; from any thread."""
        self._arrived.append((sender, what))
        self._bell.ring()

    def send(self, key: str, message: Any) -> None:
        """Send a message; it waits where the link is busy."""
        self._session.put(key, encode(message), congestion_control=self._zenoh.CongestionControl.BLOCK, express=True)

    def send_bytes(self, key: str, data: bytes, droppable: bool) -> None:
        """Send bytes; where the link is busy, droppable ones are lost."""
        control = self._zenoh.CongestionControl
        self._session.put(key, data, congestion_control=control.DROP if droppable else control.BLOCK, express=droppable)

    def listen_for_messages(self, key: str, sender: str) -> None:
        """Keep the messages that come under a key."""

        def keep(sample: Any) -> None:
            try:
                self.keep(sender, decode(bytes(sample.payload)))
            except MessageError:
                self.drop()

        self._declared.append(self._session.declare_subscriber(key, keep))

    def listen_for_bytes(self, key: str, take: Callable[[bytes], bool]) -> None:
        """Give ``take`` the bytes that come under a key, in Zenoh's thread; it returns whether they belong anywhere."""

        def keep(sample: Any) -> None:
            if not take(bytes(sample.payload)):
                self.drop()

        self._declared.append(self._session.declare_subscriber(key, keep))

    def live(self, key: str) -> None:
        """Declare a token, which is gone when this end is."""
        self._declared.append(self._session.liveliness().declare_token(key))

    def watch(self, key: str, changed: Callable[[bool], None]) -> None:
        """Call ``changed``, in Zenoh's thread, when the token ``key`` appears (True) or is gone (False)."""
        put = self._zenoh.SampleKind.PUT
        self._declared.append(
            self._session.liveliness().declare_subscriber(key, lambda one: changed(one.kind == put), history=True)
        )

    # The lead's.

    def answer(self, join: Callable[[Any], Any], clock: Callable[[], int]) -> None:
        """Answer those who want to join, and those who compare clocks, in Zenoh's thread."""

        def answer_join(query: Any) -> None:
            try:
                reply = join(decode(bytes(query.payload)))
            except MessageError:
                self.drop()
                return
            query.reply(_JOIN, encode(reply))

        self._declared += [
            self._session.declare_queryable(_JOIN, answer_join),
            self._session.declare_queryable(_CLOCK, lambda query: query.reply(_CLOCK, str(clock()).encode())),
        ]
        self.live(_LEAD_ALIVE)

    # A node's.

    def ask_to_join(self, message: Any, seconds: float) -> Any:
        """Return the lead's answer, or None if it gives none within ``seconds``."""
        for reply in self._session.get(_JOIN, payload=encode(message), timeout=seconds):
            if reply.ok is not None:
                return decode(bytes(reply.ok.payload))
        return None

    def ask_clock(self, seconds: float) -> int | None:
        """Return the lead's Unix time, ns, or None if it gives no answer within ``seconds``."""
        for reply in self._session.get(_CLOCK, timeout=seconds):
            if reply.ok is not None:
                return int(bytes(reply.ok.payload))
        return None

    def watch_lead(self, changed: Callable[[bool], None]) -> None:
        """As `watch`, for the lead."""
        self.watch(_LEAD_ALIVE, changed)

    def close(self) -> None:
        """Leave."""
        for declared in self._declared:
            declared.undeclare()
        linger_again()
        self._session.close()
        if self._texts is not None:
            self._texts.close()
        self._bell.close()
