"""What runs in a worker: a batch of flights, of a plan that comes with it."""

from __future__ import annotations

import functools
import pickle
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ftcc.groundside.simulation import PlainPython
from ftcc.groundside.studies.flying import Outcome, fly_trial
from ftcc.groundside.studies.plan import StudyPlan
from ftcc.groundside.studies.versions import difference

__all__ = ["OtherVersionError", "fly_batch", "initialize"]

_stop: Any = None
"""Event that ends the flights of this process; None in a process that nobody stops so."""


class OtherVersionError(Exception):
    """A worker runs another version of the program than the one that asks it."""


def initialize(stop: Any) -> None:
    """Prepare a process of the local pool."""
    global _stop
    _stop = stop


def fly_batch(
    plan: bytes, numbers: Sequence[int], versions: dict[str, str], record_in: Path | None = None
) -> list[Outcome]:
    """Fly a batch of trials of a pickled plan.

    Raises
    ------
    OtherVersionError
        If ``versions`` are not those of this program.
    InterruptedError
        If the study was stopped.
    """
    if wrong := difference(versions):
        raise OtherVersionError(wrong)
    whole = _unpickled(plan)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PlainPython)
        return [fly_trial(whole, number, record_in, _raise_if_stopped) for number in numbers]


@functools.lru_cache(maxsize=4)
def _unpickled(plan: bytes) -> StudyPlan:
    return pickle.loads(plan)  # type: ignore[no-any-return]


def _raise_if_stopped(_: float) -> None:
    if _stop is not None and _stop.is_set():
        raise InterruptedError
