"""Send snapshots to watchers over a Unix socket, one JSON object per line.

A slow watcher misses snapshots but no events; one that dies is removed; without watchers nothing is encoded. A line has
about 1.7 kB per UAV.
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
    """Return the socket path of the swarm called ``name``."""
    return runtime_folder() / f"{name}.feed"


def encode(snapshot: Snapshot) -> bytes:
    """Encode a snapshot as one line of JSON."""
    # `vars` instead of `asdict`, which would copy everything in the dataclasses.
    return json.dumps(snapshot, default=vars, separators=(",", ":")).encode() + b"\n"


def decode(line: bytes) -> Snapshot:
    """Decode a line that `encode` has made.

    Raises
    ------
    ValueError
        If the line is no snapshot.
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
    """Part of the last line that has not been sent yet."""
    missed: tuple[Event, ...] = ()
    """Events of the snapshots that this watcher missed."""


class Feed:
    """The sender of a swarm's snapshots."""

    def __init__(self, name: str) -> None:
        self._path = feed_path(name)
        self._path.unlink(missing_ok=True)
        self._server = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._server.bind(str(self._path))
        self._server.listen()
        self._server.setblocking(False)
        self._watchers: list[_Watcher] = []

    def offer(self, snapshot: Snapshot) -> None:
        """Send ``snapshot`` to all watchers that keep up, without waiting."""
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
        """Return whether a watcher has received all of the last line."""
        if watcher.pending:
            self._send(watcher, watcher.pending)
        return not watcher.pending

    def _send(self, watcher: _Watcher, line: bytes) -> None:
        """Send as much of a line as the socket accepts now, and keep the rest pending."""
        watcher.pending = line
        with contextlib.suppress(BlockingIOError):
            watcher.pending = line[watcher.link.send(line) :]

    def close(self) -> None:
        """Disconnect all watchers and remove the socket."""
        for watcher in self._watchers:
            watcher.link.close()
        self._server.close()
        self._path.unlink(missing_ok=True)


def watch_swarm(name: str, timeout: float | None = None) -> Iterator[Snapshot]:
    """Yield the snapshots of a running swarm from now on, until it ends.

    Parameters
    ----------
    timeout : longest wait for the next one, wall s; None: for ever.

    Raises
    ------
    OSError
        If the swarm cannot be reached, or the next one does not come in time.
    """
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as link:
        link.settimeout(timeout)
        link.connect(str(feed_path(name)))
        with link.makefile("rb") as lines, contextlib.suppress(ConnectionResetError):
            for line in lines:
                if line.endswith(b"\n"):
                    yield decode(line)
