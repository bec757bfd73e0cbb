"""Fly a study on all cores: each process loads the compiled law once, then flies one trial after another.

With one job, or if the system provides no semaphores (in ``/dev/shm``), all trials fly in this process.
"""

from __future__ import annotations

import collections
import contextlib
import dataclasses
import functools
import multiprocessing
import os
import signal
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from ftcc.groundside.claims import Result, evaluate
from ftcc.groundside.results import Run
from ftcc.groundside.simulation import Flight, PlainPython, fly_in_memory, simulate
from ftcc.groundside.study.plan import Study, Trial
from ftcc.groundside.swarm import no_main_module
from ftcc.groundside.verdict import Verdict

__all__ = ["Outcome", "fly_all", "run_folder"]

_ONE_THREAD = ("NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")


@dataclass(frozen=True)
class Outcome:
    """Result of one flight of a study."""

    trial: Trial
    results: tuple[Result, ...]
    """Results of the claims of the scenario's case; empty if it did not fly."""
    lost: dict[int, tuple[float, str]]
    """Time (s) and reason of each lost UAV."""
    wall: float
    """Wall time of the flight, s."""
    problem: str
    """Why the trial did not fly, or not to its end; empty if it did."""
    verdict: Verdict | None = None
    """None if it did not fly."""

    @property
    def error(self) -> str:
        """Return the problem, or the lost UAVs, as text; empty if there are none."""
        lost = [f"UAV {uav} lost at {t:g} s: {why}" for uav, (t, why) in self.lost.items()]
        return "; ".join([self.problem] if self.problem else lost)


class _Task(NamedTuple):
    """What a process needs to fly trials."""

    study: Study
    record_in: Path | None
    stop: Any
    """Event that ends a flight; None in the process that handles Ctrl-C itself."""


class _StoppedError(Exception):
    """The study has been interrupted."""


def run_folder(folder: Path, trial: Trial) -> Path:
    """Return the folder of a trial's recording."""
    return folder / "runs" / f"{trial.number:04d}"


def fly_all(
    study: Study,
    jobs: int,
    report: Callable[[Outcome], None],
    record_in: Path | None = None,
    ready: Callable[[], None] | None = None,
) -> bool:
    """Fly all trials of a study.

    Parameters
    ----------
    study : Study
    jobs : int
        Number of processes; 1: only this one, which ends if a trial crashes.
    report : callable
        Called with each outcome when it is ready, in no particular order.
    record_in : Path, optional
        The study's folder, where every flight is recorded; default: no recordings.
    ready : callable, optional
        Called once when the law is compiled.

    Returns
    -------
    bool
        False if Ctrl-C interrupted the study.
    """
    trials = collections.deque(study.trials)
    jobs = min(jobs, len(trials))
    stop = _new_stop_event() if jobs > 1 else None
    try:
        with _catch_ctrl_c() as raise_if_interrupted:
            # Compile once here; otherwise every process would compile at the same time.
            timing = study.mission.timing._replace(ticks=0)
            fly_in_memory(dataclasses.replace(study.mission, timing=timing))
            raise_if_interrupted()
            if ready is not None:
                ready()
            if stop is None:
                _fly_here(_Task(study, record_in, None), trials, report, raise_if_interrupted)
            else:
                _fly_in_pools(_Task(study, record_in, stop), trials, jobs, report, raise_if_interrupted)
            return True
    except KeyboardInterrupt:
        return False
    finally:
        if stop is not None:
            stop.set()


def _new_stop_event() -> Any:
    """Return an event that stops the processes; None, with a warning, if the system provides no semaphores."""
    try:
        return multiprocessing.get_context("spawn").Event()
    except (OSError, ImportError) as error:
        why = getattr(error, "strerror", None) or error
        text = f"cannot use several processes ({why}; their semaphores need /dev/shm): all flights run in this one"
        warnings.warn(text, RuntimeWarning, stacklevel=3)
        return None


def _fly_here(
    task: _Task,
    trials: collections.deque[Trial],
    report: Callable[[Outcome], None],
    raise_if_interrupted: Callable[[], None],
) -> None:
    """Fly the trials one after the other in this process."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PlainPython)
        while trials:
            outcome = _fly_trial(task, trials.popleft())
            raise_if_interrupted()  # discard a flight that Ctrl-C has interrupted
            report(outcome)


def _fly_in_pools(
    task: _Task,
    trials: collections.deque[Trial],
    jobs: int,
    report: Callable[[Outcome], None],
    raise_if_interrupted: Callable[[], None],
) -> None:
    """Fly the trials in ``jobs`` processes."""
    context = multiprocessing.get_context("spawn")
    pool_of = functools.partial(
        ProcessPoolExecutor, mp_context=context, initializer=_initialize_worker, initargs=(task,)
    )
    while trials:
        for trial in _fly_in_pool(pool_of(jobs), trials, jobs, report, raise_if_interrupted):
            # A process died. To find the trial that caused it, fly each of the trials in flight alone.
            for dead in _fly_in_pool(pool_of(1), collections.deque([trial]), 1, report, raise_if_interrupted):
                report(Outcome(dead, (), {}, 0.0, "its process died"))


@contextlib.contextmanager
def _catch_ctrl_c() -> Iterator[Callable[[], None]]:
    """Yield a function that raises KeyboardInterrupt if Ctrl-C was pressed before.

    Python drops the exception if it is raised in a destructor, and an interrupted flight only ends early. Outside of
    the main thread signals cannot be handled.
    """
    came = False

    def interrupt(*_: object) -> None:
        nonlocal came
        came = True
        raise KeyboardInterrupt

    def raise_if_interrupted() -> None:
        if came:
            raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield raise_if_interrupted
        return
    before = signal.signal(signal.SIGINT, interrupt)
    try:
        yield raise_if_interrupted
    finally:
        signal.signal(signal.SIGINT, before)


def _fly_in_pool(
    pool: ProcessPoolExecutor,
    trials: collections.deque[Trial],
    jobs: int,
    report: Callable[[Outcome], None],
    raise_if_interrupted: Callable[[], None],
) -> list[Trial]:
    """Fly the trials until none is left or a process dies; return the trials in flight at that time."""
    flying: dict[Future[Outcome], Trial] = {}
    try:
        while trials or flying:
            while trials and len(flying) < jobs:
                flying[_submit(pool, trials[0])] = trials[0]
                trials.popleft()
            done, _ = wait(flying, return_when=FIRST_COMPLETED)
            raise_if_interrupted()
            for future in done:
                outcome = future.result()
                del flying[future]
                report(outcome)
    except BrokenProcessPool:
        return [*flying.values()]
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
    return []


def _submit(pool: ProcessPoolExecutor, trial: Trial) -> Future[Outcome]:
    """Submit a trial; a process started for it does not import the program that started this one."""
    with no_main_module(), _single_threaded(), _block_ctrl_c():
        return pool.submit(_fly_in_worker, trial)


@contextlib.contextmanager
def _single_threaded() -> Iterator[None]:
    """Make processes that are started meanwhile use one thread each, because flights run in parallel."""
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextlib.contextmanager
def _block_ctrl_c() -> Iterator[None]:
    """Make processes that are started meanwhile leave Ctrl-C to this one, from their first instruction.

    They inherit that SIGINT is blocked. Here a blocked SIGINT stays pending; an ignored one would be lost.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


# In the worker processes.

_task: _Task


def _initialize_worker(task: _Task) -> None:
    global _task
    _task = task
    warnings.simplefilter("ignore", PlainPython)


def _fly_in_worker(trial: Trial) -> Outcome:
    return _fly_trial(_task, trial)


def _fly_trial(task: _Task, trial: Trial) -> Outcome:
    """Fly one trial; an error becomes part of its outcome."""
    study, record_in, stop = task
    mission = study.mission_of(trial)
    if mission is None:
        return Outcome(trial, (), {}, 0.0, study.combinations[trial.combination].problem)

    def raise_if_interrupted(_: float) -> None:
        if stop is not None and stop.is_set():
            raise _StoppedError

    begun = time.perf_counter()
    try:
        flight: Flight | Run = (
            fly_in_memory(mission, raise_if_interrupted)
            if record_in is None
            else simulate(mission, run_folder(record_in, trial), raise_if_interrupted)
        )
        results = evaluate(flight, mission.claims, mission.case, mission.graph)
        verdict = flight.verdict
    except _StoppedError:
        raise
    except Exception as error:  # a failed flight is a row of the table and must not end the study
        where = traceback.extract_tb(error.__traceback__)[-1]
        text = f"{type(error).__name__}: {error} ({Path(where.filename).name}:{where.lineno})"
        return Outcome(trial, (), {}, time.perf_counter() - begun, text)
    return Outcome(trial, tuple(results), flight.lost, time.perf_counter() - begun, "", verdict)
