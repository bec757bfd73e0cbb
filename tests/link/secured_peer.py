"""A process with one secured peer of the mesh, told what to do line by line: a JSON list in, a JSON value out."""

from __future__ import annotations

import json
import os
import sys
import time
import traceback
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from ftcc.link.mesh import Mesh, configuration, import_zenoh
from ftcc.link.mesh_door import Door
from ftcc.link.mesh_refusals import _MOST, RefusalCounter
from ftcc.link.mesh_security import Credentials, Rights, lead_access, node_access, security, uav_access

SWARM = "run"

_DENIED = (
    "2026-01-01T00:00:00.000000Z TRACE app-0 ThreadId(02) zenoh::net::routing::interceptor::access_control: "
    "Using cached result: ab is unauthorized to Put (ingress) on {key}\n"
)
"""A line of Zenoh's log."""


class Peer:
    """The commands."""

    def open(
        self,
        *,
        keys: str,
        name: str,
        own: int,
        hears: list[int],
        heard_by: list[int],
        listen: int = 0,
        connect: tuple[int, ...] = (),
        scheme: str = "tls",
        lawless: bool = False,
        messages: bool = True,
    ) -> None:
        """Open the mesh of process ``own`` with the certificate ``name``.

        ``scheme`` "tcp": without certificates. ``lawless``: without access control of its own, as an attacker would.
        """
        here = f"{scheme}/127.0.0.1:{{}}".format
        others = uav_access(SWARM, own, hears, heard_by)
        self.refusals = RefusalCounter(others, messages=messages)
        secured: dict[str, Any] = {}
        if scheme == "tls":
            secured = security(Credentials(Path(keys), name), others)
            if lawless:
                del secured["access_control"]
        self.mesh = Mesh(
            SWARM, own, hears, heard_by, here(listen) if listen else None, list(map(here, connect)), True,
            security=secured,
        )  # fmt: skip
        self.refusals.watch(self.mesh._session)

    def open_for(
        self, *, keys: str, name: str, listen: int, rights: dict[str, dict[str, list[str]]], hear: str
    ) -> None:
        """A peer with rights of the test's choice, which subscribes to ``hear``."""
        others = {other: Rights(**{what: tuple(keys) for what, keys in some.items()}) for other, some in rights.items()}
        self.refusals = RefusalCounter(others)
        secured = security(Credentials(Path(keys), name), others)
        self.mesh = Mesh(SWARM, 1, [], [], f"tls/127.0.0.1:{listen}", [], True, security=secured)
        self.refusals.watch(self.mesh._session)
        self.heard: list[str] = []
        self.subscriber = self.mesh._session.declare_subscriber(
            hear, lambda sample: self.heard.append(f"{sample.key_expr} {bytes(sample.payload).decode()}")
        )

    def open_plane(
        self,
        *,
        keys: str,
        name: str,
        nodes: list[str],
        listen: int = 0,
        connect: tuple[int, ...] = (),
        lawless: bool = False,
    ) -> None:
        """A session of a node or of the lead, which hears and answers what the others of the control plane say."""
        zenoh = import_zenoh()
        credentials = Credentials(Path(keys), name)
        swarm, lead = credentials.swarm, name == "lead"
        others = lead_access(swarm, nodes) if lead else node_access(swarm, name.removeprefix("node-"))
        self.refusals = RefusalCounter(others)
        here = "tls/127.0.0.1:{}".format
        secured = security(credentials, others)
        if lawless:
            del secured["access_control"]
        config = configuration(zenoh, here(listen) if listen else None, map(here, connect), 1.0, secured)
        self.session = zenoh.open(config)
        self.refusals.watch(self.session)
        self.heard = []

        def hear(sample: Any) -> None:
            self.heard.append(f"{sample.key_expr} {bytes(sample.payload).decode()}")

        asked = f"ftcc/{swarm}/node/**" if lead else f"ftcc/{swarm}/lead/{'**' if lawless else '*'}"
        own = f"ftcc/{swarm}/lead" if lead else f"ftcc/{swarm}/node/{name.removeprefix('node-')}"
        self.kept = [
            self.session.declare_subscriber(asked, hear),
            self.session.declare_subscriber(f"ftcc/{swarm}/lead/to/{name.removeprefix('node-')}/*", hear),
            self.session.liveliness().declare_subscriber(
                asked, lambda sample: self.heard.append(f"{sample.key_expr} {sample.kind}"), history=True
            ),
            self.session.liveliness().declare_token(f"{own}/alive"),
            self.session.declare_queryable(f"{own}/ask", lambda query: query.reply(query.key_expr, f"{name} answers")),
        ]

    def plane_put(self, key: str, text: str) -> None:
        self.session.put(key, text.encode())

    def plane_get(self, key: str) -> list[str]:
        return [bytes(reply.ok.payload).decode() for reply in self.session.get(key, timeout=1.0) if reply.ok]

    def door(self, port: int, addresses: list[str]) -> None:
        self.way_in = Door(port, addresses)

    def dropped(self) -> int:
        return self.way_in.dropped

    def all_heard(self) -> list[str]:
        return self.heard

    def wait_until_ready(self, seconds: float) -> bool:
        until = time.monotonic() + seconds
        while not self.mesh.ready and time.monotonic() < until:
            time.sleep(0.005)
        return self.mesh.ready

    def publish(self, text: str) -> None:
        self.mesh.publish(text.encode())

    def put(self, key: str, text: str) -> None:
        """Put something under a key that is another's."""
        self.mesh._session.put(key, text.encode())

    def receive(self, count: int, seconds: float) -> list[list[Any]]:
        """All that comes until ``count`` records are there: the process that they claim to be of, and the text."""
        arrived: list[list[Any]] = []
        until = time.monotonic() + seconds
        while len(arrived) < count and time.monotonic() < until:
            arrived += [[sender, payload.decode()] for sender, payload in self.mesh.receive()]
            time.sleep(0.002)
        return arrived

    def links(self) -> list[str]:
        return [link.auth_identifier for link in self.mesh._session.info.links()]

    def refused(self, seconds: float, reason: str = "") -> list[list[Any]]:
        """Refusals since the last call, by waiting until there is one with ``reason``, or none after ``seconds``."""
        found: dict[tuple[str, str], int] = {}
        until = time.monotonic() + seconds
        while True:
            for one in self.refusals.poll():
                found[one[:2]] = found.get(one[:2], 0) + one.times
            if time.monotonic() > until or (reason and any(reason in what for what, _ in found)):
                return [[*what, count] for what, count in found.items()]
            time.sleep(0.01)

    def refused_before_its_link(self, key: str, name: str) -> list[list[list[Any]]]:
        """What is told of a refusal before Zenoh tells of the link on which it was, and what after."""
        os.write(1, _DENIED.format(key=key).encode())
        before = self.refusals.poll()
        link = SimpleNamespace(zid="ab", auth_identifier=name, dst="tls/127.0.0.1:7")
        self.refusals._linked(SimpleNamespace(kind="SampleKind.PUT", link=link))
        return [[list(one) for one in some] for some in (before, self.refusals.poll())]

    def publish_many(self, count: int) -> None:
        for n in range(count):
            self.mesh.publish(f"{n}{' ' * 100}".encode())

    def flood(self, lines: int) -> list[int]:
        """Lines as Zenoh writes them, of keys that an attacker chooses: kinds of refusals, all of them, the limit."""
        kinds = total = 0
        for first in range(0, lines, 500):
            text = "".join(_DENIED.format(key=f"ftcc/run/{n}") for n in range(first, first + 500)).encode()
            while text:
                text = text[os.write(1, text) :]
                self.refusals.drain()
        for one in self.refusals.poll(last=True):
            kinds, total = kinds + 1, total + one.times
        return [kinds, total, _MOST]

    def say(self, text: str) -> None:
        """Print, which must not be lost among Zenoh's lines."""
        print(text, flush=True)

    def say_in_child(self, text: str, log: str) -> None:
        """Print in a forked child that has a log of its own, as the processes of a swarm do."""
        child = os.fork()
        if child == 0:
            with open(log, "w") as file:
                os.dup2(file.fileno(), 1)
            print(text, flush=True)
            os._exit(0)
        os.waitpid(child, 0)

    def close(self) -> list[list[Any]]:
        self.mesh.close()
        return [list(one) for one in self.refusals.close()]


if __name__ == "__main__":
    peer = Peer()
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # as in our processes: output and errors go to a log
    try:
        for line in sys.stdin:
            name, arguments = json.loads(line)
            answers.write(json.dumps(getattr(peer, name)(**arguments)) + "\n")
    except Exception:
        traceback.print_exc()
    # Threads of Zenoh would keep a process alive that ends in any other way.
    os._exit(1)
