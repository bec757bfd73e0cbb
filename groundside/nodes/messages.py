"""What the leading computer and the nodes say to each other, as JSON: messages of the gate, and those that surround it.

Nothing is unpickled: what comes from the network can only become one of the classes below, with fields of their types.
"""

from __future__ import annotations

import dataclasses
import json
from typing import Any

from pydantic import TypeAdapter, ValidationError

from ftcc.groundside.swarm import Exited, Part
from ftcc.link.gate import (
    Ended,
    EventReport,
    Go,
    Gone,
    Held,
    LawFailed,
    Limit,
    Lost,
    NetworkReport,
    Pace,
    Ready,
    Release,
    Stop,
)
from ftcc.link.process import MeshPlace

__all__ = [
    "Delivered",
    "ForChild",
    "FromChild",
    "GivenUp",
    "Join",
    "Kill",
    "Leaving",
    "MessageError",
    "Placed",
    "Refused",
    "Start",
    "Welcome",
    "decode",
    "encode",
]


class MessageError(ValueError):
    """What came is no message."""


@dataclasses.dataclass(frozen=True)
class Join:
    """Node -> lead, as a query: may I take part?"""

    name: str
    scenario: str
    """Name of the scenario that it is to fly; "" = any."""
    vehicles: tuple[int, ...] | None
    """Ids that it is to fly; None: those of the plan."""
    autopilots: tuple[int, ...] | None
    program: str
    """What must be equal on all computers for the same bits, see `program`."""
    address: str
    """Numeric address at which other computers reach it."""
    secured: bool
    """Whether it speaks by TLS."""


@dataclasses.dataclass(frozen=True)
class Refused:
    """Lead -> node: no, and why."""

    why: str


@dataclasses.dataclass(frozen=True)
class Welcome:
    """Lead -> node: yes."""

    name: str
    """Of the scenario."""
    run: str
    """Name of the run's folder."""
    toml: str
    """The scenario as flown."""
    vehicles: tuple[int, ...]
    autopilots: tuple[int, ...]
    signed: bool
    """Whether MAVLink to the ground is signed: then the node needs the key file."""
    timeout: float
    """Silence after which each counts the other as gone, wall s."""


@dataclasses.dataclass(frozen=True)
class Placed:
    """Node -> lead: the scenario is read, ports are held."""

    folder: str
    """Where its run is, as "computer:folder"."""
    port: int
    """First port of its block."""
    offset: float
    """The lead's clock minus its own, s."""
    uncertainty: float
    """Half the shortest round trip, s: the offset may be wrong by so much."""


@dataclasses.dataclass(frozen=True)
class Start:
    """Lead -> node: start these processes."""

    parts: tuple[Part, ...]
    swarm: str
    lockstep: bool
    peer_of: dict[int, int]
    peers: dict[int, MeshPlace]
    link_timeout: float
    known_addresses: bool
    listeners: tuple[tuple[str, int], ...]
    id_offset: int
    epoch_us: int


@dataclasses.dataclass(frozen=True)
class Kill:
    """Lead -> node: end a process at once."""


@dataclasses.dataclass(frozen=True)
class GivenUp:
    """Lead -> node that was gone and is back: the others fly on without it."""


@dataclasses.dataclass(frozen=True)
class Leaving:
    """Node -> lead: it ends before its processes do."""

    why: str


@dataclasses.dataclass(frozen=True)
class Delivered:
    """Node -> lead: all that its processes recorded has been sent."""

    files: int


_GATE = (Ended, EventReport, Go, Gone, Held, LawFailed, Limit, Lost, NetworkReport, Pace, Ready, Release, Stop)
_OURS = (Delivered, Exited, GivenUp, Join, Kill, Leaving, Placed, Refused, Start, Welcome)
_TYPES = {kind.__name__: TypeAdapter(kind) for kind in (*_GATE, *_OURS)}


@dataclasses.dataclass(frozen=True)
class FromChild:
    """Node -> lead: a message of one of its processes."""

    child: str
    message: Any


@dataclasses.dataclass(frozen=True)
class ForChild:
    """Lead -> node: a message for one of its processes."""

    child: str
    message: Any


def _as_document(message: Any) -> dict[str, Any]:
    return {"type": type(message).__name__, "fields": dataclasses.asdict(message)}


def encode(message: Any) -> bytes:
    """Return a message as JSON; an infinite speed is written as Infinity."""
    if isinstance(message, FromChild | ForChild):
        document = {"type": type(message).__name__, "child": message.child, "message": _as_document(message.message)}
    else:
        document = _as_document(message)
    return json.dumps(document).encode()


def _of_document(document: Any) -> Any:
    kind = _TYPES.get(str(document["type"]))
    if kind is None:
        raise MessageError(f"there is no message {document['type']!r}")
    return kind.validate_python(document["fields"])


def decode(data: bytes) -> Any:
    """Return the message that `encode` wrote.

    Raises
    ------
    MessageError
        If it is none.
    """
    try:
        document = json.loads(data)
        for wrapper in (FromChild, ForChild):
            if document["type"] == wrapper.__name__:
                return wrapper(str(document["child"]), _of_document(document["message"]))
        return _of_document(document)
    except (ValidationError, ValueError, KeyError, TypeError) as error:
        raise MessageError(f"{data[:80]!r} is no message: {error}") from None
