"""Matplotlib for figures in files, in one style: without a display, with a cache folder that is always writable."""

from __future__ import annotations

import html
import io
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ftcc.link.folders import matplotlib_folder

matplotlib_folder()

import matplotlib  # noqa: E402  (must see MPLCONFIGDIR)

matplotlib.use("Agg")

from matplotlib import pyplot as plt  # noqa: E402
from matplotlib.lines import Line2D  # noqa: E402

__all__ = ["DPI", "INK", "LOOKS", "PAGE", "STYLE", "WIDTH", "Drawn", "Line2D", "Look", "plt", "save"]

INK = "#010203"
"""Placeholder for the text colour, which the page replaces by its own, so that figures suit light and dark."""
WIDTH = 7.2
"""Width of a figure, inches."""
DPI = 160
"""Resolution of PNG files."""

STYLE: Any = {
    "font.family": "sans-serif",
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "axes.labelsize": 8.0,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.grid": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-3, 5),
    "grid.color": "#808890",
    "grid.alpha": 0.25,
    "grid.linewidth": 0.5,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "lines.linewidth": 1.0,
    "legend.frameon": False,
    "legend.fontsize": 7.5,
    "svg.fonttype": "none",
    "svg.hashsalt": "ftcc",
    "pdf.fonttype": 42,
    "savefig.transparent": True,
}


@dataclass(frozen=True)
class Look:
    """Size and type of figures: those of the page, or those that a journal asks for."""

    name: str
    width: float = WIDTH
    """Inches."""
    style: Any = field(default_factory=lambda: STYLE)
    row: float = 1.9
    """Height of a row of panels, inches."""
    columns: int = 3
    """Most columns of panels."""
    details: int = 3
    """Most details in a row."""
    floating: str = "figure*"
    """LaTeX's environment: ``figure`` in a column, ``figure*`` across both."""

    @property
    def is_narrow(self) -> bool:
        """Whether it is for one column: labels are folded, legends have fewer columns."""
        return self.floating == "figure"


PAGE = Look("wide")
_SIZES = ("font.size", "axes.titlesize", "axes.labelsize", "xtick.labelsize", "ytick.labelsize", "legend.fontsize")
_EIGHT_POINT = STYLE | dict.fromkeys(_SIZES, 8.0)
_MM = 1.0 / 25.4


def _paper(name: str, column: float, both: float) -> list[Look]:
    """Return the looks of a journal, for one column and across both (inches)."""
    narrow = Look(name, column, _EIGHT_POINT, 1.45, columns=1, details=2, floating="figure")
    return [narrow, Look(f"{name}-wide", both, _EIGHT_POINT)]


LOOKS = {
    look.name: look
    for look in (
        PAGE,
        # IEEE Author Center, "Resolution and Size": 3.5 in for one column, 7.16 in for two.
        *_paper("ieee", 3.5, 7.16),
        # Springer, "Artwork and Illustrations Guidelines": 84 mm for one column, 174 mm for two; text of 8 to 12 pt.
        *_paper("springer", 84.0 * _MM, 174.0 * _MM),
    )
}
"""Looks by name; `PAGE` is that of the page and of figures that ask for no other."""


@dataclass(frozen=True)
class Drawn:
    """A drawn figure and its files."""

    name: str
    title: str
    number: str
    svg: str
    files: tuple[Path, ...]
    latex: str = ""
    """How a paper includes it; empty if that was not asked for."""

    def _repr_html_(self) -> str:
        """Return the figure as a notebook shows it."""
        return self.svg


def save(figure: Any, name: str, title: str, number: str, folder: Path, look: Look = PAGE) -> Drawn:
    """Write a figure as SVG, PDF and PNG, and close it."""
    folder.mkdir(parents=True, exist_ok=True)
    buffer = io.StringIO()
    files = tuple(folder / f"{name}.{kind}" for kind in ("svg", "pdf", "png"))
    with plt.rc_context(look.style):
        # Compute the layout once, not for each format.
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
        figure.savefig(buffer, format="svg", metadata={"Date": None})
        files[0].write_text(_small(buffer.getvalue()), encoding="utf-8")
        figure.savefig(files[1], metadata={"CreationDate": None})
        figure.savefig(files[2], dpi=DPI, transparent=False)
    plt.close(figure)
    return Drawn(name, title, number, _for_page(files[0].read_text(encoding="utf-8"), title, name), files)


def _small(svg: str) -> str:
    """Round the coordinates of curves to a tenth of a point."""
    return re.sub(r'\bd="[^"]+"', lambda path: re.sub(r"(\d+\.\d)\d+", r"\1", path[0]), svg)


def _for_page(svg: str, title: str, name: str) -> str:
    """Convert an SVG file to an element of a page: text in the page's colour, unique ids, a title."""
    body = svg[svg.index("<svg") :].replace(INK, "currentColor")
    body = re.sub(r'\bid="([^"]+)"', rf'id="{name}-\1"', body)
    body = re.sub(r'(xlink:href="|url\()#', rf"\1#{name}-", body)
    return re.sub(
        r"<svg([^>]*?) (width|height)=\"[^\"]*\"([^>]*?)>",
        rf'<svg\1\3 role="img" aria-label="{html.escape(title)}">',
        body,
        count=1,
    )
