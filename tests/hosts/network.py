"""Computers that are not there: Linux namespaces as hosts, on a switch of their own.

Each host has its own network, its own processes and its own ``/proc``. All of it hangs on one process per host, the
first of its namespace, which reads a pipe from the test: when the test ends, however it ends, the pipe closes, that
process exits, and the kernel ends everything in the namespace and removes its interfaces. Nothing is named on the
machine, and nothing in its own network is touched; so any number of tests run beside each other.

    with Network(3) as hosts:
        hosts[0].run(["ping", "-c", "1", hosts[1].address]).wait()
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from .wire import Weather, to_json

__all__ = ["Host", "Network", "why_not"]

_FIRST = """
import signal, sys
signal.signal(signal.SIGCHLD, signal.SIG_IGN)
print("ready", flush=True)
sys.stdin.read()
"""
"""The first process of a namespace waits for the end of its input. It ignores its children, so that the kernel buries
the processes that others leave behind."""
_NEW = ["unshare", "--net", "--pid", "--fork", "--kill-child", "--mount", "--mount-proc"]
_AS_ROOT = ["--user", "--map-root-user"]
"""A user's namespace, in which somebody who is not root may lay wires."""
_WIRE = Path(__file__).with_name("wire.py")
_NETWORK = "10.77.0"


class _Space:
    """Namespaces of network, processes and mounts, which live as long as their first process."""

    def __init__(self, inside: Sequence[str] = (), user: bool = False) -> None:
        command = [*inside, *_NEW, *(_AS_ROOT if user else []), sys.executable, "-S", "-c", _FIRST]
        self._holder = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert self._holder.stdout is not None
        if self._holder.stdout.readline() != "ready\n":
            self._holder.kill()
            _, error = self._holder.communicate()
            raise OSError(error.strip() or "the namespace did not start")
        # Of the chain of processes that only wait for the next one, the last is the first of the namespace.
        self.first = self._holder.pid
        while below := _children(self.first):
            self.first = below[0]
        self.network = ["nsenter", f"--target={self.first}", "--net"]
        if user or "--user" in inside:
            self.network += ["--user", "--preserve-credentials"]
        self.enter = [*self.network, "--pid", "--mount"]

    def call(self, command: str) -> str:
        """Run a command in this network to its end; returns what it prints."""
        done = subprocess.run([*self.network, *command.split()], capture_output=True, text=True, check=False)
        if done.returncode:
            raise OSError(f"{command}: {done.stderr.strip()}")
        return done.stdout

    def close(self) -> None:
        """End all processes in the namespace, and it."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.first, signal.SIGKILL)
        self._holder.communicate()


class Host:
    """A computer of a `Network`.

    Attributes
    ----------
    name : "a", "b", ...
    address : its IPv4 address; the others reach it there.
    """

    def __init__(self, name: str, address: str, switch: _Space, space: _Space) -> None:
        self.name, self.address = name, address
        self._switch, self._space = switch, space
        self._port = f"to-{name}"
        self._wire: subprocess.Popen[str] | None = None
        space.call("ip link set lo up")
        switch.call(f"ip link add {self._port} type veth peer name eth0 netns {space.first}")
        switch.call(f"ip link set {self._port} master switch up")
        space.call(f"ip address add {address}/24 dev eth0")
        space.call("ip link set eth0 up")

    def run(
        self, command: Sequence[str], environment: Mapping[str, str] | None = None, **others: Any
    ) -> subprocess.Popen[str]:
        """Start a command on this host; ``others`` go to Popen. Its end is that of the command.

        Signals for the command go through `send_signal` here: the process that Popen knows only waits for it.
        """
        here = ["sh", "-c", 'cd "$0" && exec "$@"', str(others.pop("cwd", Path.cwd()))]  # nsenter goes to the root
        variables = None if environment is None else dict(environment)
        return subprocess.Popen([*self._space.enter, *here, *command], env=variables, text=True, **others)

    def send_signal(self, process: subprocess.Popen[str], number: int) -> None:
        """Send a signal to a command that `run` started, for instance SIGINT for Ctrl-C."""
        for child in _children(process.pid):
            os.kill(child, number)

    def processes(self) -> list[int]:
        """All processes of this host but its first, as the machine numbers them."""
        space = os.stat(f"/proc/{self._space.first}/ns/pid").st_ino
        found = []
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit() and int(entry.name) != self._space.first:
                with contextlib.suppress(OSError):  # it has just ended
                    if os.stat(entry / "ns/pid").st_ino == space:
                        found.append(int(entry.name))
        return found

    def kill_all(self) -> None:
        """SIGKILL to every process of this host; its network stays, so that the kernel still closes sockets."""
        while everyone := self.processes():
            for process in everyone:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(process, signal.SIGKILL)
            time.sleep(0.001)

    def lose_power(self) -> None:
        """Cut the link, then end every process: nobody hears a last word."""
        self.link_down()
        self.kill_all()

    def link_down(self) -> None:
        """Pull the cable at the switch: the host itself sees a cable that is in, so no program is told."""
        self.weather(Weather(loss=1.0))

    def link_up(self) -> None:
        """Put the cable back in."""
        self.weather(Weather())

    def weather(self, weather: Weather) -> None:
        """From now on, frames from and to this host travel as ``weather`` says."""
        self.lay_wire()
        assert self._wire is not None
        assert self._wire.stdin is not None
        self._wire.stdin.write(to_json(weather))
        self._await_wire()

    def lay_wire(self) -> None:
        """Put a process between this host and the switch. While a busy flight goes on this takes seconds, so before."""
        if self._wire is not None:
            return
        inner, outer = f"in-{self.name}", f"out-{self.name}"
        self._switch.call(f"ip link set {self._port} nomaster")
        self._switch.call(f"ip link add {inner} type veth peer name {outer}")
        self._switch.call(f"ip link set {inner} master switch up")
        self._switch.call(f"ip link set {outer} up")
        command = [*self._switch.network, sys.executable, str(_WIRE), self._port, outer]
        self._wire = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1)
        self._await_wire()

    def _await_wire(self) -> None:
        assert self._wire is not None
        assert self._wire.stdout is not None
        assert self._wire.stdout.readline() == "ready\n", f"the wire of host {self.name} has ended"

    def _close(self) -> None:
        self._space.close()
        if self._wire is not None:
            self._wire.kill()
            self._wire.communicate()


class Network:
    """``count`` hosts on a switch; a context manager."""

    def __init__(self, count: int) -> None:
        user = os.geteuid() != 0
        self._switch = _Space(user=user)
        enter = ["nsenter", f"--target={self._switch.first}", "--user", "--preserve-credentials"] if user else []
        self.hosts: list[Host] = []
        try:
            self._switch.call("ip link add switch type bridge")
            self._switch.call("ip link set switch up")
            for index in range(count):
                space = _Space(inside=enter)
                self.hosts.append(Host("abcdefgh"[index], f"{_NETWORK}.{index + 1}", self._switch, space))
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> list[Host]:
        return self.hosts

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End every process of every host; the kernel removes the rest."""
        for host in self.hosts:
            host._close()
        self._switch.close()


def why_not() -> str:
    """Why there can be no hosts on this machine, for ``pytest.mark.skipif``; empty if there can."""
    missing = [tool for tool in ("ip", "unshare", "nsenter") if shutil.which(tool) is None]
    if missing:
        return f"no {', '.join(missing)} (Debian: iproute2, util-linux)"
    try:
        Network(1).close()
    except OSError as error:
        return f"no namespaces for hosts here: {error}"
    return ""


def _children(process: int) -> list[int]:
    with contextlib.suppress(OSError):
        return [int(child) for child in Path(f"/proc/{process}/task/{process}/children").read_text().split()]
    return []
