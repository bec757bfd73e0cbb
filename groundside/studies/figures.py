"""The figures of a study, as SVG, PDF and PNG: without titles, for a paper; their captions stand beside them."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ftcc.groundside.statistics import share
from ftcc.groundside.studies.answers import HEADLINE, Answers, label_of
from ftcc.groundside.studies.measures import Measure
from ftcc.groundside.studies.plan import CASE

if TYPE_CHECKING:
    from ftcc.groundside.canvas import Drawn

__all__ = ["FIGURES", "Figure", "draw", "draw_figure", "draw_figures"]

_BINS = 8
"""Parts of a random quantity's range, each with the same number of flights."""
_MOST = 12
"""Largest number of panels of a figure."""
_LINES = 8
"""Largest number of combinations of a figure."""
_WIDE = 3
"""Largest number of panels beside each other."""
_COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#807a00", "#7f7f7f")
"""Colours that colour-blind people tell apart (Okabe & Ito 2008); yellow is too bright for white paper, thus darker."""
_MARKS = ("o", "s", "^", "D", "v", "P", "X", "*")
"""Marks by combination: figures stay readable without colours."""
_DECADES = 100.0
"""Ratio of the largest to the smallest value from which on an axis is logarithmic."""


@dataclass(frozen=True)
class Figure:
    """A figure of a study: how it is drawn, and its caption."""

    make: Callable[[Answers], Any]
    """Returns None if the study has nothing for it."""
    caption: str


def draw(answers: Answers, folder: Path) -> list[Path]:
    """Draw all figures that a study has something for, into ``folder``, and return their files."""
    return [file for figure in draw_figures(answers, folder) for file in figure.files]


def draw_figures(answers: Answers, folder: Path) -> list[Drawn]:
    """Draw all figures that a study has something for, into ``folder``, and return them with their captions.

    Equal studies give equal files.
    """
    found = [draw_figure(name, answers, folder) for name in FIGURES]
    return [one for one in found if one is not None]


def draw_figure(name: str, answers: Answers, folder: Path) -> Drawn | None:
    """Draw one of `FIGURES`; None if the study has nothing for it."""
    from ftcc.groundside.canvas import DPI, STYLE, plt, save

    figure = FIGURES[name]
    with plt.rc_context({**STYLE, "figure.dpi": DPI}):  # laid out as it is written: text is not cut
        made = figure.make(answers)
    return None if made is None else save(made, name, figure.caption, "", folder)


def shares(answers: Answers) -> Any:
    """Draw how often each claim holds, with intervals: a row per claim, a mark per combination."""
    from ftcc.groundside.canvas import WIDTH, plt

    titles, labels = answers.titles, _labels(answers)
    height = 0.75 + len(titles) * (0.14 + 0.14 * len(labels)) + _legend_height(labels)
    figure, axes = plt.subplots(figsize=(WIDTH, height), layout="constrained")
    step = 0.8 / max(len(labels), 2)
    for n, label in enumerate(labels):
        found = [answers.share(title, n) for title in titles]
        rows = np.arange(len(titles)) + step * (n - 0.5 * (len(labels) - 1))
        value, low, high = (np.array([100.0 * getattr(one, end) for one in found]) for end in ("value", "low", "high"))
        _errorbar(axes, value, rows, n, label, xerr=[value - low, high - value])
    axes.set_yticks(range(len(titles)), [textwrap.fill(title, 34) for title in titles])
    axes.set_ylim(len(titles) - 0.5, -0.5)
    least = min(answers.share(title, n).low for title in titles for n in range(len(labels)))
    # Marks, not bars: the axis need not begin at 0, and short intervals stay visible.
    axes.set_xlim(10.0 * math.floor(10.0 * least - 0.5) if least > 0.4 else -1.0, 100.6)
    axes.set_xlabel("flights in which it holds, %")
    axes.grid(axis="y", visible=False)
    _legend(figure, axes, labels)
    return figure


def influences(answers: Answers) -> Any:
    """Draw the headline's share over each random quantity, in parts with as many flights, with intervals."""
    quantities = answers.plan.draws.quantities[:_MOST]
    if not quantities or answers.draws < 2 * _BINS:
        return None
    labels = _labels(answers)[:4]
    figure, grid = _grid(len(quantities), extra=_legend_height(labels))
    for place, (axes, one) in enumerate(zip(grid, quantities, strict=False)):
        column = np.array(answers.table.column(one.key).to_pylist(), dtype=object)
        for n, label in enumerate(labels):
            there = answers.rows_of(n)
            holds = answers.holds(HEADLINE)[answers.draw_of[there], n]
            _draw_influence(axes, column[there].tolist(), holds, n, len(labels), label)
        axes.set_xlabel(one.key)
        axes.set_ylim(-3.0, 103.0)
        if place % _beside(len(quantities)) == 0:
            axes.set_ylabel(f"{HEADLINE}, % of flights")
    _legend(figure, grid[0], labels)
    return figure


def _draw_influence(axes: Any, values: list[Any], holds: Any, n: int, of: int, label: str) -> None:
    known = [value is not None and math.isfinite(hold) for value, hold in zip(values, holds, strict=True)]
    kept = [value for value, there in zip(values, known, strict=True) if there]
    hold = np.asarray(holds)[known]
    if not kept:
        return
    few = len(set(kept)) <= _BINS
    kinds = sorted(set(kept), key=_order) if few else []
    if few:
        groups = [(float(place), np.array([value == kind for value in kept])) for place, kind in enumerate(kinds)]
        axes.set_xticks(range(len(kinds)), [f"{kind:g}" if isinstance(kind, float) else str(kind) for kind in kinds])
        axes.set_xlim(-0.5, len(kinds) - 0.5)
        gap = 0.12
    else:
        numbers = np.asarray(kept, float)
        edges = np.quantile(numbers, np.linspace(0.0, 1.0, _BINS + 1))
        part = np.clip(np.searchsorted(edges, numbers, side="right") - 1, 0, _BINS - 1)
        groups = [(float(numbers[part == one].mean()), part == one) for one in range(_BINS) if (part == one).any()]
        gap = 0.018 * float(edges[-1] - edges[0])
    # Beside each other: equal shares would hide each other's intervals.
    shift = gap * (n - 0.5 * (of - 1))
    found = [share(int(hold[inside].sum()), int(inside.sum())) for _, inside in groups]
    x = [place + shift for place, _ in groups]
    y, low, high = (np.array([100.0 * getattr(one, end) for one in found]) for end in ("value", "low", "high"))
    _errorbar(axes, x, y, n, label, yerr=[y - low, high - y], line="" if few else "-")


def _order(value: Any) -> tuple[bool, Any]:
    return (True, str(value)) if isinstance(value, str) else (False, value)


def sensitivities(answers: Answers) -> Any:
    """Draw the Sobol' indices of each claim's value: two bars per random quantity, with intervals."""
    from ftcc.groundside.canvas import INK

    found = answers.sensitivities()[:_MOST]
    if not found:
        return None
    keys = list(found[0].indices)
    figure, grid = _grid(len(found), height=0.75 + 0.3 * len(keys), extra=0.3, sharey=True)
    for axes, one in zip(grid, found, strict=False):
        rows = np.arange(len(keys))
        for shift, part, n in ((-0.19, "total", 0), (0.19, "first", 1)):
            value, low, high = (
                np.array([getattr(one.indices[key], f"{part}{end}") for key in keys]) for end in ("", "_low", "_high")
            )
            ends = np.clip([value - low, high - value], 0.0, None)
            look = {
                "color": _COLORS[n],
                "alpha": 0.65,
                "hatch": ("", "////")[n],
                "edgecolor": "white",
                "linewidth": 0.0,
            }
            thin = {"ecolor": INK, "linewidth": 0.9, "capsize": 2.0, "capthick": 0.9}
            axes.barh(rows + shift, value, 0.36, xerr=ends, error_kw=thin, label=_NAMES[part], **look)
        axes.set_title(textwrap.fill(f"{one.name} ({one.used} of {one.of})", 34))
        axes.set_xlabel("share of the variance")
        # Indices are within 0 and 1; wider intervals of few samples go on beyond the frame.
        axes.set_xlim(-0.25, 1.25)
        axes.axvline(0.0, color="0.5", linewidth=0.8)
        axes.grid(axis="y", visible=False)
    grid[0].set_yticks(range(len(keys)), keys)
    grid[0].set_ylim(len(keys) - 0.5, -0.5)
    _legend(figure, grid[0], list(_NAMES))
    return figure


_NAMES = {"total": "total: alone and together with others", "first": "first order: alone"}


def claims(answers: Answers) -> Any:
    """Draw the value of every claim over the first varied key, a line per combination of the others.

    Claims without any number are left out; if only some flights have one, their count is shown.
    """
    shown = [one for one in answers.measures if np.isfinite(answers.values(one)).any()][:_MOST]
    if not shown:
        return None
    lines = list(dict.fromkeys(label_of(answers.plan, n, skip=1) for n in range(len(answers.labels))))[:_LINES]
    figure, grid = _grid(len(shown), height=2.1, extra=_legend_height(lines))
    for axes, measure in zip(grid, shown, strict=False):
        _draw_claim(axes, answers, measure, lines)
    _legend(figure, grid[0], lines)
    return figure


def _draw_claim(axes: Any, answers: Answers, measure: Measure, lines: Sequence[str]) -> None:
    plan = answers.plan
    values = plan.variations[0].values if plan.variations else (plan.case,)
    numeric = len(values) > 1 and all(isinstance(one, (int, float)) and not isinstance(one, bool) for one in values)
    gap = 0.02 * (max(values) - min(values)) if numeric else 0.1
    found = answers.values(measure)
    for line, others in enumerate(lines):
        shift = gap * (line - 0.5 * (len(lines) - 1))
        color, places, medians = _COLORS[line], [], []
        for n in range(len(answers.labels)):
            numbers = found[:, n][np.isfinite(found[:, n])]
            if label_of(plan, n, skip=1) != others or not len(numbers):
                continue
            first = values.index(plan.combinations[n][0]) if plan.variations else 0
            place = (values[first] if numeric else first) + shift
            low, middle, high = np.percentile(numbers, [25, 50, 75])
            places.append(place)
            medians.append(middle)
            axes.plot([place, place], [min(numbers), max(numbers)], color=color, linewidth=0.9)
            axes.plot([place, place], [low, high], color=color, linewidth=4.5, alpha=0.5, solid_capstyle="butt")
            flown = int(answers.flown[:, n].sum())
            if len(numbers) < flown:
                text = {
                    "textcoords": "offset points",
                    "xytext": (0, 3),
                    "fontsize": 6.5,
                    "ha": "center",
                    "color": color,
                }
                axes.annotate(f"{len(numbers)}/{flown}", (place, max(numbers)), **text)
        style = "-" if numeric else ""
        axes.plot(places, medians, color=color, marker=_MARKS[line], linestyle=style, markersize=4.0, label=others)
    level, style = (measure.limit, "--") if measure.tolerance.bound else (measure.expected, ":")
    axes.axhline(level, color="0.45", linestyle=style, linewidth=0.9)
    numbers = found[np.isfinite(found)]
    if numbers.min() > 0.0 and numbers.max() > _DECADES * numbers.min():
        axes.set_yscale("log")
    axes.margins(y=0.14)
    if not numeric:
        axes.set_xticks(range(len(values)), [textwrap.fill(str(value), 14) for value in values])
        axes.set_xlim(-0.5, len(values) - 0.5)
    axes.set_title(textwrap.fill(measure.name, 34))
    key = plan.variations[0].key if plan.variations else ""
    axes.set_xlabel("" if key == CASE else key)
    axes.set_ylabel("" if measure.claim.unit == "-" else measure.claim.unit)


def _labels(answers: Answers) -> list[str]:
    return [label or answers.plan.case for label in answers.labels[:_LINES]]


def _errorbar(axes: Any, x: Any, y: Any, n: int, label: str, line: str = "", **ends: Any) -> None:
    look = {"color": _COLORS[n], "markersize": 4.0, "elinewidth": 1.1, "capsize": 2.5, "capthick": 1.1}
    axes.errorbar(x, y, marker=_MARKS[n], linestyle=line, linewidth=0.9, label=label, **look, **ends)


def _legend(figure: Any, axes: Any, labels: Sequence[str]) -> None:
    """Explain several lines below the panels, in as many columns as their texts leave room for."""
    if len(labels) < 2:
        return
    handles, names = axes.get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=_columns(labels))


def _columns(labels: Sequence[str]) -> int:
    return max(1, min(4, 100 // (8 + max(map(len, labels)))))


def _legend_height(labels: Sequence[str]) -> float:
    """Return the height of a legend, inches."""
    return 0.1 + 0.16 * math.ceil(len(labels) / _columns(labels)) if len(labels) > 1 else 0.0


def _beside(panels: int) -> int:
    """Return the number of panels in a row."""
    return 2 if panels == 4 else min(_WIDE, panels)


def _grid(panels: int, height: float = 2.0, extra: float = 0.0, **options: Any) -> tuple[Any, list[Any]]:
    """Return a figure with so many axes, at most three beside each other, and ``extra`` inches for a legend."""
    from ftcc.groundside.canvas import WIDTH, plt

    beside = _beside(panels)
    rows = math.ceil(panels / beside)
    width = WIDTH if beside > 1 else 0.6 * WIDTH
    figure, grid = plt.subplots(
        rows, beside, figsize=(width, height * rows + extra), layout="constrained", squeeze=False, **options
    )
    for axes in grid.flat[panels:]:
        axes.set_axis_off()
    return figure, list(grid.flat[:panels])


FIGURES = {
    "study": Figure(
        claims,
        "Values of the claims. Mark: median; thick: quartiles; thin: smallest to largest; dashed: bound of the claim; "
        "dotted: value expected in the scenario's own case; m/n: only m of n flights give a number",
    ),
    "shares": Figure(shares, "Share of flights in which each claim holds, with 95 % intervals (Clopper-Pearson)"),
    "influences": Figure(
        influences,
        "Share of flights in which all holds, over each random quantity while the others are drawn as well, in parts "
        "with as many flights each, with 95 % intervals",
    ),
    "sensitivities": Figure(
        sensitivities,
        "Sobol' indices, with 95 % intervals: which share of the variance a random quantity explains. Wider bars and "
        "intervals, of few samples, go on beyond the frame. In brackets: base samples that count",
    ),
}
"""Figures by the name of their files."""
