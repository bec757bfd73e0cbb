"""Fly a study into a folder, from the beginning or from where it ended."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ftcc.groundside.errors import UserError
from ftcc.groundside.results import lock_until_exit, new_folder
from ftcc.groundside.statistics import LOST, Share, Until, share, until_of
from ftcc.groundside.studies.engine import Engine, catch_ctrl_c, fly_all, local_engine
from ftcc.groundside.studies.errors import StudyError
from ftcc.groundside.studies.flying import Outcome
from ftcc.groundside.studies.folder import check_same, is_study, load_plan, save_plan
from ftcc.groundside.studies.measures import titles_of
from ftcc.groundside.studies.plan import StudyPlan
from ftcc.groundside.studies.planning import plan_study
from ftcc.groundside.studies.results import Study
from ftcc.groundside.studies.rows import Dataset, write_table
from ftcc.groundside.verdict import FAILED

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = [
    "WITHOUT_END",
    "Progress",
    "engine_for",
    "fly_study",
    "larger",
    "nothing_left_of_a_refusal",
    "open_folder",
    "study",
]

_APPEND = 2.0
"""Wall time between two files of the dataset, s."""
WITHOUT_END = 1_000_000
"""Draws after which a study with ``until`` ends at last."""


@dataclass(frozen=True)
class Progress:
    """How far a study is."""

    flown: int
    """Flights whose rows there are."""
    of: int
    rate: float
    """Flights a second since the study began or went on; 0 at the beginning."""
    answer: Share
    """Of the headline, in the first combination."""
    refused: int
    broken: int
    """Flights that ended with an error, or lost aircraft."""


def study(
    name: str | Path,
    vary: Sequence[str] | Mapping[str, Sequence[Any]] = (),
    *,
    folder: str | Path | None = None,
    jobs: int | None = None,
    cluster: str | None = None,
    until: str | None = None,
    record: bool = False,
    **options: Any,
) -> Study:
    """Fly a study and return it.

    Parameters
    ----------
    name, vary, options
        See `plan_study`.
    folder : path, optional
        Default: a new one in ``studies``.
    jobs : int, optional
        Number of processes; default: one per core.
    cluster : str, optional
        Address of a Dask scheduler, or "local:N", instead of processes.
    until : str, optional
        When to stop, see `statistics.until_of`; ``samples`` is then the most draws.
    record : bool
        Whether every flight is recorded.

    Raises
    ------
    StudyError, ScenarioError
    """
    if until is not None:
        options.setdefault("samples", WITHOUT_END)
    plan = plan_study(name, vary, **options)
    rule = until_of(until) if until is not None else None
    place = open_folder(plan, folder)
    if not fly_study(plan, place, jobs=jobs, cluster=cluster, until=rule, record=record):
        raise KeyboardInterrupt
    return Study(place)


def open_folder(plan: StudyPlan, out: str | Path | None, resume: bool = False) -> Path:
    """Return the folder of a study, created or, with ``resume``, the one where it was begun.

    Raises
    ------
    StudyError
        If there is nothing to go on with, or another study.
    RunError
        If the folder cannot be written or is taken.
    """
    if not resume:
        place = new_folder(plan.name, out, "studies")
    elif out is None or not is_study(out):
        raise StudyError(f"--resume: {out or 'no folder given'}: holds no study to go on with")
    else:
        place = Path(out)
        check_same(plan, place)
        lock_until_exit(place)
        larger(load_plan(place), plan.draws.samples)
    return place


@contextlib.contextmanager
def nothing_left_of_a_refusal(folder: Path) -> Iterator[None]:
    """Remove the new, still empty folder of a study that cannot begin."""
    try:
        yield
    except UserError:
        with contextlib.suppress(OSError):
            folder.rmdir()
        raise


def fly_study(
    plan: StudyPlan,
    folder: Path,
    *,
    jobs: int | None = None,
    cluster: str | None = None,
    until: Until | None = None,
    record: bool = False,
    report: Callable[[Progress], None] = lambda _: None,
) -> bool:
    """Fly all flights of a study that its folder does not have yet; write its table.

    Parameters
    ----------
    plan, folder
        See `open_folder`.
    jobs, cluster, until, record
        See `study`.
    report : callable, optional
        Called whenever flights have landed.

    Returns
    -------
    bool
        False if Ctrl-C interrupted it: `open_folder` with ``resume`` goes on.
    """
    if cluster is not None and record:
        with nothing_left_of_a_refusal(folder):
            raise StudyError("--record: workers of a cluster may share no folder; record single flights with --row")
    dataset = Dataset(plan, folder)
    complete = False
    with nothing_left_of_a_refusal(folder):
        flight = _Landed(plan, dataset, until, report)
        engine = None if flight.enough else engine_for(plan, jobs, cluster, folder if record else None, flight.missing)
        save_plan(plan, folder)
    if engine is not None:
        try:
            with catch_ctrl_c() as raise_if_interrupted:
                engine.prepare(plan)
                raise_if_interrupted()
                flight.begin()
                fly_all(plan, flight.numbers(), engine, flight.land, raise_if_interrupted)
                complete = True
        except KeyboardInterrupt:
            complete = False
        finally:
            flight.flush()
            engine.close()
    table = dataset.read()
    if flight.stop_at is not None:
        table = table.slice(0, _rows_before(table, flight.stop_at * len(plan.combinations)))
    if len(table):
        write_table(table, folder)
    return complete or flight.enough


def _rows_before(table: pa.Table, number: int) -> int:
    import numpy as np

    return int(np.searchsorted(table.column("flight").to_numpy(), number))


def engine_for(plan: StudyPlan, jobs: int | None, cluster: str | None, record_in: Path | None, flights: int) -> Engine:
    """Return the cluster at this address, or else so many processes, one per core by default."""
    if cluster is not None:
        from ftcc.groundside.studies.cluster import Cluster

        return Cluster(cluster)
    return local_engine(jobs or _cores(), flights, record_in)


def _cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class _Landed:
    """The flights that have landed: what is written, what is missing, and whether they are enough."""

    def __init__(
        self, plan: StudyPlan, dataset: Dataset, until: Until | None, report: Callable[[Progress], None]
    ) -> None:
        self.plan = plan
        self.stop_at: int | None = None
        """Number of draws that were enough."""
        self._dataset = dataset
        self._report = report
        self._until = until
        self._yes: dict[int, bool | None] = {}
        """By flight, whether the answer that ``until`` asks for is yes; None: refused, or not judged."""
        self._headline = [0, 0]
        self._refused = self._broken = 0
        self._pending: list[Outcome] = []
        self._begun = self._written = time.monotonic()
        self._before = 0
        self._looks = until.looks() if until else iter(())
        self._next_look = next(self._looks, None)
        self._look = 1
        self._prefix = 0
        """Flights from 0 on of which none is missing."""
        self._claim = self._place_of_claim()
        for outcome in _as_outcomes(plan, dataset.read()):
            self._note(outcome)
        self.enough = self._is_enough() or not self.missing

    def _place_of_claim(self) -> int | None:
        wanted = self._until.claim if self._until else None
        if wanted in (None, LOST):
            return None
        titles = titles_of(self.plan.asked)
        if wanted not in titles:
            there_are = f"there are {', '.join(titles)}" if titles else "this study has none"
            raise StudyError(f"--until: there is no claim {wanted!r} in this case; {there_are}")
        return titles.index(str(wanted))

    @property
    def missing(self) -> int:
        """Return the number of flights that have not landed."""
        return self.plan.count - len(self._yes)

    def numbers(self) -> Iterator[int]:
        """Yield the flights that are missing, in order."""
        there = frozenset(self._yes)
        return (number for number in range(self.plan.count) if number not in there)

    def begin(self) -> None:
        """Begin to count flights a second."""
        self._begun = time.monotonic()
        self._before = len(self._yes)
        self._show()

    def land(self, outcomes: list[Outcome]) -> bool:
        """Note outcomes, write them now and then; return whether they are enough."""
        for outcome in outcomes:
            self._note(outcome)
        self._pending += outcomes
        if time.monotonic() - self._written > _APPEND:
            self.flush()
        if outcomes:
            self._show()
        self.enough = self._is_enough()
        return self.enough

    def flush(self) -> None:
        """Write what has landed since the last time."""
        self._dataset.append(self._pending)
        self._pending = []
        self._written = time.monotonic()

    def _note(self, outcome: Outcome) -> None:
        self._yes[outcome.number] = self._answer(outcome)
        self._refused += outcome.refused
        self._broken += bool(outcome.error) and not outcome.refused
        if not outcome.refused and outcome.number % len(self.plan.combinations) == 0:
            self._headline[0] += _succeeded(outcome, len(self.plan.claims))
            self._headline[1] += 1

    def _answer(self, outcome: Outcome) -> bool | None:
        if outcome.refused:
            return None
        if self._claim is not None:
            return outcome.holds[self._claim] if outcome.holds else False
        if self._until and self._until.claim == LOST:
            return bool(outcome.lost) or not outcome.flew
        return _succeeded(outcome, len(self.plan.claims))

    def _is_enough(self) -> bool:
        """Look at the answer where all flights of a round number of draws have landed, in any order."""
        if self._until is None:
            return False
        combinations = len(self.plan.combinations)
        while self._prefix in self._yes:
            self._prefix += 1
        while self._next_look is not None and self._prefix >= self._next_look * combinations:
            answers = [self._yes[n] for n in range(0, self._next_look * combinations, combinations)]
            known = [one for one in answers if one is not None]
            if known and self._until.reached(sum(known), len(known), self._look):
                self.stop_at = self._next_look
                return True
            self._next_look = next(self._looks, None)
            self._look += 1
        return False

    def _show(self) -> None:
        seconds = time.monotonic() - self._begun
        flown = len(self._yes)
        rate = (flown - self._before) / seconds if flown > self._before and seconds > 0.0 else 0.0
        answer = share(*self._headline)
        self._report(Progress(flown, self.plan.count, rate, answer, self._refused, self._broken))


def _succeeded(outcome: Outcome, claims: int) -> bool:
    """Return the headline of one flight with so many claims, as `Answers` does from the table."""
    if not outcome.flew:
        return False
    judged = [one for one in outcome.holds[:claims] if one is not None]
    return not outcome.lost and all(judged) if judged else outcome.verdict != FAILED


def _as_outcomes(plan: StudyPlan, table: pa.Table) -> Iterable[Outcome]:
    """Yield what the table says of each flight, as far as it is needed to go on."""
    titles = titles_of(plan.asked)
    columns = ["flight", "lost", "verdict", "refused", "error", *(f"{title} holds" for title in titles)]
    for row in table.select(columns).to_pylist():
        yield Outcome(
            row["flight"],
            holds=tuple(row[f"{title} holds"] for title in titles) if row["verdict"] is not None else (),
            lost=tuple(row["lost"] or ()),
            verdict=row["verdict"],
            refused=row["refused"],
            error=row["error"] or "",
        )


def larger(plan: StudyPlan, samples: int) -> StudyPlan:
    """Return the same study with another number of draws.

    Raises
    ------
    StudyError
        For a Latin hypercube, which is drawn for its number of samples.
    """
    if plan.draws.design == "lhs" and samples != plan.draws.samples:
        raise StudyError("--samples: a Latin hypercube is drawn for its number of samples, and cannot change it")
    return replace(plan, draws=replace(plan.draws, samples=samples))
