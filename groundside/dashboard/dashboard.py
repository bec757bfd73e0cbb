"""The live dashboard: what a swarm does, in Rerun, while it flies, and in its recording.

Everything is drawn at the simulated time of its snapshot (timeline ``t``). A blueprint goes with it, into the viewer
and into the recording, so that there is nothing to set up.
"""

from __future__ import annotations

import os
import uuid
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ftcc.airside.scheme import Quantity
from ftcc.groundside.dashboard.viewer import BLUEPRINT, Entry, Kind, Viewer, write
from ftcc.groundside.snapshot import Event, Snapshot
from ftcc.link.graph import Graph

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

    from ftcc.groundside.dashboard.plots import Plots
    from ftcc.groundside.dashboard.scene import Scene

__all__ = ["Dashboard"]

_APPLICATION = "ftcc"
_TO_VIEWER = 1.0
"""Longest wait of logged data in the process on their way to a viewer that lags, s; else they go frame by frame."""
_TO_FILE = 2.0
"""Longest wait of logged data on their way to the recording, s: what a killed run loses.

Few large pieces make a small file and a small index of it, which stays in memory until the file is closed.
"""


class Dashboard:
    """Draws snapshots in a viewer, in a recording, in both or nowhere.

    Neither a viewer that is slow, dies or never starts nor its absence costs the caller more than the drawing itself.
    Loads rerun, which starts threads: create it after the last fork, in a thread that lives as long as the process.

    Parameters
    ----------
    title : str
        Name of the recording.
    graph : Graph
        Who hears whom.
    signals : sequence of Quantity
        The scheme's ``SIGNALS``; tracking errors among them are plotted, with their bounds.
    limits : mapping of str to (float, float)
        Actuator limits by the names of ``ACTUATORS``, rad and N; an actuator without travel is not plotted.
    leaders, followers : sequence of int
    recording : Path, optional
        Where the recording (.rrd) goes.
    viewer : "web", "native" or "none"
    ports : (int, int), optional
        Of the viewer's data and of its page; free ones if None.
    open_browser : bool
        Whether ``web`` opens the user's browser, where there is a screen.
    stale_after : float
        Age from which what was heard last counts as stale, s.
    """

    address: str | None
    """Of the page to open, None without one."""

    def __init__(
        self,
        *,
        title: str,
        graph: Graph,
        signals: Sequence[Quantity],
        limits: Mapping[str, tuple[float, float]],
        leaders: Sequence[int],
        followers: Sequence[int],
        recording: Path | None,
        viewer: Kind,
        ports: tuple[int, int] | None = None,
        open_browser: bool = False,
        stale_after: float = 0.5,
    ) -> None:
        self.address = None
        self._title = title
        self._graph = graph
        self._signals = signals
        self._limits = limits
        self._leaders = leaders
        self._followers = followers
        self._stale_after = stale_after
        self._id = uuid.uuid4()
        self._scene: Scene | None = None
        self._plots: Plots | None = None
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

    def log(self, snapshot: Snapshot) -> None:
        """Draw ``snapshot``."""
        if self._recording is None and self._viewer is None:
            return
        self._t = snapshot.t
        entries: list[Entry] = []
        if self._scene is None or self._plots is None:
            entries += self._begin(snapshot)
        assert self._scene is not None
        assert self._plots is not None
        entries += self._scene.draw(snapshot)
        entries += self._plots.draw(snapshot)
        entries += self._own_events()
        if self._viewer is not None:
            self._viewer.show(entries)
        if self._recording is not None:
            write(self._recording, entries)

    def take_problems(self) -> tuple[Event, ...]:
        """What went wrong with the dashboard itself since the last call, each once; it is in the event log, too."""
        problems, self._problems = self._problems, []
        return tuple(Event(self._t, "warning", problem) for problem in problems)

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

    def _begin(self, snapshot: Snapshot) -> list[Entry]:
        """What is logged once; the first snapshot tells how large the swarm is."""
        from ftcc.groundside.dashboard.plots import Plots
        from ftcc.groundside.dashboard.scene import Scene

        self._scene = Scene(self._graph, self._leaders, self._stale_after, snapshot)
        self._plots = Plots(self._signals, self._limits, self._leaders, self._followers)
        blueprint = Entry(BLUEPRINT, None, _blueprint(self._scene, self._plots))
        return [blueprint, *self._scene.static(), *self._plots.static()]

    def _own_events(self) -> list[Entry]:
        """The dashboard's own trouble, for its event log."""
        from ftcc.groundside.dashboard.plots import events

        problem = self._viewer.take_problem() if self._viewer is not None else None
        if problem is None:
            return []
        self._problems.append(problem)
        return events([Event(self._t, "warning", problem)])

    def _stream(self, hold: float) -> rr.RecordingStream:
        """A stream of this flight; all of them are one recording to Rerun."""
        import rerun as rr

        batches = rr.ChunkBatcherConfig(flush_tick=hold)
        return rr.RecordingStream(_APPLICATION, recording_id=self._id, batcher_config=batches)

    def _to_viewer(self, address: str) -> rr.RecordingStream:
        import rerun as rr

        stream = self._stream(_TO_VIEWER)
        stream.set_sinks(rr.GrpcSink(address))
        stream.send_recording_name(self._title)
        return stream

    def _to_file(self, path: Path) -> rr.RecordingStream:
        import rerun as rr

        stream = self._stream(_TO_FILE)
        stream.set_sinks(rr.FileSink(path))
        stream.send_recording_name(self._title)
        return stream


def _blueprint(scene: Scene, plots: Plots) -> rrb.Blueprint:
    """Left the swarm, below it the graph, the table and the events; right the plots."""
    import rerun.blueprint as rrb

    curves = plots.views()
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                scene.view(),
                rrb.Horizontal(
                    scene.plan_view(),
                    rrb.Vertical(plots.table_view(), plots.log_view(), row_shares=[2, 1]),
                    column_shares=[2, 3],
                ),
                row_shares=[6, 5],
            ),
            rrb.Vertical(*curves, row_shares=[2] + [1] * (len(curves) - 1)),
            column_shares=[3, 2],
        ),
        rrb.TopPanel(state=rrb.PanelState.Collapsed),
        rrb.BlueprintPanel(state=rrb.PanelState.Hidden),
        rrb.SelectionPanel(state=rrb.PanelState.Hidden),
        rrb.TimePanel(state=rrb.PanelState.Collapsed, timeline="t", play_state="following"),
        auto_layout=False,
        auto_views=False,
    )


def _load_rerun() -> None:
    """Import rerun; its messages about viewers are ours to give, and would disturb the terminal."""
    wanted = os.environ.get("RUST_LOG")
    os.environ.setdefault("RUST_LOG", "error,re_grpc_client=off,re_sdk=off,re_quota_channel=off")
    import rerun  # noqa: F401

    if wanted is None:
        del os.environ["RUST_LOG"]
