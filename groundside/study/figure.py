"""Draw a study as a figure: every claim over the first varied key."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ftcc.groundside.study.flights import Outcome
from ftcc.groundside.study.plan import Study
from ftcc.groundside.study.results import Quantity, kind_of, label, quantities

__all__ = ["draw"]


def draw(study: Study, outcomes: Sequence[Outcome], folder: Path) -> list[Path]:
    """Draw every claim over the first varied key, a line per combination of the others, as PNG and PDF.

    Thick: quartiles; thin: smallest to largest; dashed: bound of the claim; dotted: value expected in the scenario's
    case. Claims without any number are left out; if only some flights have one, their count is shown.
    """
    from ftcc.groundside.canvas import plt

    shown = [quantity for quantity in quantities(study) if quantity.among(outcomes)]
    if not shown:
        return []
    width = min(3, len(shown))
    height = math.ceil(len(shown) / width)
    figure, grid = plt.subplots(height, width, figsize=(4.2 * width, 2.8 * height), layout="constrained", squeeze=False)
    for axes, quantity in zip(grid.flat, shown, strict=False):
        _draw_quantity(axes, study, outcomes, quantity)
    for axes in grid.flat[len(shown) :]:
        axes.set_axis_off()
    if len(study.variations) > 1:
        handles, labels = grid.flat[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize="small", frameon=False)
    flights = f"{len(outcomes)} flights, {len(study.seeds)} seeds"
    figure.suptitle(f"{study.mission.title}\n{study.mission.case}, {flights}", fontsize="medium")
    files = [folder / f"study.{kind}" for kind in ("png", "pdf")]
    for file in files:
        figure.savefig(file, dpi=150)
    plt.close(figure)
    return files


def _draw_quantity(axes: Any, study: Study, outcomes: Sequence[Outcome], quantity: Quantity) -> None:
    mission = study.mission
    values = study.variations[0].values if study.variations else (mission.case,)
    numeric = len(values) > 1 and kind_of(values)[1] is float
    lines: dict[str, list[int]] = {}
    for n in range(len(study.combinations)):
        lines.setdefault(label(study, n, skip=1), []).append(n)
    gap = 0.02 * (max(values) - min(values)) if numeric else 0.1
    for line, (others, members) in enumerate(lines.items()):
        shift = gap * (line - 0.5 * (len(lines) - 1))
        places, medians = [], []
        for n in members:
            group = [outcome for outcome in outcomes if outcome.trial.combination == n]
            numbers = quantity.among(group)
            first = values.index(study.combinations[n].values[0]) if study.variations else 0
            place = (values[first] if numeric else first) + shift
            if not numbers:
                continue
            low, middle, high = np.percentile(numbers, [25, 50, 75])
            places.append(place)
            medians.append(middle)
            axes.plot([place, place], [min(numbers), max(numbers)], color=f"C{line}", linewidth=0.8)
            axes.plot([place, place], [low, high], color=f"C{line}", linewidth=4.0, alpha=0.6, solid_capstyle="butt")
            if len(numbers) < len(group):
                axes.annotate(f"{len(numbers)}/{len(group)}", (place, max(numbers)), fontsize="x-small", ha="center")
        axes.plot(places, medians, f"C{line}o-", markersize=4.0, linewidth=1.0 if numeric else 0.0, label=others)
    tolerance, expected = quantity.tolerance, quantity.expected
    if tolerance.bound:
        limit = tolerance.size * abs(expected) if tolerance.unit == "x" else tolerance.size
        axes.axhline(limit, color="0.5", linestyle="--", linewidth=0.8)
    else:
        axes.axhline(expected, color="0.5", linestyle=":", linewidth=0.8)
    if not numeric:
        axes.set_xticks(range(len(values)), [str(value) for value in values])
        axes.set_xlim(-0.5, len(values) - 0.5)
    axes.set_title(quantity.name, fontsize="small", wrap=True)
    axes.set_xlabel(study.variations[0].key if study.variations else "", fontsize="small")
    axes.set_ylabel(quantity.claim.unit, fontsize="small")
    axes.tick_params(labelsize="small")
