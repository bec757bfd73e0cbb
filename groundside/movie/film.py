"""The picture of a film: title, scene, tracking errors, caption; drawn once, then updated frame by frame."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.canvas import Line2D, plt
from ftcc.groundside.movie.attitudes import AttitudeScene
from ftcc.groundside.movie.plan import PlanScene
from ftcc.groundside.movie.sampling import Sampled
from ftcc.groundside.movie.screen import COMMAND, FAULT, LINK, Screen
from ftcc.groundside.movie.tracking import TrackingPanel, errors_of
from ftcc.groundside.movie.vertical import VerticalScene
from ftcc.groundside.palette import Color, colors, hexadecimal
from ftcc.groundside.report import Flown

if TYPE_CHECKING:
    from ftcc.groundside.results import Run

__all__ = ["Film"]

Array = NDArray[np.float64]
Box = tuple[float, float, float, float]

_SCENES: dict[str, Any] = {"longitudinal": VerticalScene, "attitude": AttitudeScene, "position": PlanScene}
"""By the plant of the scheme."""

_TRAIL = 3.0
"""Length of trails, seconds of the film."""
_TOLD = 3
"""Number of events in the caption."""
_TOLD_SIZE = 11.5
"""Size of their letters, points."""
_LETTER_WIDTH = 0.6
"""Usual width of a bold letter, in sizes."""
_LEFT = 0.025
"""Margin, as a share of the width."""
_FRESH = 2.0
"""An event is new for so long, seconds of the film."""
_ABOUT_LINKS = re.compile(r"(link|links|all links|radio|own radio)\b")
"""Texts of link events begin like this."""
_MOST_UAVS = 12
"""Largest swarm whose UAVs are in the legend."""
_MOST_LINES = 60
"""Largest number of events that are lines; beyond, only faults and links are."""


class Film:
    """A film of a recorded flight.

    Parameters
    ----------
    run : Run
    times : (n,) array
        Simulated times of the frames, s.
    fps : float
        Frames per second of the film.
    screen : Screen
    """

    def __init__(self, run: Run, times: Array, fps: float, screen: Screen) -> None:
        self._screen = screen
        self._times = times
        mission = run.mission
        first, last = float(times[0]), float(times[-1])
        self._fresh = _FRESH * fps * (last - first) / max(len(times) - 1, 1)
        self._events = [event for event in run.events if float(event["t"]) <= last + 1e-6]
        inside = [event for event in self._events if float(event["t"]) >= first]
        if len(inside) > _MOST_LINES:
            inside = [event for event in inside if _color(event) != COMMAND]
        lines = sorted({(round(float(event["t"]), 2), _color(event)) for event in inside})
        sampled = Sampled(run, mission.uavs, times)
        flown = Flown(mission.case, run, mission)
        tints = colors(mission.uavs)
        with plt.rc_context(screen.style):
            # A hundredth of a pixel more: the canvas rounds down.
            size = ((screen.width + 0.01) / screen.dpi, (screen.height + 0.01) / screen.dpi)
            self.figure: Any = plt.figure(figsize=size, dpi=screen.dpi)
            errors = errors_of(flown)
            place, places = _layout(screen, len(errors))
            axes = self.figure.add_axes(place)
            self._scene = _SCENES[mission.scheme.plant](axes, sampled, mission, screen, max(1, round(_TRAIL * fps)))
            axes.set_title(self._scene.title)
            self._panels = []
            for n, ((error, curves), box) in enumerate(zip(errors, places)):
                below = self.figure.add_axes(box)
                self._panels.append(TrackingPanel(below, error, curves, tints, times, lines, screen))
                if n == len(errors) - 1:
                    below.set_xlabel("t, s")
                else:
                    below.tick_params(labelbottom=False)
            self._write_title(mission.title)
            self._draw_legend(tints, {color for _, color in lines}, bool(sampled.faulty().any()))
            self._create_caption(fps)
            self._artists = [*self._scene.artists, *(a for panel in self._panels for a in panel.artists)]
            self._artists += [self._clock, *self._dots, *self._told]
            canvas: Any = self.figure.canvas
            canvas.draw()
            self.canvas = canvas
        self._background = canvas.copy_from_bbox(self.figure.bbox)

    def __len__(self) -> int:
        return len(self._times)

    def frame(self, k: int) -> NDArray[np.uint8]:
        """Draw frame ``k`` and return its pixels (height, width, RGBA); they change with the next frame."""
        self.canvas.restore_region(self._background)
        self._scene.draw(k)
        for panel in self._panels:
            panel.draw(k)
        self._write_caption(float(self._times[k]))
        for artist in self._artists:
            owner = artist.axes or self.figure
            owner.draw_artist(artist)
        return np.asarray(self.canvas.buffer_rgba())

    def frames(self) -> Iterator[NDArray[np.uint8]]:
        """Draw all frames, one after the other."""
        for k in range(len(self)):
            yield self.frame(k)

    @property
    def caption(self) -> tuple[str, ...]:
        """What the caption says now: the time, then the latest events."""
        return (self._clock.get_text(), *(text.get_text() for text in self._told if text.get_text()))

    def close(self) -> None:
        """Free the figure."""
        plt.close(self.figure)

    def _write_title(self, title: str) -> None:
        screen = self._screen
        name, _, rest = title.partition(": ")
        height = 1.0 - 32.0 * screen.unit
        head = self.figure.text(
            _LEFT, height, _fitted(name, 16.0, 1.0, screen), fontsize=16.0, fontweight="bold", va="center"
        )
        left = head.get_window_extent().x1 / screen.width + 0.012 if screen.wide else _LEFT
        height -= 2.0 * screen.unit if screen.wide else 30.0 * screen.unit
        rest = _fitted(rest, 12.0, 1.0 - left, screen)
        self.figure.text(left, height, rest, fontsize=12.0, color=screen.muted, va="center")

    def _draw_legend(self, tints: Mapping[int, Color], marked: set[str], faulty: bool) -> None:
        dot: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 8.0}
        entries: list[Any] = []
        if len(tints) <= _MOST_UAVS:
            entries += [
                Line2D([], [], color=hexadecimal(tint), label=f"{'' if n else 'UAV '}{uav}", **dot)
                for n, (uav, tint) in enumerate(tints.items())
            ]
        if faulty:
            frame: dict[str, Any] = {"linestyle": "none", "marker": "s", "markersize": 9.0, "markerfacecolor": "none"}
            entries.append(Line2D([], [], color=FAULT, markeredgewidth=1.3, label="faulty", **frame))
        entries += self._scene.legend
        lines = ((FAULT, "fault, disturbance"), (LINK, "link event"), (COMMAND, "other event"))
        entries += [Line2D([], [], color=color, linewidth=1.4, label=name) for color, name in lines if color in marked]
        self.figure.legend(
            handles=entries,
            loc="center left",
            bbox_to_anchor=(0.017, 1.0 - (68.0 if self._screen.wide else 112.0) * self._screen.unit),
            ncols=len(entries) if self._screen.wide else -(-len(entries) // 2),
            handlelength=1.1,
            columnspacing=1.3,
            handletextpad=0.5,
            fontsize=10.0,
        )

    def _create_caption(self, fps: float) -> None:
        screen, figure = self._screen, self.figure
        unit = screen.unit
        clock = (_LEFT, (58.0 if screen.wide else 118.0) * unit)
        self._clock = figure.text(*clock, "", fontsize=22.0, fontweight="bold", va="center", animated=True)
        span = float(self._times[-1] - self._times[0])
        pace = f"{span * fps / max(len(self._times) - 1, 1):.3g} x real time"
        beside = (_LEFT, 22.0 * unit) if screen.wide else (0.4, 116.0 * unit)
        figure.text(*beside, pace, fontsize=10.0, color=screen.muted, va="center")
        self._told_at = 0.2 if screen.wide else _LEFT
        heights = [(67.0 - 24.5 * n) * unit for n in range(_TOLD)]
        style: dict[str, Any] = {"va": "center", "animated": True, "fontsize": _TOLD_SIZE}
        self._dots = [figure.text(self._told_at, height, "●", **style) for height in heights]
        self._told_at += 0.02 if screen.wide else 0.035
        self._told = [figure.text(self._told_at, height, "", **style) for height in heights]

    def _write_caption(self, t: float) -> None:
        """Write the time, and the latest events, the newest first."""
        self._clock.set_text(f"t = {t:.1f} s")
        latest = _together([event for event in self._events if float(event["t"]) <= t + 1e-6])[-_TOLD:][::-1]
        for n, (dot, text) in enumerate(zip(self._dots, self._told)):
            line = _line(latest[n]) if n < len(latest) else ""
            text.set_text(_fitted(line, _TOLD_SIZE, 1.0 - self._told_at, self._screen))
            dot.set_visible(n < len(latest))
            if n < len(latest):
                begin, _, color, _ = latest[n]
                new = t - begin <= self._fresh
                dot.set_color(color)
                text.set_color(self._screen.ink if new else self._screen.muted)
                text.set_fontweight("bold" if new else "normal")


def _together(events: Sequence[Mapping[str, Any]]) -> list[tuple[float, str, str, list[int]]]:
    """Return events as (time s, text, colour, UAVs), those of one time and text as one."""
    found: dict[tuple[float, str], tuple[str, list[int]]] = {}
    for event in events:
        _, uavs = found.setdefault((float(event["t"]), str(event["text"])), (_color(event), []))
        if event.get("uav") is not None:
            uavs.append(int(event["uav"]))
    return [(t, text, color, uavs) for (t, text), (color, uavs) in found.items()]


def _line(event: tuple[float, str, str, list[int]]) -> str:
    """Return an event as a line of the caption."""
    t, text, _, uavs = event
    who = f"UAV {', '.join(map(str, uavs))}: " if uavs else ""
    return f"{t:.1f} s   {who}{text}"


def _fitted(text: str, size: float, share: float, screen: Screen) -> str:
    """Return a text of ``size`` points, cut off where it would not fit into a share of the picture's width."""
    most = int((share - 0.02) * screen.width / (_LETTER_WIDTH * size / 72.0 * screen.dpi))
    return text if len(text) <= most else f"{text[: most - 1]}…"


def _color(event: Mapping[str, Any]) -> str:
    """Return the colour of an event."""
    if _ABOUT_LINKS.match(str(event["text"])):
        return LINK
    return FAULT if event["severity"] in ("warning", "error") else COMMAND


def _layout(screen: Screen, panels: int) -> tuple[Box, list[Box]]:
    """Return the place of the scene, and those of panels from top to bottom, as shares of the picture."""
    if screen.wide:
        top, bottom, gap = 0.835, 0.205, 0.065
        height = (top - bottom - gap * (panels - 1)) / max(panels, 1)
        boxes = [(0.635, top - (n + 1) * height - n * gap, 0.345, height) for n in range(panels)]
        return (0.065, bottom, 0.5 if panels else 0.9, top - bottom), boxes
    top, bottom, gap = 0.42, 0.145, 0.03
    height = (top - bottom - gap * (panels - 1)) / max(panels, 1)
    boxes = [(0.11, top - (n + 1) * height - n * gap, 0.86, height) for n in range(panels)]
    return (0.11, 0.5 if panels else 0.16, 0.86, 0.36 if panels else 0.7), boxes
