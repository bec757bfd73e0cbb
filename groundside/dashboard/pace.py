"""Show how fast the swarm flies on the wall clock: a line of text above the table, and a curve."""

from __future__ import annotations

import math

import rerun as rr
import rerun.blueprint as rrb

from ftcc.groundside.dashboard.plots import time_series
from ftcc.groundside.dashboard.snapshot import Pace, Snapshot
from ftcc.groundside.dashboard.viewer import Entry
from ftcc.groundside.palette import GRAY, Color

__all__ = ["PaceCurve", "describe_pace"]

_ENTITY = "/plots/pace"
_REACHED: Color = (72, 126, 216)
_AS_ASKED = 0.02
"""Relative difference up to which the requested pace counts as reached."""


def describe_pace(pace: Pace) -> str:
    """Describe the pace in one line: "5.2 x real time (asked: 10): both cores busy, try --pack auto"."""
    reached = "-" if math.isnan(pace.factor) else f"{pace.factor:.2g}" if pace.factor < 10.0 else f"{pace.factor:.0f}"
    if pace.asked is None:
        asked = " (as fast as possible)"
    elif math.isnan(pace.factor) or abs(pace.factor - pace.asked) > _AS_ASKED * pace.asked:
        asked = f" (asked: {pace.asked:g})"
    else:
        asked = ""
    reasons = ", ".join(part for part in (pace.limit, pace.advice) if part)
    return f"{reached} x real time{asked}" + (f": {reasons}" if reasons else "")


class PaceCurve:
    """Draws the pace, reached and requested, in times real time."""

    def view(self) -> rrb.View:
        """Return the plot."""
        return time_series(_ENTITY, "Times real time (gray: asked)")

    def static(self) -> list[Entry]:
        """Return names and colours of the curves."""
        lines = rr.SeriesLines(names=["times real time", "asked"], colors=[_REACHED, GRAY], widths=[1.5, 1.0])
        return [Entry(_ENTITY, None, lines)]

    def draw(self, snapshot: Snapshot) -> list[Entry]:
        """Return the pace of one snapshot."""
        if snapshot.pace is None:
            return []
        asked = math.nan if snapshot.pace.asked is None else snapshot.pace.asked
        return [Entry(_ENTITY, snapshot.t, rr.Scalars([snapshot.pace.factor, asked]))]
