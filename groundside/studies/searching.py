"""Fly a search into a folder, and say what it found."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ftcc.groundside.statistics import upper_bound
from ftcc.groundside.studies.campaign import engine_for, nothing_left_of_a_refusal
from ftcc.groundside.studies.engine import Engine, catch_ctrl_c, fly_all
from ftcc.groundside.studies.flying import Outcome
from ftcc.groundside.studies.search import Flown, SearchPlan, flights_of, toml_of
from ftcc.groundside.studies.search_record import Record, save_search
from ftcc.groundside.studies.search_sampler import GENERATION

__all__ = ["WORST", "Found", "fly_search"]

WORST = "worst.toml"


@dataclass(frozen=True)
class Found:
    """What a search found."""

    search: SearchPlan
    flights: tuple[Flown, ...]
    """All, by number."""
    bracket: float | None
    """How far, on the line to the scenario's own values, the mildest failing flight is from one that holds."""

    @property
    def failing(self) -> list[Flown]:
        """Return the flights that fail, the mildest first."""
        return sorted((one for one in self.flights if one.fails), key=lambda one: (one.distance, one.number))

    @property
    def worst(self) -> Flown | None:
        """Return the mildest flight that fails, or else the one with the smallest margin; None: none has one."""
        if self.failing:
            return self.failing[0]
        judged = [one for one in self.flights if one.margin is not None]
        return min(judged, key=lambda one: (one.margin, one.number), default=None)

    def sentences(self) -> list[str]:
        """Return what was found, and what was covered."""
        return [self._found(), *self._changes(), self._covered()]

    def _found(self) -> str:
        goal, worst, many = self.search.goal, self.worst, len(self.failing)
        if worst is None:
            return f"'{goal}': no flight could be judged"
        if not many:
            margin = f"the smallest margin is {worst.margin:.3g} (flight {worst.number}, distance {worst.distance:.3g})"
            return f"'{goal}' failed in no flight; {margin}"
        if worst.number == 0:
            return f"'{goal}' fails at the scenario's own values: there is nothing milder to look for"
        lost = f", with UAV {', '.join(map(str, worst.outcome.lost))} lost" if worst.outcome.lost else ""
        met = (
            ""
            if self.bracket is None
            else f"; on the line to the scenario's own values it holds {self.bracket:.2g} nearer"
        )
        return f"'{goal}' fails at a distance of {worst.distance:.4g} (flight {worst.number}{lost}){met}"

    def _changes(self) -> list[str]:
        if self.worst is None or self.worst.number == 0:
            return []
        search = self.search
        rows = zip(search.quantities, search.draws.own, search.stated, self.worst.values, strict=True)
        return [
            f"  {one.key} = {_text(value)}, instead of {_text(own)}{'' if stated else ' (the median)'}"
            for one, own, stated, value in rows
        ]

    def _covered(self) -> str:
        search = self.search
        judged = [one for one in self.flights if one.fails is not None]
        asked = [one for one in self.flights if one.stage == "search"]
        n, d = len(self.flights), len(search.quantities)
        text = f"{n} flights in {d} dimension{'s' if d > 1 else ''}, {len(self.failing)} failing"
        refused = sum(one.outcome.refused for one in self.flights)
        broken = n - len(judged) - refused
        text += f", {refused} that cannot fly" if refused else ""
        text += f", {broken} that ended with an error" if broken else ""
        if asked:
            gap, key = max((_gap([one.point[k] for one in asked]), one.key) for k, one in enumerate(search.quantities))
            text += f"; each quantity alone was covered but for gaps of {100 * gap:.0f} % of its distribution ({key})"
        if not self.failing and judged:
            bound = 100.0 * upper_bound(0, len(judged))
            text += (
                f". With independent draws this would bound the failing share below {bound:.2g} % at 95 %;"
                f" the draws of a search depend on each other, so it is no bound"
            )
        return f"{text}. A search can miss what it did not fly: a milder failure may exist."


def _gap(points: Sequence[float]) -> float:
    """Return the largest part of [0, 1] without a point."""
    return float(np.diff([0.0, *sorted(points), 1.0]).max())


def _text(value: Any) -> str:
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def fly_search(
    search: SearchPlan,
    folder: Path,
    *,
    jobs: int | None = None,
    cluster: str | None = None,
    engine: Engine | None = None,
    report: Callable[[Sequence[Flown]], None] = lambda _: None,
) -> Found | None:
    """Fly all flights of a search that its folder does not have yet; write its table, and its worst flight.

    Parameters
    ----------
    search, folder
        See `open_search_folder`.
    jobs, cluster
        See `campaign.study`.
    engine : Engine, optional
        Instead of both.
    report : callable, optional
        Called with the flights that have landed, whenever some have.

    Returns
    -------
    Found or None
        None if Ctrl-C interrupted it.
    """
    with nothing_left_of_a_refusal(folder):
        engine = engine or engine_for(search.study, jobs, cluster, None, GENERATION)
    save_search(search, folder)
    record = Record(search, folder)
    flight = _Flight(search, record, engine, report)
    try:
        with catch_ctrl_c() as raise_if_interrupted:
            engine.prepare(search.study)
            flight.raise_if_interrupted = raise_if_interrupted
            raise_if_interrupted()
            flights, bracket = flights_of(search, flight.fly)
    except KeyboardInterrupt:
        return None
    finally:
        engine.close()
        record.flush()
    found = Found(search, tuple(flights), bracket)
    record.write(found.flights)
    if found.worst is not None:
        for name, text in search.study.files:
            (folder / name).write_text(text, encoding="utf-8")
        (folder / WORST).write_text(toml_of(search, found.worst), encoding="utf-8")
    return found


class _Flight:
    """Flies what is asked for, unless it has flown before."""

    def __init__(
        self, search: SearchPlan, record: Record, engine: Engine, report: Callable[[Sequence[Flown]], None]
    ) -> None:
        self._engine = engine
        self.raise_if_interrupted: Callable[[], None] = lambda: None
        self._search = search
        self._record = record
        self._report = report
        self._known = record.read()
        self._landed: list[Flown] = []

    def fly(
        self, first: int, stage: str, points: Sequence[tuple[float, ...]], rows: Sequence[tuple[Any, ...]]
    ) -> list[Flown]:
        """Return flights from number ``first`` on, in their order."""
        search, there = self._search, dict[int, Flown]()
        for number, point, row in zip(range(first, first + len(rows)), points, rows, strict=True):
            if number in self._known:
                there[number] = self._record.flown(self._known[number], stage, point, row)
        self._landed += there.values()

        def land(outcomes: list[Outcome]) -> bool:
            new = []
            for one in outcomes:
                place = one.number - first
                outcome = replace(one, drawn=rows[place], wall=0.0)
                new.append(search.judge(stage, points[place], rows[place], outcome))
            there.update((one.number, one) for one in new)
            self._landed += new
            self._record.add(new)
            self._report(self._landed)
            return False

        plan = replace(search.study, draws=replace(search.draws, first=first, rows=tuple(rows)))
        missing = [number for number in range(first, first + len(rows)) if number not in there]
        if missing:
            fly_all(plan, iter(missing), self._engine, land, self.raise_if_interrupted)
            self._record.flush()
        self._report(self._landed)
        return [there[number] for number in range(first, first + len(rows))]
