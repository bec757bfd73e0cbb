"""List the running swarms of this user, and send them commands through a socket."""

from __future__ import annotations

import contextlib
import json
import os
import socket
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ftcc.groundside.errors import UserError
from ftcc.link.ports import runtime_folder

__all__ = ["ControlSocket", "Entry", "VehicleEntry", "ask_swarm", "check_name", "find_swarm", "running_swarms"]


_MAX_SOCKET_PATH = 107
"""Longest path of a Unix socket, bytes."""


@dataclass(frozen=True)
class VehicleEntry:
    """One UAV of a running swarm."""

    uav: int
    system: int
    """MAVLink system id."""
    role: str
    """"follower" or "leader"."""
    port: int
    """On which its autopilot listens to ground stations."""
    in_neighbours: tuple[int, ...]
    """UAVs whose state it receives by radio."""

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> VehicleEntry:
        """Read an entry as `to_json` writes it."""
        others = {name: value for name, value in data.items() if name != "hears"}
        return cls(**others, in_neighbours=tuple(data["hears"]))

    def to_json(self) -> dict[str, Any]:
        """Return the entry as the registry file holds it."""
        data = asdict(self)
        data["hears"] = data.pop("in_neighbours")
        return data


@dataclass(frozen=True)
class Entry:
    """A running swarm."""

    name: str
    pid: int
    scenario: str
    folder: str
    vehicles: tuple[VehicleEntry, ...]
    key: str | None
    """Key file; None if MAVLink messages to the ground are not signed."""
    ports: tuple[int, int]
    """First and last port of its block."""
    viewer: str | None
    started: float
    """Wall time, s since 1970."""


def _entry_path(name: str) -> Path:
    return runtime_folder() / f"{name}.json"


def _socket_path(name: str) -> Path:
    return runtime_folder() / f"{name}.sock"


def check_name(name: str) -> None:
    """Refuse a swarm name that is in use, or too long for the paths of its sockets.

    Raises
    ------
    UserError
    """
    room = _MAX_SOCKET_PATH - len(os.fsencode(runtime_folder())) - len("/.feed")
    if len(os.fsencode(name)) > room:
        raise UserError(
            f"a swarm called {name!r} is listed in {runtime_folder()}: its name may have at most {room} bytes"
        )
    if any(entry.name == name for entry in running_swarms()):
        raise UserError(f"a swarm called {name!r} is running; give another folder with --out")


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def running_swarms() -> list[Entry]:
    """Return all swarms whose launcher is alive, and remove the entries of dead launchers."""
    found = []
    for path in sorted(runtime_folder().glob("*.json")):
        try:
            data = json.loads(path.read_text())
            vehicles = tuple(VehicleEntry.from_json(vehicle) for vehicle in data["vehicles"])
            entry = Entry(**{**data, "vehicles": vehicles, "ports": tuple(data["ports"])})
        except (ValueError, TypeError, KeyError, FileNotFoundError):
            continue  # another process is writing or removing it, or it is no registry file
        if _is_alive(entry.pid):
            found.append(entry)
        else:
            for stale in (path, _socket_path(entry.name)):
                stale.unlink(missing_ok=True)
    return found


def find_swarm(name: str | None) -> Entry:
    """Return the running swarm called ``name``; without a name, the only running swarm.

    Raises
    ------
    LookupError
        If there is no such swarm, or several run and ``name`` is None.
    """
    entries = running_swarms()
    names = ", ".join(entry.name for entry in entries) or "none"
    if name is None:
        if len(entries) == 1:
            return entries[0]
        raise LookupError(
            "no swarm is running" if not entries else f"several swarms are running, name one of them: {names}"
        )
    for entry in entries:
        if entry.name == name:
            return entry
    raise LookupError(f"no swarm {name!r} is running; running: {names}")


def ask_swarm(entry: Entry, command: str, **arguments: Any) -> Any:
    """Send a command to a swarm and return its answer.

    Raises
    ------
    RuntimeError
        If it refuses.
    OSError
        If it does not answer.
    """
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as link:
        link.settimeout(5.0)
        link.connect(str(_socket_path(entry.name)))
        link.sendall(json.dumps({"command": command, **arguments}).encode() + b"\n")
        answer = json.loads(link.makefile().readline())
    if not answer.get("ok"):
        raise RuntimeError(answer.get("error", "refused"))
    return answer.get("value")


class ControlSocket:
    """Register a swarm and answer commands from its socket, one JSON object per line."""

    def __init__(self, entry: Entry, handle: Callable[[str, dict[str, Any]], Any]) -> None:
        self._entry = entry
        self._handle = handle
        self._path = _socket_path(entry.name)
        self._path.unlink(missing_ok=True)
        self._server = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._server.bind(str(self._path))
        self._server.listen()
        self._server.setblocking(False)
        document = asdict(entry) | {"vehicles": [vehicle.to_json() for vehicle in entry.vehicles]}
        path = _entry_path(entry.name)
        path.with_suffix(".new").write_text(json.dumps(document))
        path.with_suffix(".new").rename(path)

    def fileno(self) -> int:
        """Return the descriptor for ``select``."""
        return self._server.fileno()

    def serve(self) -> None:
        """Answer one client; refuse one that sends an invalid request, or nothing for half a second."""
        with contextlib.suppress(BlockingIOError):
            link, _ = self._server.accept()
            with link:
                link.settimeout(0.5)
                try:
                    request = json.loads(link.makefile().readline())
                    command = request.pop("command")
                    answer = {"ok": True, "value": self._handle(command, request)}
                except Exception as error:  # a bad request must not end the flight
                    answer = {"ok": False, "error": str(error) or repr(error)}
                with contextlib.suppress(OSError):
                    link.sendall(json.dumps(answer).encode() + b"\n")

    def close(self) -> None:
        """Remove the swarm from the registry."""
        self._server.close()
        _entry_path(self._entry.name).unlink(missing_ok=True)
        self._path.unlink(missing_ok=True)
