"""Show a swarm in Rerun while it flies, and record what is shown.

Everything is drawn at the simulated time of its snapshot (timeline ``t``). The viewer and the recording include a
blueprint, so that users have nothing to set up.
"""

from __future__ import annotations

import os
import uuid
from pathlib import Path
from typing import TYPE_CHECKING

from ftcc.groundside.dashboard.snapshot import Event, Snapshot
from ftcc.groundside.dashboard.subject import Subject
from ftcc.groundside.dashboard.viewer import Entry, Kind, Viewer, write

if TYPE_CHECKING:
    import rerun as rr

    from ftcc.groundside.dashboard.artists import Artists

__all__ = ["Dashboard"]

_APPLICATION = "ftcc"
_TO_VIEWER = 1.0
"""Longest time that data for a slow viewer are buffered, s; to a fast one they go frame by frame."""
_TO_FILE = 2.0
"""Longest time that data for the recording are buffered, s; a killed run loses them.

Few large chunks make a small file and a small index, which stays in memory until the file is closed.
"""


class Dashboard:
    """Draws snapshots in a viewer, in a recording, in both or in neither.

    A viewer that is slow, dies or never starts does not delay the caller. Loads rerun, which starts threads: create a
    dashboard after the last fork, in a thread that lives as long as the process.

    Parameters
    ----------
    subject : Subject
        The swarm to show.
    recording : Path, optional
        File of the recording (.rrd).
    viewer : "web", "native" or "none"
    ports : (int, int), optional
        Ports of the viewer's data and of its page; free ports if None.
    open_browser : bool
        Whether ``web`` opens the user's browser, if there is a screen.
    """

    address: str | None
    """Address of the page to open; None if there is no page."""

    def __init__(
        self,
        subject: Subject,
        *,
        recording: Path | None,
        viewer: Kind,
        ports: tuple[int, int] | None = None,
        open_browser: bool = False,
    ) -> None:
        self.address = None
        self._subject = subject
        self._id = uuid.uuid4()
        self._artists: Artists | None = None
        self._recording: rr.RecordingStream | None = None
        self._viewer: Viewer | None = None
        self._problems: list[str] = []
        self._t = 0.0
        if recording is None and viewer == "none":
            return
        _load_rerun()
        if recording is not None:
            self._recording = self._to_file(recording)
        if viewer != "none":
            self._viewer = Viewer(viewer, ports, open_browser, self._to_viewer)
            self.address = self._viewer.address

    def log(self, snapshot: Snapshot, timeout: float = 0.0) -> None:
        """Draw ``snapshot``; wait at most ``timeout`` (wall s) for a viewer that is behind."""
        if self._recording is None and self._viewer is None:
            return
        self._t = snapshot.t
        from ftcc.groundside.dashboard.artists import Artists

        entries: list[Entry] = []
        if self._artists is None:
            self._artists = Artists(self._subject, snapshot)
            entries += self._artists.static()
        entries += self._artists.draw(snapshot)
        entries += self._own_events()
        if self._viewer is not None:
            self._viewer.show(entries, timeout)
        if self._recording is not None:
            write(self._recording, entries)

    def take_problems(self) -> tuple[Event, ...]:
        """Return the dashboard's own problems since the last call, each once; they are also in the event log."""
        problems, self._problems = self._problems, []
        return tuple(Event(self._t, "warning", problem) for problem in problems)

    @property
    def pids(self) -> list[int]:
        """Return the process ids of the viewer, if this process started one."""
        return [] if self._viewer is None else self._viewer.pids

    def wait(self) -> None:
        """Wait until the viewer ends; return at once if there is none."""
        if self._viewer is not None:
            self._viewer.wait()

    def close(self) -> None:
        """Finish the recording and end the viewer."""
        if self._recording is not None:
            write(self._recording, self._own_events())
            try:
                self._recording.flush(timeout_sec=10.0)
            except RuntimeError as error:
                self._problems.append(f"the dashboard's recording is not complete: {error}")
            self._recording.disconnect()
            self._recording = None
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None

    def _own_events(self) -> list[Entry]:
        """Return the dashboard's new problems as entries of the event log."""
        from ftcc.groundside.dashboard.table import event_entries

        problem = self._viewer.take_problem() if self._viewer is not None else None
        if problem is None:
            return []
        self._problems.append(problem)
        return event_entries([Event(self._t, "warning", problem)])

    def _stream(self, hold: float) -> rr.RecordingStream:
        """Return a new stream; Rerun treats all streams of this dashboard as one recording."""
        import rerun as rr

        batches = rr.ChunkBatcherConfig(flush_tick=hold)
        return rr.RecordingStream(_APPLICATION, recording_id=self._id, batcher_config=batches)

    def _to_viewer(self, address: str) -> rr.RecordingStream:
        import rerun as rr

        stream = self._stream(_TO_VIEWER)
        stream.set_sinks(rr.GrpcSink(address))
        stream.send_recording_name(self._subject.title)
        return stream

    def _to_file(self, path: Path) -> rr.RecordingStream:
        import rerun as rr

        stream = self._stream(_TO_FILE)
        stream.set_sinks(rr.FileSink(path))
        stream.send_recording_name(self._subject.title)
        return stream


def _load_rerun() -> None:
    """Import rerun without its messages about viewers, which the dashboard reports itself."""
    wanted = os.environ.get("RUST_LOG")
    os.environ.setdefault("RUST_LOG", "error,re_grpc_client=off,re_sdk=off,re_quota_channel=off")
    import rerun  # noqa: F401

    if wanted is None:
        del os.environ["RUST_LOG"]
