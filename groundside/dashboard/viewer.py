"""Run the Rerun viewer as a separate process, fed by a thread so that the swarm never waits for it.

Rerun's client blocks its caller, and every other sink of the same stream, while a viewer does not read. So the viewer
has its own stream, written by a thread from a bounded queue; entries that do not fit are not shown. A blocked client
returns when the viewer's process ends.
"""

from __future__ import annotations

import importlib.util
import os
import queue
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.parse
import webbrowser
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from ftcc.groundside.dashboard.viewer_page import PageServer

if TYPE_CHECKING:
    import rerun as rr

__all__ = ["BLUEPRINT", "Entry", "Kind", "Viewer", "viewer_program", "write"]

Kind = Literal["web", "native", "none"]

_LOOPBACK = "127.0.0.1"
_START_TIMEOUT = 20.0
"""Longest wait until the viewer listens, s."""
_QUEUE_SIZE = 64
"""Capacity of the queue in frames; at 10 Hz six seconds, the time of a slow start."""

_BETWEEN_FLUSHES = 0.15
"""Shortest time between two flushes, s; a page that is opened late reads them one by one."""
_UNREAD = 50
"""Number of frames sent before waiting until the viewer has read them."""
_BEHIND = "the viewer does not keep up: not everything is shown"

_DIE_WITH_PARENT = """
import ctypes, os, signal, sys
PR_SET_PDEATHSIG = 1
ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
if os.getppid() != int(sys.argv[1]):
    sys.exit("the station ended before its viewer started")
os.execv(sys.argv[2], sys.argv[2:])
"""
"""Program that runs another one, which is killed when its parent process ends (Linux).

A short-lived interpreter sets this for itself and then becomes the program. A function between fork and exec could
deadlock, because the station has threads.
"""


BLUEPRINT = ""
"""Path of an entry that is a blueprint, not an entity."""


class Entry(NamedTuple):
    """One item to log."""

    path: str
    """Entity path."""
    t: float | None
    """Simulated time, s; None: valid at all times."""
    what: Any
    """Archetype."""


def write(stream: rr.RecordingStream, entries: Iterable[Entry]) -> None:
    """Log ``entries`` to a stream."""
    now = None
    for path, t, what in entries:
        if path == BLUEPRINT:
            stream.send_blueprint(what)
            continue
        if t is None:
            stream.log(path, what, static=True)
            continue
        if t != now:
            stream.set_time("t", duration=t)
            now = t
        stream.log(path, what)


class Viewer:
    """A viewer process, ended by `close`.

    The thread that creates it must live as long as the process, because Linux ends the viewer with that thread.

    Parameters
    ----------
    kind : "web" or "native"
        "web": a server on loopback with a page for a browser; "native": a window.
    ports : (int, int), optional
        Ports of the data and of the page; free ports if None.
    open_browser : bool
        Whether to open the page in the user's browser, if there is a screen.
    connect : callable, optional
        Returns a stream to the viewer at an address; may block.
    recording : Path, optional
        A recording (.rrd) to show instead of logged entries.
    """

    address: str | None
    """Address of the page; None if there is no page."""

    def __init__(
        self,
        kind: Literal["web", "native"],
        ports: tuple[int, int] | None,
        open_browser: bool,
        connect: Callable[[str], rr.RecordingStream] | None,
        recording: Path | None = None,
    ) -> None:
        data_port, page_port = ports or (_free_port(), _free_port())
        self._data_port = data_port
        self._url = f"rerun+http://{_LOOPBACK}:{data_port}/proxy"
        self.address = None
        options = ["--bind", _LOOPBACK, "--port", str(data_port)]
        inner_port = _free_port()
        if kind == "web":
            query = f"url={urllib.parse.quote(self._url, safe='')}&hide_welcome_screen"
            self.address = f"http://{_LOOPBACK}:{page_port}/?{query}"
            options += ["--serve-web", "--web-viewer-port", str(inner_port), "--server-memory-limit", "256MB"]
        else:
            options += ["--memory-limit", "1GB", "--server-memory-limit", "64MB", "--hide-welcome-screen"]
            options += ["--expect-data-soon"] if recording is None else []
        options += [str(recording)] if recording is not None else []
        self._open_browser = open_browser
        self._connect = connect
        self._problem: str | None = None
        self._reported: set[str] = set()
        self._ended = threading.Event()
        self._frames: queue.Queue[list[Entry] | None] = queue.Queue(_QUEUE_SIZE)
        self._output = tempfile.TemporaryFile()  # noqa: SIM115 - the viewer writes to it as long as it runs
        self._page: PageServer | None = None
        self._process = self._start(options)
        if kind == "web" and self._process is not None:
            try:
                self._page = PageServer(page_port, inner_port, data_port)
            except OSError as error:
                self._report(f"no page of the viewer: port {page_port}: {error.strerror}")
        if self._page is None:
            self.address = None
        self._thread = threading.Thread(target=self._run, name="viewer", daemon=True)
        self._thread.start()

    def show(self, entries: list[Entry], timeout: float = 0.0) -> None:
        """Queue ``entries``; drop them if the queue stays full for ``timeout`` (wall s)."""
        if self._ended.is_set():
            return
        try:
            self._frames.put(entries, timeout > 0.0, timeout)
        except queue.Full:
            self._report(_BEHIND)

    def wait(self) -> None:
        """Wait until the viewer ends."""
        if self._process is not None:
            self._process.wait()

    @property
    def pids(self) -> list[int]:
        """Return the process ids of the viewer, if this process started one."""
        return [] if self._process is None else [self._process.pid]

    def take_problem(self) -> str | None:
        """Return a problem since the last call; each kind of problem is returned once."""
        problem, self._problem = self._problem, None
        return problem

    def close(self) -> None:
        """Give the viewer up to a second to read what was sent, and end it."""
        self._ended.set()
        try:
            self._frames.put_nowait(None)
        except queue.Full:
            pass  # The viewer has stopped reading: it cannot be given anything more.
        else:
            self._thread.join(1.0)
        if self._page is not None:
            self._page.close()
        if self._process is not None:
            self._process.terminate()
            try:
                self._process.wait(0.3)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        # A blocked thread continues now that the process has ended, and ends too.
        self._thread.join(0.5)
        self._output.close()

    def _start(self, options: list[str]) -> subprocess.Popen[bytes] | None:
        if _listening(self._data_port):
            # Rerun would connect to the other program as if it were the viewer.
            self._report(f"no viewer: port {self._data_port} is in use")
            return None
        program = [str(viewer_program()), *options]
        if sys.platform == "linux":
            program = [sys.executable, "-I", "-S", "-c", _DIE_WITH_PARENT, str(os.getpid()), *program]
        # With CI set, Rerun neither sends usage statistics nor leaves their files in the user's home.
        environment = {"RUST_LOG": "warn"} | os.environ | {"CI": "true"}
        # In a new session, Ctrl-C reaches only the station, which ends the viewer when everything is written.
        return subprocess.Popen(
            program,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=self._output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )

    def _run(self) -> None:
        try:
            self._send_frames()
        except Exception as error:  # An error of the viewer must not end the flight.
            self._report(f"the viewer has failed: {error}")
        self._ended.set()

    def _send_frames(self) -> None:
        if self._process is None or not self._listens():
            return
        if self.address and self._open_browser and _has_screen():
            webbrowser.open(self.address)
        if self._connect is None:
            return
        stream = self._connect(self._url)
        sent = 0
        flushed = 0.0
        while (entries := self._frames.get()) is not None:
            write(stream, entries)
            if self._frames.empty() and time.monotonic() - flushed >= _BETWEEN_FLUSHES:
                # Only whole frames, so that all aircraft are drawn at the same time.
                stream.flush(timeout_sec=0.0)
                flushed = time.monotonic()
            sent += 1
            if sent % _UNREAD == 0:
                self._wait_for_reader(stream)
            if self._process.poll() is not None:
                self._report(f"the viewer ended{self._exit_message()}; the flight and its recording go on")
                break
        # Blocks until the viewer has read everything, or has ended.
        stream.disconnect()

    def _wait_for_reader(self, stream: rr.RecordingStream) -> None:
        """Wait until the viewer has read everything; the client would buffer hundreds of MB before it blocks."""
        assert self._process is not None
        while self._process.poll() is None and not self._ended.is_set():
            try:
                stream.flush(timeout_sec=1.0)
                return
            except RuntimeError:
                self._report(_BEHIND)
                time.sleep(0.1)

    def _listens(self) -> bool:
        """Wait until the viewer listens; return False if it does not."""
        assert self._process is not None
        deadline = time.monotonic() + _START_TIMEOUT
        while time.monotonic() < deadline and not self._ended.is_set():
            if self._process.poll() is not None:
                self._report(f"no viewer: it ended at once{self._exit_message()}")
                return False
            if _listening(self._data_port):
                return True
            time.sleep(0.05)
        if not self._ended.is_set():
            self._report("no viewer: it does not answer")
        return False

    def _exit_message(self) -> str:
        assert self._process is not None
        self._output.seek(0)
        lines = self._output.read().decode(errors="replace").strip().splitlines()
        return f" (exit code {self._process.returncode})" + (f", saying: {lines[-1]}" if lines else "")

    def _report(self, problem: str) -> None:
        if problem not in self._reported:
            self._reported.add(problem)
            self._problem = problem


def viewer_program() -> Path:
    """Return the viewer that the package rerun-sdk includes."""
    found = importlib.util.find_spec("rerun_cli")
    assert found is not None
    assert found.origin is not None
    folder = Path(found.origin).parent
    bundled = folder / "Rerun.app" / "Contents" / "MacOS" / "Rerun"
    return bundled if bundled.exists() else folder / "rerun"


def _listening(port: int) -> bool:
    with socket.socket() as probe:
        probe.settimeout(0.5)
        return probe.connect_ex((_LOOPBACK, port)) == 0


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((_LOOPBACK, 0))
        port: int = probe.getsockname()[1]
        return port


def _has_screen() -> bool:
    return sys.platform == "darwin" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
