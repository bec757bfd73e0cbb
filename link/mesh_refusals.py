"""Who was refused by an encrypted mesh, named and counted: read from Zenoh's log and from its links.

Zenoh tells of a failed handshake, and of a message that access control denies, in its log only, which it writes to
standard output. Here a pipe takes the place of that descriptor; what stands in it is counted and forgotten, so that a
flood of refusals needs neither memory nor room in the log. Python's own output still goes where it went.
"""

from __future__ import annotations

import collections
import contextlib
import fcntl
import io
import os
import re
import sys
import threading
import time
import weakref
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from ftcc.link.mesh import import_zenoh
from ftcc.link.mesh_door import Door

__all__ = ["Refusal", "RefusalCounter", "RefusalTexts"]

_PIPE = 1 << 20
"""Bytes that the pipe holds; what does not fit between two polls is lost, not waited for."""
_MOST = 256
"""Pairs of reason and name that are told apart between two polls; others are counted together."""
_OTHERS = ("further reasons", "others")
_UNKNOWN = "unknown caller"
_PASSED = 100
"""Lines of Zenoh about anything else that are passed on to the log."""
_LONGEST = 4096
"""Bytes of an unfinished line that are kept."""
_SHOWN = 100
"""Characters of a key, or of a reason that is not known here, that are told."""
_CACHED = 9
"""Decisions that Zenoh takes in advance, and logs like refusals, when it first meets a key."""

_NAMED_WITHIN = 2.0
"""How long a refusal waits for the name of its link, s of wall time: Zenoh tells of both in either order."""

_PERIOD, _LONGEST_PERIOD = 2.5, 320.0
"""Wall time between two reports, at first and in a flood, s."""

_LOG = "error,zenoh_link_tls=warn,zenoh::net::runtime::orchestrator=debug"
_ACCESS = "zenoh::net::routing::interceptor::access_control"

_LINE = re.compile(
    rb"\d{4}-\d\d-\d\dT[0-9:.]+Z +(?P<level>[A-Z]+) +(?P<thread>.*?ThreadId\(\d+\)) (?P<target>[\w:]+): (?P<text>.*)"
)
_UNABLE = re.compile(rb"Unable to connect to configured peer (?P<endpoint>\S+?)! (?P<why>.*)")
_DENIED = re.compile(
    rb"(?P<zid>[0-9a-f]+)(?: on (?P<subject>\S+))? is unauthorized to (?P<what>.*?) \(ingress\) on (?P<key>.*)"
)
_COMMON_NAME = re.compile(rb"CertCommonName\(([^)]*)\)")

_CALLERS = (
    (b"received corrupt message", "does not speak TLS"),
    (b"no certificate", "no certificate"),
    (b"certificate expired", "expired certificate"),
    (b"not valid yet", "certificate not valid yet"),
    (b"UnknownIssuer", "certificate of another authority"),
    (b"BadSignature", "certificate of another authority"),
    (b"invalid peer certificate", "invalid certificate"),
    (b"alert: UnknownCA", "does not accept our authority"),
    (b"alert: DecryptError", "does not accept our authority"),
    (b"alert: CertificateExpired", "says that our certificate is not valid now"),
    (b"received fatal alert", "broke off the handshake"),
    (b"cannot decrypt", "sent what its key does not fit, such as a recording"),
    (b"handshake eof", "left during the handshake"),
    (b"reset by peer", "left during the handshake"),
    (b"imeout", "said nothing"),
    (b"Too many open files", "too many connections at once"),
)
"""What stands in a line of Zenoh, and what it means, the first that fits."""
_DEEDS = {
    "Put": "put",
    "Delete": "delete",
    "Query": "query",
    "Reply": "reply to",
    "Declare Subscriber": "subscribe to",
    "Declare Queryable": "answer for",
    "Liveliness Token": "announce",
    "Declare Liveliness Subscriber": "watch",
    "Liveliness Query": "watch",
}
"""What access control denies, in plain words; its name in Zenoh's log."""
_SECURITY = (b"certificate", b"fatal alert", b"corrupt message", b"handshake eof", b"decrypt")
"""One of these stands in a line about a connection that failed for its certificates, not for the network."""


class Refusal(NamedTuple):
    """Some refusals of one kind."""

    reason: str
    who: str
    """The name in the certificate where there is one; the endpoint to which this process connects; or unknown."""
    times: int

    @property
    def text(self) -> str:
        """For people."""
        often = "" if self.times == 1 else f", {self.times} times"
        return f"mesh: {self.who} refused: {self.reason}{often}"


class RefusalCounter:
    """Counts refusals of this process; to be made after a fork, before the mesh is opened.

    Parameters
    ----------
    admitted : names of certificates that have rights here, see `access_control`; links of others are refusals.
    names : by endpoint to which this process connects, how to call who is there.
    messages : count also messages that access control denies; costs some microseconds per message of the mesh.
    """

    def __init__(
        self, admitted: Iterable[str], names: Mapping[str, str] = MappingProxyType({}), messages: bool = True
    ) -> None:
        self._admitted, self._names = frozenset(admitted), dict(names)
        self._fresh: collections.Counter[tuple[str, str]] = collections.Counter()
        self._lock = threading.Lock()
        self._of_zid: dict[str, str] = {}
        self._nameless: dict[tuple[str, str], tuple[int, float]] = {}
        """By reason and Zenoh's number of the process: how often, and since when."""
        self._ahead: dict[bytes, int] = {}
        self._rest = b""
        self._passed = 0
        self._listener: Any = None
        sys.stdout.flush()
        self._log = os.dup(1)
        self._pipe, end = os.pipe()
        for one in (self._pipe, end):
            os.set_blocking(one, False)  # Zenoh loses a line rather than wait for us
        with contextlib.suppress(OSError):  # an unprivileged user may have no more than the default
            fcntl.fcntl(end, fcntl.F_SETPIPE_SZ, _PIPE)
        os.dup2(end, 1)
        os.close(end)
        self._stdout = sys.stdout
        self._own: io.TextIOWrapper | None = None
        if _writes_to(sys.stdout, 1):
            self._own = io.TextIOWrapper(
                os.fdopen(os.dup(self._log), "wb", 0),
                encoding=sys.stdout.encoding,
                errors=sys.stdout.errors,
                line_buffering=True,
                write_through=True,
            )
            sys.stdout = self._own
        # A child has a log of its own at that descriptor, or gives itself one.
        forget = weakref.WeakMethod(self._give_back)
        os.register_at_fork(after_in_child=lambda: (back := forget()) and back())
        _start_log(f"{_LOG},{_ACCESS}=trace" if messages else _LOG)

    def watch(self, session: Any) -> None:
        """Notice links of ``session`` whose certificate is genuine but has no rights here."""
        self._listener = session.info.declare_link_events_listener(self._linked, history=True)

    def poll(self, last: bool = False) -> list[Refusal]:
        """What was refused since the last call, the most frequent first; does not wait.

        Of a process whose link is not known yet it is told at a later call. ``last``: there is none.
        """
        self.drain()
        now = time.monotonic()
        with self._lock:
            for (reason, zid), (times, since) in list(self._nameless.items()):
                if last or zid in self._of_zid or now - since > _NAMED_WITHIN:
                    del self._nameless[reason, zid]
                    self._count(reason, self._of_zid.get(zid, zid), times)
            fresh, self._fresh = self._fresh, collections.Counter()
        return [Refusal(*what, count) for what, count in fresh.most_common()]

    def drain(self) -> None:
        """Read and count what the pipe holds, and no more: a flood must not keep us here.

        To be called more often than `poll` where many messages are counted: the pipe holds about 4000 of them.
        """
        with contextlib.suppress(BlockingIOError):
            *lines, rest = (self._rest + os.read(self._pipe, _PIPE)).split(b"\n")
            self._rest = rest[-_LONGEST:]
            for line in lines:
                self._read(line)

    def close(self) -> list[Refusal]:
        """Put standard output back; what had not been polled."""
        if self._listener is not None:
            self._listener.undeclare()
        self._give_back()
        os.dup2(self._log, 1)
        left = self.poll(last=True)
        os.close(self._log)
        os.close(self._pipe)
        return left

    def _give_back(self) -> None:
        """Give Python its own standard output back."""
        if self._own is not None and sys.stdout is self._own:
            self._own.flush()
            sys.stdout = self._stdout

    def _linked(self, event: Any) -> None:
        """In Zenoh's thread: a link has come or gone."""
        link = event.link
        name = link.auth_identifier or ""
        if str(event.kind).endswith("DELETE"):
            return
        with self._lock:
            if len(self._of_zid) >= _MOST:
                self._of_zid.clear()
            self._of_zid[str(link.zid)] = name
            if name not in self._admitted:
                address = link.dst.rpartition(":")[0].partition("/")[2]
                self._count("has no rights here", f"{name or 'somebody'} at {address}")

    def _count(self, reason: str, who: str, times: int = 1) -> None:
        kind = (reason, who)
        # Reasons hold keys, which an attacker may choose.
        self._fresh[kind if kind in self._fresh or len(self._fresh) < _MOST else _OTHERS] += times

    def _count_nameless(self, reason: str, zid: str) -> None:
        times, since = self._nameless.get((reason, zid), (0, time.monotonic()))
        if times or len(self._nameless) < _MOST:
            self._nameless[reason, zid] = (times + 1, since)
        else:
            self._count(*_OTHERS)

    def _read(self, line: bytes) -> None:
        if b"is authorized to" in line and b"Using cached" in line:
            return  # nearly all lines
        found = _LINE.match(line)
        if found is None:
            os.write(self._log, line + b"\n")  # not Zenoh's
            return
        target, text = found["target"], found["text"]
        if target == _ACCESS.encode():
            self._access(found["thread"], text)
        elif target.startswith(b"zenoh_link_tls"):
            if found["level"] != b"WARN" or text.startswith(b"Skipping name verification"):
                return
            with self._lock:
                self._count(_meaning(text), _UNKNOWN)
        elif unable := _UNABLE.match(text):
            if any(word in unable["why"] for word in _SECURITY):
                endpoint = unable["endpoint"].decode(errors="replace")
                with self._lock:
                    self._count(_meaning(unable["why"]), self._names.get(endpoint, endpoint))
        elif found["level"] == b"ERROR" and self._passed < _PASSED:
            self._passed += 1
            os.write(self._log, line + b"\n")

    def _access(self, thread: bytes, text: bytes) -> None:
        if b"caching permissions" in text:
            self._ahead[thread] = _CACHED
            return
        cached = text.startswith(b"Using cached result: ")
        if not cached and self._ahead.get(thread, 0) > 0:
            self._ahead[thread] -= 1
            return
        denied = _DENIED.search(text)
        if denied is None:
            return
        subject = _COMMON_NAME.search(denied["subject"] or b"")
        zid = denied["zid"].decode()
        with self._lock:
            who = subject[1].decode(errors="replace") if subject else self._of_zid.get(zid)
            what, key = denied["what"].decode(errors="replace"), denied["key"].decode(errors="replace")
            reason = f"may not {_DEEDS.get(what, what.lower())} {key[:_SHOWN]}"
            if who is None:
                self._count_nameless(reason, zid)
            else:
                self._count(reason, who)


def _writes_to(stream: Any, descriptor: int) -> bool:
    """Whether a stream of Python writes to a descriptor; one of a notebook or a test does not."""
    try:
        return bool(stream.fileno() == descriptor)
    except (AttributeError, OSError, ValueError):
        return False


class RefusalTexts:
    """What there is to tell of refusals, less and less often in a flood: what comes in between is counted.

    Parameters
    ----------
    counter : whose refusals.
    """

    def __init__(self, counter: RefusalCounter) -> None:
        self._counter = counter
        self._period, self._due = _PERIOD, 0.0
        self._dropped = 0
        self.door: Door | None = None
        """Whose dropped packets are told, too."""

    def due(self, last: bool = False) -> list[str]:
        """What is to be told now, mostly nothing; to be called often. ``last``: tell all that is left."""
        self._counter.drain()
        now = time.monotonic()
        if now < self._due and not last:
            return []
        texts = [refusal.text for refusal in self._counter.poll(last)]
        if self.door is not None and self.door.dropped > self._dropped:
            texts.append(f"mesh: {self.door.dropped - self._dropped} packets from unknown addresses dropped")
            self._dropped = self.door.dropped
        if texts:
            self._period = min(2.0 * self._period, _LONGEST_PERIOD)
        self._due = now + self._period
        return texts

    def close(self) -> None:
        """Close the door and the counter."""
        if self.door is not None:
            self.door.close()
        self._counter.close()


def _meaning(text: bytes) -> str:
    for sign, reason in _CALLERS:
        if sign in text:
            return reason
    return text.partition(b" at /")[0].partition(b". Hint")[0][:_SHOWN].decode(errors="replace")


def _start_log(directives: str) -> None:
    """Start Zenoh's log, which a process can do once; what the user asks for by RUST_LOG is added, and passed on."""
    zenoh = import_zenoh()
    asked = os.environ.get("RUST_LOG")
    colour = os.environ.get("NO_COLOR")
    os.environ["RUST_LOG"] = f"{asked},{directives}" if asked else directives
    os.environ["NO_COLOR"] = "1"
    try:
        zenoh.try_init_log_from_env()
    finally:
        for name, before in (("RUST_LOG", asked), ("NO_COLOR", colour)):
            if before is None:
                del os.environ[name]
            else:
                os.environ[name] = before
