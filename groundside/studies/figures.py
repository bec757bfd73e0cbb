"""The figures of a study, as PNG, SVG and PDF."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from ftcc.groundside.statistics import share
from ftcc.groundside.studies.answers import HEADLINE, Answers, label_of
from ftcc.groundside.studies.measures import Measure
from ftcc.groundside.studies.plan import CASE

__all__ = ["FIGURES", "FORMATS", "draw"]

FORMATS = ("png", "svg", "pdf")
_BINS = 8
"""Parts of a random quantity's range, each with the same number of flights."""
_MOST = 12
"""Largest number of panels of a figure."""


def draw(answers: Answers, folder: Path) -> list[Path]:
    """Draw all figures that a study has something for, into ``folder``, and return their files."""
    from ftcc.groundside.canvas import plt

    files = []
    for name, make in FIGURES.items():
        figure = make(answers)
        if figure is None:
            continue
        for kind in FORMATS:
            files.append(folder / f"{name}.{kind}")
            # Without dates, so that equal studies give equal files.
            figure.savefig(files[-1], dpi=150, metadata={"Date": None} if kind == "svg" else _UNDATED.get(kind, {}))
        plt.close(figure)
    return files


_UNDATED: dict[str, dict[str, None]] = {"pdf": {"CreationDate": None}}


def shares(answers: Answers) -> Any:
    """Draw how often each claim holds, with intervals: a row per claim, a mark per combination."""
    from ftcc.groundside.canvas import plt

    titles, places = answers.titles, range(min(len(answers.labels), 8))
    figure, axes = plt.subplots(figsize=(7.0, 0.9 + 0.34 * len(titles) * max(1, 0.6 * len(places))), layout="constrained")
    for n in places:
        found = [answers.share(title, n) for title in titles]
        rows = np.arange(len(titles)) + 0.16 * (n - 0.5 * (len(places) - 1))
        value = np.array([100.0 * one.value for one in found])
        low, high = (np.array([100.0 * getattr(one, end) for one in found]) for end in ("low", "high"))
        axes.errorbar(value, rows, xerr=[value - low, high - value], fmt="o", color=f"C{n}", capsize=3, markersize=4,
                      label=answers.labels[n] or answers.plan.case)  # fmt: skip
    axes.set_yticks(range(len(titles)), titles, fontsize="small")
    axes.invert_yaxis()
    axes.set_xlim(-2.0, 102.0)
    axes.set_xlabel("flights in which it holds, % (exact 95 % interval)", fontsize="small")
    axes.grid(axis="x", alpha=0.3)
    if len(places) > 1:
        figure.legend(loc="outside lower center", ncols=2, fontsize="small", frameon=False)
    axes.set_title(f"{answers.plan.title}\n{answers.draws} draws", fontsize="small", wrap=True)
    return figure


def influences(answers: Answers) -> Any:
    """Draw the headline's share over each random quantity, in parts with as many flights, with intervals."""
    from ftcc.groundside.canvas import plt

    quantities = answers.plan.draws.quantities[:_MOST]
    if not quantities or answers.draws < 2 * _BINS:
        return None
    figure, grid = _grid(plt, len(quantities))
    for axes, one in zip(grid, quantities, strict=False):
        column = answers.table.column(one.key).to_pylist()
        for n in range(min(len(answers.labels), 4)):
            there = answers._combination == n
            holds = answers.holds(HEADLINE)[answers._draw[there], n]
            values = [column[row] for row in np.flatnonzero(there)]
            _draw_influence(axes, values, holds, n, answers.labels[n] or answers.plan.case)
        axes.set_xlabel(one.key, fontsize="small")
        axes.set_ylim(-3.0, 103.0)
        axes.tick_params(labelsize="small")
    grid[0].set_ylabel(f"{HEADLINE}, % of flights", fontsize="small")
    if len(answers.labels) > 1:
        handles, labels = grid[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2, fontsize="small", frameon=False)
    figure.suptitle("share over each random quantity, the others drawn as well (95 % intervals)", fontsize="medium")
    return figure


def _draw_influence(axes: Any, values: list[Any], holds: Any, n: int, label: str) -> None:
    known = [value is not None and math.isfinite(hold) for value, hold in zip(values, holds, strict=True)]
    values = [value for value, there in zip(values, known, strict=True) if there]
    hold = np.asarray(holds)[known]
    if not values:
        return
    kinds = sorted(set(values), key=str) if len(set(values)) <= _BINS else None
    if kinds is not None:
        groups = [(place, [value == kind for value in values]) for place, kind in enumerate(kinds)]
        axes.set_xticks(range(len(kinds)), [f"{kind:g}" if isinstance(kind, float) else str(kind) for kind in kinds])
    else:
        numbers = np.asarray(values, float)
        edges = np.quantile(numbers, np.linspace(0.0, 1.0, _BINS + 1))
        part = np.clip(np.searchsorted(edges, numbers, side="right") - 1, 0, _BINS - 1)
        groups = [(float(numbers[part == one].mean()), part == one) for one in range(_BINS) if (part == one).any()]
    found = [(place, share(int(hold[np.asarray(inside)].sum()), int(np.sum(inside)))) for place, inside in groups]
    x = [place for place, _ in found]
    y = np.array([100.0 * one.value for _, one in found])
    ends = np.array([[100.0 * (one.value - one.low), 100.0 * (one.high - one.value)] for _, one in found]).T
    axes.errorbar(x, y, yerr=ends, fmt="o" if kinds is not None else "o-", color=f"C{n}", capsize=2, markersize=3.5,
                  linewidth=1.0, label=label)  # fmt: skip


def sensitivities(answers: Answers) -> Any:
    """Draw the Sobol' indices of each claim's value: two bars per random quantity, with intervals."""
    from ftcc.groundside.canvas import plt

    found = answers.sensitivities()[:_MOST]
    if not found:
        return None
    keys = list(found[0].indices)
    figure, grid = _grid(plt, len(found), height=0.9 + 0.3 * len(keys), sharey=True)
    for axes, one in zip(grid, found, strict=False):
        rows = np.arange(len(keys))
        for shift, part, color in ((-0.2, "total", "C0"), (0.2, "first", "C1")):
            value = np.array([getattr(one.indices[key], part) for key in keys])
            low = np.array([getattr(one.indices[key], f"{part}_low") for key in keys])
            high = np.array([getattr(one.indices[key], f"{part}_high") for key in keys])
            ends = np.clip([value - low, high - value], 0.0, None)
            axes.barh(rows + shift, value, 0.36, xerr=ends, color=color, error_kw={"linewidth": 0.8}, label=_NAMES[part])
        axes.set_title(f"{one.name}\n{one.used} of {one.of} base samples", fontsize="small", wrap=True)
        axes.axvline(0.0, color="0.5", linewidth=0.8)
        axes.tick_params(labelsize="small")
    grid[0].set_yticks(range(len(keys)), keys, fontsize="small")
    grid[0].invert_yaxis()
    handles, labels = grid[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, fontsize="small", frameon=False)
    return figure


_NAMES = {"total": "total: alone and together with others", "first": "first order: alone"}


def claims(answers: Answers) -> Any:
    """Draw the value of every claim over the first varied key, a line per combination of the others.

    Thick: quartiles; thin: smallest to largest; dashed: bound of the claim; dotted: value expected in the scenario's
    case. Claims without any number are left out; if only some flights have one, their count is shown.
    """
    from ftcc.groundside.canvas import plt

    shown = [one for one in answers.measures if np.isfinite(answers.values(one)).any()]
    if not shown:
        return None
    figure, grid = _grid(plt, len(shown))
    for axes, measure in zip(grid, shown, strict=False):
        _draw_claim(axes, answers, measure)
    if len(answers.plan.variations) > 1:
        handles, labels = grid[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize="small", frameon=False)
    figure.suptitle(f"{answers.plan.title}\n{answers.plan.case}, {answers.draws} draws", fontsize="medium")
    return figure


def _draw_claim(axes: Any, answers: Answers, measure: Measure) -> None:
    plan = answers.plan
    values = plan.variations[0].values if plan.variations else (plan.case,)
    numeric = len(values) > 1 and all(isinstance(one, (int, float)) and not isinstance(one, bool) for one in values)
    lines: dict[str, list[int]] = {}
    for n in range(len(plan.combinations)):
        lines.setdefault(label_of(plan, n, skip=1), []).append(n)
    gap = 0.02 * (max(values) - min(values)) if numeric else 0.1
    found = answers.values(measure)
    for line, (others, members) in enumerate(lines.items()):
        shift = gap * (line - 0.5 * (len(lines) - 1))
        places, medians = [], []
        for n in members:
            numbers = found[:, n][np.isfinite(found[:, n])]
            if not len(numbers):
                continue
            first = values.index(plan.combinations[n][0]) if plan.variations else 0
            place = (values[first] if numeric else first) + shift
            low, middle, high = np.percentile(numbers, [25, 50, 75])
            places.append(place)
            medians.append(middle)
            axes.plot([place, place], [min(numbers), max(numbers)], color=f"C{line}", linewidth=0.8)
            axes.plot([place, place], [low, high], color=f"C{line}", linewidth=4.0, alpha=0.6, solid_capstyle="butt")
            if len(numbers) < answers.draws:
                axes.annotate(
                    f"{len(numbers)}/{answers.draws}", (place, max(numbers)), fontsize="x-small", ha="center"
                )
        axes.plot(places, medians, f"C{line}o-", markersize=4.0, linewidth=1.0 if numeric else 0.0, label=others)
    if measure.tolerance.bound:
        axes.axhline(measure.limit, color="0.5", linestyle="--", linewidth=0.8)
    else:
        axes.axhline(measure.expected, color="0.5", linestyle=":", linewidth=0.8)
    if not numeric:
        axes.set_xticks(range(len(values)), [str(value) for value in values])
        axes.set_xlim(-0.5, len(values) - 0.5)
    axes.set_title(measure.name, fontsize="small", wrap=True)
    key = plan.variations[0].key if plan.variations else ""
    axes.set_xlabel("" if key == CASE else key, fontsize="small")
    axes.set_ylabel(measure.claim.unit, fontsize="small")
    axes.tick_params(labelsize="small")


def _grid(plt: Any, panels: int, height: float = 2.8, **options: Any) -> tuple[Any, list[Any]]:
    """Return a figure with so many axes, at most three beside each other."""
    width = min(3, panels)
    rows = math.ceil(panels / width)
    figure, grid = plt.subplots(
        rows, width, figsize=(4.2 * width, height * rows), layout="constrained", squeeze=False, **options
    )
    for axes in grid.flat[panels:]:
        axes.set_axis_off()
    return figure, list(grid.flat[:panels])


FIGURES = {"study": claims, "shares": shares, "influences": influences, "sensitivities": sensitivities}
"""Figures by the name of their files."""
