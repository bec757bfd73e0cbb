"""Fly one trial of a study, and keep what the study's table needs of it."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ftcc.groundside.claims import evaluate, tolerance_of
from ftcc.groundside.results import Run
from ftcc.groundside.scenario import Mission
from ftcc.groundside.simulation import Flight, LawError, columns_needed, fly_in_memory, simulate
from ftcc.groundside.studies.diagnosed import diagnosed
from ftcc.groundside.studies.plan import StudyPlan
from ftcc.groundside.verdict import Verdict, columns_diagnosed

__all__ = ["Outcome", "fly_trial", "mission_of_row", "run_folder"]


@dataclass(frozen=True)
class Outcome:
    """Result of one flight of a study."""

    number: int
    """Of the flight."""
    drawn: tuple[Any, ...] = ()
    """Value of each random quantity."""
    values: tuple[float | list[float] | None, ...] = ()
    """Value of each claim and of what diagnosis is asked; empty if it did not fly."""
    holds: tuple[bool | None, ...] = ()
    """Whether each of them holds; None if that cannot be said. Empty if it did not fly."""
    lost: tuple[int, ...] = ()
    """Lost UAVs."""
    verdict: str | None = None
    """How the flight went; None if it did not fly."""
    largest: float | None = None
    """Largest value of the scheme's first tracking error."""
    end_margin: float | None = None
    """Smallest 1 - end / allowed of the scheme's tracking errors, see ``verdict``; None: none is limited."""
    refused: bool = False
    """Whether the checks of scenarios refused it."""
    error: str = ""
    """Why it did not fly, or not to its end, and the lost UAVs; empty if all went well."""
    wall: float = 0.0
    """Wall time, s."""

    @property
    def flew(self) -> bool:
        """Return whether there is a flight to judge."""
        return self.verdict is not None


def run_folder(folder: Path, number: int) -> Path:
    """Return the folder of a flight's recording."""
    return folder / "runs" / f"{number:04d}"


def mission_of_row(plan: StudyPlan, number: int) -> Mission:
    """Return the mission of one flight of a study, with the study's claims.

    Raises
    ------
    ScenarioError
        If the study draws a flight that cannot fly.
    """
    from ftcc.groundside.scenario import resolve

    trial = plan.trial(number)
    values, _, _ = plan.drawn(trial)
    case = plan.case_of(trial.combination)
    claims = [
        {**claim.model_dump(by_alias=True, exclude_none=True), "expected": {case: claim.expected[plan.case]}}
        for claim in plan.claims
    ]
    return resolve(plan.scenario(trial.combination, values, trial.seed, claims))


def fly_trial(
    plan: StudyPlan, number: int, record_in: Path | None = None, progress: Callable[[float], None] | None = None
) -> Outcome:
    """Fly one trial; an error becomes part of its outcome.

    Parameters
    ----------
    plan : StudyPlan
    number : int
        Number of the flight.
    record_in : Path, optional
        The study's folder, where the flight is recorded; default: no recording.
    progress : callable, optional
        Called with the simulated time, s; what it raises as `InterruptedError` ends the flight and is raised here.
    """
    begun = time.perf_counter()
    trial = plan.trial(number)
    drawn, mission, problem = plan.drawn(trial)
    if mission is None:
        return Outcome(number, drawn, refused=True, error=problem, wall=time.perf_counter() - begun)
    try:
        outcome = _flown(plan, number, mission, record_in, progress)
    except InterruptedError:
        raise
    except LawError as error:
        return Outcome(number, drawn, error=str(error), wall=time.perf_counter() - begun)
    except Exception as error:  # a failed flight is a row of the table and must not end the study
        where = traceback.extract_tb(error.__traceback__)[-1]
        text = f"{type(error).__name__}: {error} ({Path(where.filename).name}:{where.lineno})"
        return Outcome(number, drawn, error=text, wall=time.perf_counter() - begun)
    return replace(outcome, drawn=drawn, wall=time.perf_counter() - begun)


def _flown(
    plan: StudyPlan,
    number: int,
    mission: Mission,
    record_in: Path | None,
    progress: Callable[[float], None] | None,
) -> Outcome:
    asked = replace(mission, claims=plan.claims)
    flight: Flight | Run = (
        fly_in_memory(mission, progress, columns=columns_needed(asked) | columns_diagnosed(mission))
        if record_in is None
        else simulate(mission, run_folder(record_in, number), progress)
    )
    results = evaluate(flight, plan.claims, plan.case, mission.graph)
    own = plan.is_own_case(mission)
    numbers, found = diagnosed(flight) if len(plan.asked) > len(plan.claims) else ((), ())
    verdict = flight.verdict
    lost = [f"UAV {uav} lost at {t:g} s: {why}" for uav, (t, why) in flight.lost.items()]
    return Outcome(
        number,
        values=(*(result.value for result in results), *numbers),
        holds=(*(_holds(result, own) for result in results), *found),
        lost=tuple(sorted(flight.lost)),
        verdict=verdict.word,
        largest=verdict.tracking[0].largest if verdict.tracking else None,
        end_margin=_end_margin(verdict),
        error="; ".join(lost),
    )


def _end_margin(verdict: Verdict) -> float | None:
    """Return the smallest 1 - end/allowed of the scheme's tracking errors; None if none is limited."""
    margins = [1.0 - one.end / one.allowed for one in verdict.tracking if one.end is not None and one.allowed]
    return min(margins, default=None)


def _holds(result: Any, own_case: bool) -> bool | None:
    """Return whether a claim holds; None if the claim does not apply.

    A band around an expected number applies only to the scenario's case; with other settings the number is a result,
    not a failure. A bound applies to every flight. A claim also fails if its UAV was lost, or if the event that it
    times did not occur.
    """
    if own_case or tolerance_of(result.tolerance).bound or (result.ok is False and result.value is None):
        return result.ok  # type: ignore[no-any-return]
    return None
