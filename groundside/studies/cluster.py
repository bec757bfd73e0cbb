"""Fly a study on a Dask cluster, through the executor that Dask offers."""

from __future__ import annotations

import contextlib
import logging
import warnings
from collections.abc import Sequence
from concurrent.futures import Executor, Future
from typing import Any

from ftcc.groundside.studies.engine import Engine, compile_law
from ftcc.groundside.studies.errors import StudyError
from ftcc.groundside.studies.flying import Outcome
from ftcc.groundside.studies.plan import StudyPlan
from ftcc.groundside.studies.versions import difference, versions
from ftcc.groundside.studies.worker import OtherVersionError, fly_batch
from ftcc.groundside.swarm import no_main_module

__all__ = ["Cluster"]

_LOCAL = "local:"
_TIMEOUT = 10.0
"""Time in which a scheduler must answer, s."""


class Cluster(Engine):
    """Workers of a Dask cluster."""

    in_flight = 2

    def __init__(self, address: str) -> None:
        try:
            import distributed
        except ImportError:
            raise StudyError(
                f'--cluster {address}: needs Dask; install it with: pip install "ftcc-sitl[cluster]"'
            ) from None
        self._address = address
        self.died = (distributed.scheduler.KilledWorker, distributed.client.FutureCancelledError)
        self._cluster = _local_cluster(address) if address.startswith(_LOCAL) else None
        try:
            self._client: Any = distributed.Client(self._cluster or address, timeout=_TIMEOUT, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            self.close()
            why = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise StudyError(f"--cluster {address}: no Dask scheduler answers there: {why}") from None
        self._known: dict[str, bool] = {}
        """Whether a worker, by address, has this version of the program."""
        self._executors: dict[tuple[str, ...], Executor] = {}
        if not self._usable():
            self.close()
            raise StudyError(f"--cluster {address}: none of its workers can fly this study")

    @property
    def workers(self) -> int:  # type: ignore[override]
        """Number of threads of all usable workers, at least 1: others may come."""
        return max(1, sum(int(one["nthreads"]) for one in self._usable().values()))

    def submit(self, plan: bytes, numbers: Sequence[int]) -> Future[list[Outcome]]:
        return self._executor().submit(fly_batch, plan, numbers, versions())

    def close(self) -> None:
        for executor in getattr(self, "_executors", {}).values():
            executor.shutdown(wait=False)  # cancels what does not fly yet
        for one in (getattr(self, "_client", None), self._cluster):
            if one is not None:
                with contextlib.suppress(TimeoutError, OSError):
                    one.close()

    def prepare(self, plan: StudyPlan) -> None:
        if self._cluster is not None:
            compile_law(plan)  # otherwise all workers would compile at the same time

    def refuse(self, error: OtherVersionError) -> None:
        """Look at all workers again: one was restarted with another version."""
        self._known.clear()

    def _executor(self) -> Executor:
        usable = tuple(sorted(self._usable()))
        if usable not in self._executors:
            options = {"workers": list(usable), "allow_other_workers": False} if usable else {}
            self._executors[usable] = self._client.get_executor(pure=False, **options)
        return self._executors[usable]

    def _usable(self) -> dict[str, Any]:
        """Return what Dask tells of the workers with this version of the program, by address.

        Of each other one it says, once, why it is not used.
        """
        there = self._client.scheduler_info(n_workers=-1)["workers"]
        new = [one for one in there if one not in self._known]
        if new:
            found = self._client.run(versions, workers=new, on_error="return")
            for one in new:
                theirs = found.get(one)
                if theirs is None:
                    continue  # it has gone meanwhile
                wrong = difference(theirs) if isinstance(theirs, dict) else f"it says {type(theirs).__name__}: {theirs}"
                self._known[one] = not wrong
                if wrong:
                    name = there[one].get("name", one)
                    warnings.warn(f"worker {name} at {one} is not used: {wrong}", RuntimeWarning, stacklevel=3)
        return {one: worker for one, worker in there.items() if self._known.get(one)}


def _local_cluster(address: str) -> Any:
    """Start workers on this computer, on loopback alone."""
    from distributed import LocalCluster

    number = address.removeprefix(_LOCAL)
    if not number.isdecimal() or int(number) < 1:
        raise StudyError(f"--cluster {address}: must be local:N with N workers, or the address of a Dask scheduler")
    logging.getLogger("distributed").setLevel(logging.ERROR)
    with no_main_module():
        return LocalCluster(
            n_workers=int(number),
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address=None,
            silence_logs=logging.ERROR,
        )
