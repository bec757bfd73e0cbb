"""The numbers that each flight of a study gives: the values of its claims."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ftcc.groundside.claims import Tolerance, tolerance_of, uavs_of
from ftcc.groundside.schema import Claim
from ftcc.groundside.studies.plan import StudyPlan

__all__ = ["Measure", "measures_of", "titles_of"]


@dataclass(frozen=True)
class Measure:
    """A number that every flight has: the value of a claim, or of one UAV if each has its own."""

    name: str
    title: str
    """Title of its claim."""
    claim: Claim
    place: int
    """Index of the claim."""
    part: int | None
    """Index into the claim's UAVs."""
    expected: float
    """Expected value in the scenario's case."""
    tolerance: Tolerance

    def of(self, values: Sequence[Any]) -> float | None:
        """Return the number from a flight's value of each claim; None if it has none."""
        value = values[self.place] if values else None
        return value[self.part or 0] if isinstance(value, list) else value

    @property
    def limit(self) -> float:
        """Return the bound, in the unit of the value; nan for a band around an expected value."""
        if not self.tolerance.bound:
            return math.nan
        return self.tolerance.size * (abs(self.expected) if self.tolerance.unit == "x" else 1.0)

    def margin(self, value: float | None) -> float:
        """Return how far a value is from what the claim allows, as a share of that; < 0: the claim fails.

        Of a bound b: 1 - value/b for "< b", value/b - 1 for "> b", the plain distance where b = 0. Of a band: one minus
        the distance from the expected value over the half-width. -inf: there is no value, the aircraft was lost.
        """
        if value is None or not math.isfinite(value):
            return -math.inf
        if self.tolerance.bound:
            distance = self.limit - value if self.tolerance.bound == "<" else value - self.limit
            return distance / (abs(self.limit) or 1.0)
        width = self.tolerance.size
        if self.tolerance.unit == "%":
            width = max(width / 100.0 * abs(self.expected), self.tolerance.least)
        return 1.0 - abs(value - self.expected) / (width or 1.0)


def measures_of(plan: StudyPlan) -> list[Measure]:
    """Return the numbers that a study asks for, in the order of ``plan.asked``."""
    found: list[Measure] = []
    for place, (claim, title) in enumerate(zip(plan.asked, titles_of(plan.asked), strict=True)):
        expected = claim.expected[plan.case]
        tolerance = tolerance_of(str(claim.tolerance))
        if isinstance(expected, list):
            for part, (uav, one) in enumerate(zip(uavs_of(claim, plan.mission.graph), expected, strict=True)):
                found.append(Measure(f"{title}, UAV {uav}", title, claim, place, part, one, tolerance))
        else:
            found.append(Measure(title, title, claim, place, None, expected, tolerance))
    return found


def titles_of(claims: Sequence[Claim]) -> list[str]:
    """Return a title for each claim, none twice."""
    titles: list[str] = []
    for claim in claims:
        title = claim.name
        while title in titles:
            title = f"{title}, again"
        titles.append(title)
    return titles
