"""The answers of a study for other programs: as JSON, and as a table for LaTeX."""

from __future__ import annotations

import json
import math
import unicodedata
from typing import Any

import numpy as np

from ftcc.groundside.statistics import Estimate, Paired, Share
from ftcc.groundside.studies.answers import HEADLINE, QUANTILES, Answers
from ftcc.groundside.studies.reasons import reasons_in

__all__ = ["as_json", "as_latex", "interval_kind", "latex_text"]


def interval_kind(answers: Answers) -> str:
    """Return what the intervals of shares are in this study's design, in a few words."""
    draws = answers.plan.draws
    if draws.sensitivity:
        return "Clopper-Pearson 95 % intervals, for orientation: Saltelli's draws repeat each other's values"
    if not draws.quantities or draws.design == "random":
        return "exact 95 % intervals (Clopper-Pearson)"
    return "95 % intervals (Clopper-Pearson), as a rule conservative: points of the design spread evenly"


def as_json(answers: Answers) -> str:
    """Return the answers as JSON; null: nothing to say, or an end of an interval that is open."""
    plan, draws = answers.plan, answers.plan.draws
    combinations = range(len(answers.labels))
    titles = answers.titles
    document = {
        "study": plan.name,
        "title": plan.title,
        "question": plan.question,
        "sentences": answers.sentences(),
        "design": draws.design,
        "seed": draws.seed,
        "samples": draws.samples,
        "sensitivity": draws.sensitivity,
        "random": [{"key": one.key, "distribution": one.distribution.text} for one in draws.quantities],
        "vary": [{"key": one.key, "values": list(one.values)} for one in plan.variations],
        "combinations": [
            {
                "label": answers.labels[n] or plan.case,
                "flown": int(answers.flown[:, n].sum()),
                "refused": int(answers.refused[:, n].sum()),
            }
            for n in combinations
        ],
        "draws": answers.draws,
        "intervals": interval_kind(answers),
        "shares": [
            {"claim": title, "combination": n} | _share(answers.share(title, n))
            for title in titles
            for n in combinations
        ],
        "paired": [
            {"claim": title, "first": 0, "second": n} | _paired(answers.paired(title, n))
            for title in titles
            for n in combinations[1:]
        ],
        "quantiles": [
            {"value": measure.name, "unit": measure.claim.unit, "combination": n}
            | {f"{q:g}": _estimate(one) for q, one in zip(QUANTILES, found, strict=True)}
            for measure in answers.measures
            for n in combinations
            if (found := answers.quantiles(measure, n)) is not None
        ],
        "sensitivities": [
            {
                "value": one.name,
                "used": one.used,
                "of": one.of,
                "indices": {key: _finite(vars(index)) for key, index in one.indices.items()},
            }
            for one in answers.sensitivities()
        ],
        "refused": [vars(reason) for reason in reasons_in(answers.errors(refused=True))],
        "broken_off": [vars(reason) for reason in reasons_in(answers.errors(refused=False))],
        "failed": answers.failed(),
    }
    return json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False)


def _share(found: Share) -> dict[str, Any]:
    return _finite({"holds": found.count, "of": found.of, "share": found.value, "low": found.low, "high": found.high})


def _paired(found: Paired) -> dict[str, Any]:
    return _finite(vars(found))


def _estimate(found: Estimate) -> dict[str, Any]:
    return _finite(vars(found))


def _finite(table: dict[str, Any]) -> dict[str, Any]:
    return {
        key: None if isinstance(value, float) and not math.isfinite(value) else value for key, value in table.items()
    }


def as_latex(answers: Answers) -> str:
    """Return the table of answers for LaTeX with the package booktabs: a column per combination.

    Rows: flights, share of every claim, the headline's paired differences, median of every value with its interval.
    """
    plan = answers.plan
    combinations = range(len(answers.labels))
    lines = [
        r"% needs \usepackage{booktabs}",
        r"\begin{table}",
        r"  \centering",
        rf"  \caption{{{_caption(answers)}}}",
        rf"  \label{{tab:{''.join(letter if letter.isalnum() else '-' for letter in plan.name)}}}",
        rf"  \begin{{tabular}}{{l{'r' * len(combinations)}}}",
        r"    \toprule",
        _row("", [latex_text(label or plan.case) for label in answers.labels]),
        r"    \midrule",
        _row("flights", [str(int(answers.flown[:, n].sum())) for n in combinations]),
        _row("refused by the checks", [str(int(answers.refused[:, n].sum())) for n in combinations]),
        r"    \midrule",
    ]
    lines += [
        _row(latex_text(title), [_percent_cell(answers.share(title, n)) for n in combinations])
        for title in answers.titles
    ]
    if len(combinations) > 1:
        pairs = [answers.paired(HEADLINE, n) for n in combinations[1:]]
        first = latex_text(answers.labels[0] or plan.case)
        lines += [
            r"    \midrule",
            _row(f"{latex_text(HEADLINE)}: {first} less this, points", ["--", *map(_points_cell, pairs)]),
            _row("McNemar's exact test, $p$", ["--", *(_number(one.p, 2) for one in pairs)]),
        ]
    values = [one for one in answers.measures if np.isfinite(answers.values(one)).any()]
    if values:
        lines.append(r"    \midrule")
    for measure in values:
        cells = []
        for n in combinations:
            found = answers.quantiles(measure, n)
            cells.append("--" if found is None else _estimate_cell(found[1]))
        unit = measure.claim.unit
        lines.append(_row(latex_text(measure.name + (f", {unit}" if unit not in ("", "-") else "")), cells))
    lines += [r"    \bottomrule", r"  \end{tabular}", r"\end{table}"]
    return "\n".join(lines) + "\n"


def _caption(answers: Answers) -> str:
    plan = answers.plan
    text = f"{plan.title.rstrip('.')}. Shares of flights in % with {interval_kind(answers)}; {answers.draws} draws"
    if plan.draws.quantities:
        text += f" ({plan.draws.design}, seed {plan.draws.seed})"
    if any(np.isfinite(answers.values(one)).any() for one in answers.measures):
        text += "; values: median with 95 % interval by order statistics"
    return latex_text(text + ".")


def _row(head: str, cells: list[str]) -> str:
    return f"    {' & '.join([head, *cells])} \\\\"


def _percent_cell(found: Share) -> str:
    if not found.of:
        return "--"
    digits = 1 if found.high - found.low > 0.002 else 2
    return f"{100 * found.value:.{digits}f} [{100 * found.low:.{digits}f}, {100 * found.high:.{digits}f}]"


def _points_cell(found: Paired) -> str:
    if not math.isfinite(found.difference):
        return "--"
    return f"${100 * found.difference:.1f}$ [${100 * found.low:.1f}$, ${100 * found.high:.1f}$]"


def _estimate_cell(found: Estimate) -> str:
    return f"{_number(found.value, 4)} [{_number(found.low, 3)}, {_number(found.high, 3)}]"


def _number(value: float, digits: int) -> str:
    """Return a number as LaTeX, with a power of ten where it has one."""
    if math.isinf(value):
        return r"$\infty$" if value > 0 else r"$-\infty$"
    mantissa, _, exponent = f"{value:.{digits}g}".partition("e")
    return rf"${mantissa} \cdot 10^{{{int(exponent)}}}$" if exponent else f"${mantissa}$"


_SPECIAL = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r"\textquotedbl{}",
    "°": r"\textdegree{}",
    "±": r"$\pm$",
    "·": r"$\cdot$",
    "′": r"$'$",
    "²": r"$^2$",
    "³": r"$^3$",
    "…": r"\ldots{}",
} | {letter: f"\\{letter}" for letter in "&%$#_{}"}


def latex_text(text: str) -> str:
    """Return text with all that is special in LaTeX escaped, and Greek letters as mathematics."""
    return "".join(_SPECIAL.get(letter) or _greek(letter) for letter in text)


def _greek(letter: str) -> str:
    words = unicodedata.name(letter, "").split()
    if words[:1] != ["GREEK"] or len(words) != 4 or words[2] != "LETTER":
        return letter
    name = {"LAMDA": "lambda"}.get(words[3], words[3].lower())
    return f"$\\{name if words[1] == 'SMALL' else name.capitalize()}$"
