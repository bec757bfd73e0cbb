"""How a film looks: its size, and colours on light or dark."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ftcc.groundside.canvas import STYLE
from ftcc.groundside.palette import CUT, GRAY, STALE, hexadecimal

__all__ = ["COMMAND", "FAULT", "LINK", "Screen"]

FAULT, LINK, COMMAND = hexadecimal(CUT), hexadecimal(STALE), hexadecimal(GRAY)
"""Colours of events: faults and disturbances, links, all others."""

_WIDTH, _HEIGHT, _DPI = 1280, 720, 100
"""Size at which letters and lines have the size that the style gives them."""


@dataclass(frozen=True)
class Screen:
    """Size in pixels, and whether letters are light on dark."""

    width: int = _WIDTH
    height: int = _HEIGHT
    dark: bool = False

    @property
    def wide(self) -> bool:
        """Whether the tracking errors are beside the scene, not below it."""
        return self.width >= 1.2 * self.height

    @property
    def scale(self) -> float:
        """Size of letters, lines and aircraft; 1 at 1280x720."""
        if self.wide:
            return min(self.width / _WIDTH, self.height / _HEIGHT)
        return min(self.width / _HEIGHT, self.height / _WIDTH)

    @property
    def dpi(self) -> float:
        """Pixels per inch of the figure."""
        return _DPI * self.scale

    @property
    def unit(self) -> float:
        """A pixel at 1280x720, as a share of the height."""
        return self.scale / self.height

    @property
    def ink(self) -> str:
        """Colour of letters and axes."""
        return "#e8ecf2" if self.dark else "#1c232d"

    @property
    def muted(self) -> str:
        """Colour of what matters less."""
        return "#98a3b3" if self.dark else "#66707e"

    @property
    def paper(self) -> str:
        """Colour of the background."""
        return "#12171f" if self.dark else "#ffffff"

    @property
    def style(self) -> Any:
        """Matplotlib's settings."""
        return {
            **STYLE,
            "font.size": 11.0,
            "axes.labelsize": 11.0,
            "axes.titlesize": 11.0,
            "xtick.labelsize": 10.0,
            "ytick.labelsize": 10.0,
            "axes.titlelocation": "left",
            "axes.edgecolor": self.muted,
            "axes.labelcolor": self.ink,
            "axes.titlecolor": self.ink,
            "axes.facecolor": self.paper,
            "figure.facecolor": self.paper,
            "text.color": self.ink,
            "xtick.color": self.muted,
            "ytick.color": self.muted,
            "xtick.labelcolor": self.ink,
            "ytick.labelcolor": self.ink,
            "lines.linewidth": 1.6,
            "axes.formatter.limits": (-4, 5),
            "grid.alpha": 0.22,
        }
