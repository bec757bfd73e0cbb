"""What a station knows, for whoever watches: snapshots over a socket of this machine, a JSON object a line.

A watcher that is slow misses snapshots, not events; one that dies is forgotten; without any who takes one, nothing is
even encoded. A line has some 1.7 kB a UAV.
"""

from __future__ import annotations

import contextlib
import json
import socket
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from ftcc.groundside.dashboard.snapshot import Event, LinkState, Pace, Snapshot, UavState
from ftcc.link.ports import runtime_folder

__all__ = ["Feed", "decode", "encode", "feed_path", "watch_swarm"]


def feed_path(name: str) -> Path:
    """Socket of the swarm called ``name``."""
    return runtime_folder() / f"{name}.feed"


def encode(snapshot: Snapshot) -> bytes:
    """A snapshot as a line."""
    # Its dataclasses are data by their fields, without the copies that `asdict` makes of everything in them.
    return json.dumps(snapshot, default=vars, separators=(",", ":")).encode() + b"\n"


def decode(line: bytes) -> Snapshot:
    """The inverse of `encode`.

    Raises
    ------
    ValueError
        If it is no snapshot.
    """
    try:
        data = json.loads(line)
        uavs = {int(uav): _state(state) for uav, state in data["uavs"].items()}
        pace = Pace(**data["pace"]) if data.get("pace") else None
        return Snapshot(float(data["t"]), uavs, tuple(Event(**event) for event in data["events"]), pace)
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"no snapshot: {error!r}") from None


def _state(data: Mapping[str, Any]) -> UavState:
    links = {int(sender): LinkState(**link) for sender, link in data["links"].items()}
    return UavState(**{field.name: data[field.name] for field in fields(UavState)} | {"links": links})


@dataclass
class _Watcher:
    link: socket.socket
    pending: bytes = b""
    """What has not been sent yet of the last line."""
    missed: tuple[Event, ...] = ()
    """Events of the snapshots that this watcher did not get."""


class Feed:
    """The station's end."""

    def __init__(self, name: str) -> None:
        self._path = feed_path(name)
        self._path.unlink(missing_ok=True)
        self._server = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._server.bind(str(self._path))
        self._server.listen()
        self._server.setblocking(False)
        self._watchers: list[_Watcher] = []

    def offer(self, snapshot: Snapshot) -> None:
        """Send ``snapshot`` to all who watch and keep up; returns at once."""
        with contextlib.suppress(BlockingIOError):
            link, _ = self._server.accept()
            link.setblocking(False)
            self._watchers.append(_Watcher(link))
        line: bytes | None = None
        for watcher in list(self._watchers):
            try:
                if not self._keeps_up(watcher):
                    watcher.missed += snapshot.events
                elif watcher.missed:
                    complete, watcher.missed = snapshot.after(watcher.missed), ()
                    self._send(watcher, encode(complete))
                else:
                    line = encode(snapshot) if line is None else line
                    self._send(watcher, line)
            except OSError:
                watcher.link.close()
                self._watchers.remove(watcher)

    def _keeps_up(self, watcher: _Watcher) -> bool:
        """Whether a watcher has taken all of the last line."""
        if watcher.pending:
            self._send(watcher, watcher.pending)
        return not watcher.pending

    def _send(self, watcher: _Watcher, line: bytes) -> None:
        """Send as much of a line as the watcher takes now; the rest is pending."""
        watcher.pending = line
        with contextlib.suppress(BlockingIOError):
            watcher.pending = line[watcher.link.send(line) :]

    def close(self) -> None:
        """Let everybody go."""
        for watcher in self._watchers:
            watcher.link.close()
        self._server.close()
        self._path.unlink(missing_ok=True)


def watch_swarm(name: str) -> Iterator[Snapshot]:
    """The snapshots of a running swarm from now on, until it ends.

    Raises
    ------
    OSError
        If it cannot be reached.
    """
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as link:
        link.connect(str(feed_path(name)))
        with link.makefile("rb") as lines, contextlib.suppress(ConnectionResetError):
            for line in lines:
                if line.endswith(b"\n"):
                    yield decode(line)
