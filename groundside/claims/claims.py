"""Claims: numbers that a flight must show, compared with its recording."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ftcc.groundside.claims.expressions import (
    DERIVED,
    Signals,
    check_expression,
    evaluate_expression,
    names_in,
    uavs_in,
    window_of,
)
from ftcc.groundside.claims.metrics import METRICS
from ftcc.groundside.schema import Claim
from ftcc.link.graph import Graph

__all__ = ["Result", "Tolerance", "by_case", "check_claims", "evaluate", "failed", "tolerance_of", "uavs_of"]

_TOLERANCE = re.compile(
    r"^\s*(?P<bound>[<>])?\s*(?P<size>[-+0-9.eE]+)\s*(?P<unit>%|x)?(?:\s+or\s+(?P<least>[-+0-9.eE]+))?\s*$"
)


@dataclass(frozen=True)
class Tolerance:
    """Largest distance of a value from the expected one, or a bound."""

    text: str
    bound: str
    """"<" or ">" for a bound, "" for a band around the expected value."""
    size: float
    unit: str
    """"%": of the expected value; "x" (bounds only): times the expected value; "": as it stands."""
    least: float = 0.0
    """Least half-width of a band in %, in the unit of the value."""

    def allows(self, value: float, expected: float) -> bool:
        """Return whether ``value`` is within the tolerance."""
        if not math.isfinite(value):
            return False
        if self.bound:
            limit = self.size * abs(expected) if self.unit == "x" else self.size
            return value < limit if self.bound == "<" else value > limit
        width = max(self.size / 100.0 * abs(expected), self.least) if self.unit == "%" else self.size
        # Expected values are decimal: the edge of the band belongs to it.
        return abs(value - expected) <= width * (1.0 + 1e-12)


def tolerance_of(text: str) -> Tolerance:
    """Read a tolerance: "15 %", "0.02", "10 % or 0.01" (the larger), "< 0.05", "> 2" or "< 1.5 x".

    Raises
    ------
    ValueError
    """
    found = _TOLERANCE.match(text)
    problem = f'{text!r} is not a tolerance; write "15 %", "0.02", "10 % or 0.01", "< 0.05", "> 2" or "< 1.5 x"'
    if not found:
        raise ValueError(problem)
    try:
        size, least = float(found["size"]), float(found["least"] or 0.0)
    except ValueError:
        raise ValueError(problem) from None
    bound, unit = found["bound"] or "", found["unit"] or ""
    if (unit == "x" and not bound) or (unit == "%" and bound) or (not bound and size < 0.0):
        raise ValueError(problem)
    if least < 0.0 or (found["least"] and unit != "%"):
        raise ValueError(problem)
    return Tolerance(text.strip(), bound, size, unit, least)


@dataclass(frozen=True)
class Result:
    """A claim and the value that the flight shows."""

    claim: Claim
    uavs: tuple[int, ...]
    value: float | list[float] | None
    """None if the flight did not cover the window, or gave no finite number."""
    expected: float | list[float]
    tolerance: str
    ok: bool | None
    """None: the flight did not cover the window."""
    remark: str = ""

    def as_json(self) -> dict[str, Any]:
        """Return the result as ``ftcc report --json`` prints it."""
        return {
            "name": self.claim.name,
            "uavs": list(self.uavs),
            "window": list(self.claim.window),
            "value": self.value,
            "unit": self.claim.unit,
            "expected": self.expected,
            "tolerance": self.tolerance,
            "source": self.claim.source,
            "ok": self.ok,
        }


def by_case(entry: Any, case: str) -> Any:
    """Return an entry's value for ``case``, or its "default"; an entry that is no table holds for all cases."""
    return entry.get(case, entry.get("default")) if isinstance(entry, Mapping) else entry


def uavs_of(claim: Claim, graph: Graph) -> tuple[int, ...]:
    """Return the ids of the UAVs that a claim is about."""
    if isinstance(claim.uavs, str):
        return {"followers": graph.followers, "leaders": graph.leaders, "all": graph.uavs}[claim.uavs]
    return tuple(claim.uavs)


def check_claims(claims: Iterable[Claim], graph: Graph, columns: Sequence[str]) -> list[str]:
    """Return the errors in the claims of a scenario."""
    problems = []
    led = bool(graph.leaders) and set(graph.followers) <= graph.reached_from(graph.leaders)
    for n, claim in enumerate(claims):
        where = f"claims.{n} ({claim.name})"
        if claim.metric not in METRICS:
            problems.append(f"{where}: there is no metric {claim.metric!r}; there are {', '.join(METRICS)}")
            continue
        others: set[int] = set()
        try:
            check_expression(claim.signal, columns)
        except ValueError as error:
            problems.append(f"{where}: signal {error}")
        else:
            if names_in(claim.signal) & set(DERIVED) and not led:
                problems.append(f"{where}: signal {claim.signal!r} needs leaders that reach every follower")
            others = uavs_in(claim.signal)
        unknown = sorted((set(uavs_of(claim, graph)) | others) - set(graph.uavs))
        if unknown:
            problems.append(f"{where}: uavs {', '.join(map(str, unknown))} do not exist")
        for case, expected in claim.expected.items():
            tolerance = by_case(claim.tolerance, case)
            if tolerance is None:
                problems.append(f"{where}: no tolerance for case {case!r}")
            else:
                try:
                    tolerance_of(tolerance)
                except ValueError as error:
                    problems.append(f"{where}: {error}")
            if METRICS[claim.metric].threshold and by_case(claim.threshold, case) is None:
                problems.append(f"{where}: metric {claim.metric} needs a threshold in case {case!r}")
            if isinstance(expected, list) and len(expected) != len(uavs_of(claim, graph)):
                problems.append(f"{where}: expected has {len(expected)} values for {len(uavs_of(claim, graph))} UAVs")
    return problems


def evaluate(
    signals: Signals, claims: Iterable[Claim], case: str, graph: Graph, duration: float = math.inf
) -> list[Result]:
    """Compare all claims of ``case`` with the recording of a flight of ``duration`` seconds.

    A window is covered if the recording of any UAV reaches its end. A claim about a UAV that was lost before that time
    fails, unless its metric is also defined for a lost UAV.
    """
    end = max(
        (float(signals.column("t", uav)[-1]) for uav in signals.uavs if len(signals.column("t", uav))), default=-1.0
    )
    return [_evaluate_claim(signals, claim, case, graph, end, duration) for claim in claims if case in claim.expected]


def failed(results: Iterable[Result]) -> list[Result]:
    """Return the results of claims that do not hold."""
    return [result for result in results if result.ok is False]


def _evaluate_claim(signals: Signals, claim: Claim, case: str, graph: Graph, end: float, duration: float) -> Result:
    uavs = uavs_of(claim, graph)
    expected = claim.expected[case]
    tolerance = tolerance_of(by_case(claim.tolerance, case))

    def result(value: float | list[float] | None, ok: bool | None, remark: str = "") -> Result:
        return Result(claim, uavs, value, expected, tolerance.text, ok, remark)

    metric = METRICS[claim.metric]
    if claim.window[1] > (duration if metric.survives_loss else end) + 1e-6:
        return result(None, None, "not flown")
    threshold = float(by_case(claim.threshold, case) or 0.0)
    values = []
    for uav in uavs:
        t = signals.column("t", uav)
        if len(t) == 0 or (t[-1] < claim.window[1] - 1e-6 and not metric.survives_loss):
            return result(None, False, f"UAV {uav} was lost")
        parts = claim.within or [claim.window]
        rows = np.concatenate([np.arange(len(t))[window_of(t, part)] for part in parts])
        x = evaluate_expression(claim.signal, signals, graph, uav)[rows]
        if len(x) == 0:
            return result(None, None, "no row in the window")
        values.append(metric.function(t[rows], x, threshold))
    if isinstance(expected, list):
        pairs = list(zip(values, expected, strict=True))
        return result(
            [float(value) for value in values] if np.isfinite(values).all() else None,
            all(tolerance.allows(value, wanted) for value, wanted in pairs),
        )
    if not np.isfinite(values).all():
        return result(None, False, "never" if metric.threshold else "not a number")
    if metric.across == "farthest":
        value = max(values, key=lambda one: abs(one - expected))
    else:
        value = max(values) if metric.across == "max" else min(values)
    return result(float(value), tolerance.allows(value, expected))
