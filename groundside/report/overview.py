"""The picture at the top of a report: what the flight is about, its faults and its verdict."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ftcc.groundside.canvas import Drawn, Look, plt
from ftcc.groundside.claims import Result
from ftcc.groundside.palette import CUT, HEALTH_COLORS, STALE, hexadecimal
from ftcc.groundside.report.curves import Flown
from ftcc.groundside.report.definitions import Sheet, main_panels
from ftcc.groundside.report.drawing import draw
from ftcc.groundside.report.plates import Plates
from ftcc.groundside.report.terminal import summary
from ftcc.groundside.text import ids
from ftcc.groundside.verdict import AS_IT_SHOULD, FAILED, REMARKS, fault_onsets

if TYPE_CHECKING:
    from ftcc.groundside.results import Run

__all__ = ["overview"]

_COLORS = {AS_IT_SHOULD: HEALTH_COLORS[0], REMARKS: STALE, FAILED: CUT}
_LINE = 0.16
"""Height of a line of the title, inches."""


def overview(run: Run, sheet: Sheet, flown: Flown, results: Sequence[Result], plates: Plates) -> Drawn | None:
    """Draw the main panels of a sheet with the faults of a run, below its verdict; None if it has no data for them."""
    word = run.verdict.word
    title = [f"verdict: {word}", *([summary(results)] if results else [])]
    whose: dict[float, list[int]] = {}
    for t, uav, _ in fault_onsets(run.mission, run.events):
        if t <= run.end:
            whose.setdefault(t, []).append(uav)
    faults = [(t, f"UAV {ids(sorted(set(uavs)))}") for t, uavs in whose.items()]

    def made(look: Look) -> Any | None:
        figure = draw(main_panels(sheet), [flown], 2, look, faults)
        if figure is not None:
            text = ("\n" if look.is_narrow else "; ").join(title)
            with plt.rc_context(look.style):
                color = hexadecimal(_COLORS[word])
                if look.is_narrow:
                    width, height = figure.get_size_inches()
                    figure.set_size_inches(width, height + _LINE * len(title))
                figure.axes[0].set_title(text, loc="left", color=color)
        return figure

    return plates.add("summary", "The flight at a glance", "", made)
