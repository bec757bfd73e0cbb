"""Fly the trials of a study in batches on an executor: processes of this computer, or a Dask cluster.

A batch takes about two seconds, so that its transport costs next to nothing. A worker that dies costs the flights of
its batches, which fly again; a flight that kills its worker once more is a row that says so.
"""

from __future__ import annotations

import abc
import collections
import contextlib
import multiprocessing
import os
import pickle
import signal
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from pathlib import Path
from typing import Any

from ftcc.groundside.simulation import fly_in_memory
from ftcc.groundside.studies.errors import StudyError
from ftcc.groundside.studies.flying import Outcome
from ftcc.groundside.studies.plan import StudyPlan
from ftcc.groundside.studies.versions import versions
from ftcc.groundside.studies.worker import OtherVersionError, fly_batch, initialize
from ftcc.groundside.swarm import no_main_module

__all__ = ["Engine", "Here", "Pool", "catch_ctrl_c", "compile_law", "fly_all", "local_engine"]

_ONE_THREAD = ("NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")
_BATCH = 2.0
"""Wall time of a batch, s."""
_LARGEST = 1000
"""Most flights of a batch."""
_WAITING = 2
"""Batches for each worker: one flies, one waits, so that no worker does."""
_POLL = 0.5
"""Time after which Ctrl-C takes effect where no flight ends, s."""


class Engine(abc.ABC):
    """Where batches fly."""

    workers = 1
    """Number of workers now."""
    in_flight = 1
    """Most batches that are submitted at a time for each worker."""
    shared_fate = False
    """Whether the death of one worker takes the batches of all."""
    died: tuple[type[BaseException], ...] = ()
    """What a future raises if its worker died."""

    @abc.abstractmethod
    def submit(self, plan: bytes, numbers: Sequence[int]) -> Future[list[Outcome]]:
        """Submit a batch."""

    def prepare(self, plan: StudyPlan) -> None:  # noqa: B027 (nothing to do where other computers compile)
        """Compile the law before the flights begin."""

    def recover(self) -> None:  # noqa: B027 (nothing to do where workers come back by themselves)
        """Make ready for the next batch after a worker died."""

    def refuse(self, error: OtherVersionError) -> None:
        """Handle a worker of another version."""
        raise StudyError(f"a process runs another version of the program ({error}): it was changed during the study")

    def close(self) -> None:  # noqa: B027 (nothing to do where no process was started)
        """End all flights."""


class Here(Engine):
    """This process: one flight after the other. It ends if a flight crashes."""

    def __init__(self, record_in: Path | None = None) -> None:
        self._record_in = record_in

    def submit(self, plan: bytes, numbers: Sequence[int]) -> Future[list[Outcome]]:
        done: Future[list[Outcome]] = Future()
        done.set_result(fly_batch(plan, numbers[:1], versions(), self._record_in))
        return done

    def prepare(self, plan: StudyPlan) -> None:
        compile_law(plan)


class Pool(Engine):
    """Processes of this computer."""

    in_flight = _WAITING
    shared_fate = True
    died = (BrokenProcessPool,)

    def __init__(self, workers: int, stop: Any, record_in: Path | None = None) -> None:
        self.workers = workers
        self._stop = stop
        self._record_in = record_in
        self._executor = self._new()

    def _new(self) -> Executor:
        context = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(self.workers, mp_context=context, initializer=initialize, initargs=(self._stop,))

    def submit(self, plan: bytes, numbers: Sequence[int]) -> Future[list[Outcome]]:
        # A process that is started for it does not import the program that started this one.
        with no_main_module(), _single_threaded(), _block_ctrl_c():
            return self._executor.submit(fly_batch, plan, numbers, versions(), self._record_in)

    def recover(self) -> None:
        self._executor.shutdown(wait=False, cancel_futures=True)
        self._executor = self._new()

    def prepare(self, plan: StudyPlan) -> None:
        compile_law(plan)  # otherwise all processes would compile at the same time

    def close(self) -> None:
        self._stop.set()
        self._executor.shutdown(wait=True, cancel_futures=True)  # a process that still starts would fail aloud


def compile_law(plan: StudyPlan) -> None:
    """Compile the law of a study in this process; other processes find it in the cache."""
    mission = plan.mission
    fly_in_memory(replace(mission, timing=mission.timing._replace(ticks=0)))


def local_engine(jobs: int, flights: int, record_in: Path | None = None) -> Engine:
    """Return an engine of ``jobs`` processes; this one alone if they can have no semaphores, with a warning."""
    jobs = min(jobs, flights)
    if jobs > 1:
        try:
            return Pool(jobs, multiprocessing.get_context("spawn").Event(), record_in)
        except (OSError, ImportError) as error:
            why = getattr(error, "strerror", None) or error
            text = f"cannot use several processes ({why}; their semaphores need /dev/shm): all flights run in this one"
            warnings.warn(text, RuntimeWarning, stacklevel=3)
    return Here(record_in)


def fly_all(
    plan: StudyPlan,
    numbers: Iterator[int],
    engine: Engine,
    report: Callable[[list[Outcome]], bool],
    raise_if_interrupted: Callable[[], None],
) -> None:
    """Fly trials until there is none left, or ``report`` says that they are enough.

    Parameters
    ----------
    plan : StudyPlan
    numbers : iterator of int
        Numbers of the flights.
    engine : Engine
    report : callable
        Called with the outcomes of each batch, in no particular order; True: no more flights are wanted.
    raise_if_interrupted : callable
        Raises KeyboardInterrupt if Ctrl-C was pressed.
    """
    flights = _Flights(plan, numbers, engine)
    while flights.submit():
        done, _ = wait(flights.flying, timeout=_POLL, return_when=FIRST_COMPLETED)
        raise_if_interrupted()
        if report(flights.collect(done)):
            break


class _Flights:
    """The batches in flight, and those to come."""

    def __init__(self, plan: StudyPlan, numbers: Iterator[int], engine: Engine) -> None:
        self.flying: dict[Future[list[Outcome]], list[int]] = {}
        self._pickled = pickle.dumps(plan)
        self._numbers = numbers
        self._engine = engine
        self._again: collections.deque[list[int]] = collections.deque()
        """Batches to fly again, through no fault of theirs."""
        self._suspects: collections.deque[int] = collections.deque()
        """Flights one of which may have killed its worker: each flies alone."""
        self._alone: int | None = None
        self._seconds, self._flown = 0.0, 0

    def submit(self) -> bool:
        """Keep the workers busy; return whether anything flies."""
        engine = self._engine
        while len(self.flying) < engine.workers * engine.in_flight:
            if self._alone is not None or (self._suspects and self.flying and engine.shared_fate):
                break
            if self._suspects:
                batch = [self._suspects.popleft()]
                self._alone = batch[0] if engine.shared_fate else None
            elif self._again:
                batch = self._again.popleft()
            else:
                batch = [number for _, number in zip(range(self._size()), self._numbers, strict=False)]
            if not batch:
                break
            try:
                self.flying[engine.submit(self._pickled, batch)] = batch
            except engine.died:  # the pool broke, and the futures in flight will say so
                self._again.appendleft(batch)
                self._alone = None
                if not self.flying:
                    engine.recover()
                break
        return bool(self.flying or self._again or self._suspects)

    def _size(self) -> int:
        """Return the number of flights in a batch: few at first, while their duration is unknown."""
        if not self._flown:
            return 1
        return max(1, min(_LARGEST, int(_BATCH * self._flown / max(self._seconds, 1e-6))))

    def collect(self, done: set[Future[list[Outcome]]]) -> list[Outcome]:
        """Return the outcomes of batches that have ended; those whose worker died fly again."""
        outcomes: list[Outcome] = []
        lost: list[list[int]] = []
        for future in done:
            batch = self.flying.pop(future)
            try:
                landed = future.result()
            except self._engine.died:
                lost.append(batch)
                continue
            except OtherVersionError as error:
                self._engine.refuse(error)
                self._again.append(batch)
                continue
            outcomes += landed
            self._seconds += sum(outcome.wall for outcome in landed)
            self._flown += len(landed)
            if rest := batch[len(landed) :]:
                self._again.appendleft(rest)
            if self._alone == batch[0]:
                self._alone = None
        if lost:
            outcomes += self._mourn(lost)
        return outcomes

    def _mourn(self, lost: list[list[int]]) -> list[Outcome]:
        """Plan flights whose worker died once more; return those that are to blame."""
        if self._engine.shared_fate:
            wait(self.flying)
            lost += [batch for future, batch in self.flying.items() if _broke(future, self._engine.died)]
            self.flying = {
                future: batch for future, batch in self.flying.items() if not _broke(future, self._engine.died)
            }
            self._engine.recover()
        guilty = []
        for batch in lost:
            if len(batch) == 1 and (self._alone == batch[0] or not self._engine.shared_fate):
                guilty.append(Outcome(batch[0], error="its process died"))
            else:
                self._suspects.extend(batch)
        self._alone = None
        return guilty


def _broke(future: Future[Any], died: tuple[type[BaseException], ...]) -> bool:
    return isinstance(future.exception(), died)


@contextlib.contextmanager
def catch_ctrl_c() -> Iterator[Callable[[], None]]:
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
