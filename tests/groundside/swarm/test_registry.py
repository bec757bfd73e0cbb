"""The control socket of a swarm: every client gets an answer, and no request ends the flight."""

from __future__ import annotations

import json
import os
import select
import socket
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from ftcc.groundside.swarm.registry import ControlSocket, Entry, ask_swarm, find_swarm
from ftcc.link.ports import runtime_folder


def steps(command: str, arguments: dict[str, Any]) -> int:
    """As a swarm reads a step."""
    if command != "step":
        raise ValueError(f"unknown command {command!r}")
    return int(arguments["ticks"])


@pytest.fixture
def control(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ControlSocket]:
    monkeypatch.setenv("FTCC_RUNTIME_DIR", str(tmp_path))
    entry = Entry("bench", os.getpid(), "containment", str(tmp_path), (), None, (0, 0), None, 0.0)
    with closing(ControlSocket(entry, steps)) as one:
        yield one


def answer_to(control: ControlSocket, line: bytes) -> dict[str, Any]:
    """What the swarm answers to a line."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as link:
        link.settimeout(5.0)
        link.connect(str(runtime_folder() / "bench.sock"))
        link.sendall(line + b"\n")
        control.serve()
        answer: dict[str, Any] = json.loads(link.makefile().readline())
        return answer


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"no json",
        b"[1]",
        b"7",
        b"null",
        b'{"ticks": 1}',
        b'{"command": "land"}',
        b'{"command": "step"}',
        b'{"command": "step", "ticks": null}',
        b'{"command": "step", "ticks": [1]}',
        b'{"command": "step", "ticks": Infinity}',
        b'{"command": ["step"]}',
        b"\xff\xfe",
    ],
)
def test_nonsense_is_refused_and_the_next_caller_is_answered(control: ControlSocket, line: bytes) -> None:
    refused = answer_to(control, line)
    assert not refused["ok"]
    assert refused["error"]
    assert answer_to(control, b'{"command": "step", "ticks": 3}') == {"ok": True, "value": 3}


def serve_once(control: ControlSocket) -> None:
    """Answer the next caller."""
    select.select([control], [], [], 5.0)
    control.serve()


def test_a_swarm_is_found_and_takes_a_command(control: ControlSocket) -> None:
    server = threading.Thread(target=serve_once, args=(control,))
    server.start()
    assert ask_swarm(find_swarm(None), "step", ticks=5) == 5
    server.join()
