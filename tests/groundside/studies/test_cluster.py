"""A cluster of one's own, as docs/clusters.md starts it: a scheduler, and workers of this and of another version."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from ftcc.groundside.studies import fly_study, open_folder, plan_study
from ftcc.groundside.studies.campaign import Progress
from ftcc.groundside.studies.cluster import Cluster
from tests.groundside.studies.test_random_studies import scenario_in
from tests.support.ports import free_port

pytestmark = pytest.mark.slow

REPOSITORY = Path(__file__).parents[3]


class Started:
    """A process that is ended with the test."""

    def __init__(self, *words: str, **environment: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "distributed.cli.dask_" + words[0], *words[1:]],
            env={**os.environ, "OMP_NUM_THREADS": "1", **environment},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    def __enter__(self) -> Started:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()


@pytest.fixture
def scheduler() -> Iterator[str]:
    distributed = pytest.importorskip("distributed")
    port = free_port()
    with Started("scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"):
        address = f"tcp://127.0.0.1:{port}"
        until = time.monotonic() + 60.0
        while True:
            try:
                distributed.Client(address, timeout=2, set_as_default=False).close()
                break
            except OSError:
                assert time.monotonic() < until
        yield address


def worker(address: str, name: str, **environment: str) -> Started:
    options = ("--nworkers", "1", "--nthreads", "1", "--no-dashboard", "--no-nanny", "--name", name)
    return Started("worker", address, "--host", "127.0.0.1", *options, **environment)


def wait_for_workers(address: str, number: int) -> None:
    import distributed

    with distributed.Client(address, timeout=10, set_as_default=False) as client:
        client.wait_for_workers(number, timeout=120)


def test_workers_die_and_come_and_the_table_is_the_same(scheduler: str, tmp_path: Path) -> None:
    """Two workers, each in a folder of its own; one is killed with SIGKILL in the middle, a third one comes."""
    plan = plan_study(scenario_in(tmp_path), samples=40)
    alone = tmp_path / "alone"
    assert fly_study(plan, open_folder(plan, alone), jobs=1)
    with ExitStack() as stack:
        first = stack.enter_context(worker(scheduler, "first"))
        stack.enter_context(worker(scheduler, "second"))
        wait_for_workers(scheduler, 2)
        came: list[Started] = []

        def kill(now: Progress) -> None:
            if now.flown >= 4 and not came:
                first.process.kill()
                came.append(stack.enter_context(worker(scheduler, "third")))

        folder = open_folder(plan, tmp_path / "cluster")
        assert fly_study(plan, folder, cluster=scheduler, report=kill)
        assert came
    assert (folder / "study.parquet").read_bytes() == (alone / "study.parquet").read_bytes()


def test_a_worker_with_other_sources_is_not_used_and_is_named(scheduler: str, tmp_path: Path) -> None:
    """A copy of the program that differs in a comment; alone it is refused, beside a right one it does not fly."""
    other = tmp_path / "other"
    for wing in ("airside", "groundside", "link", "sim"):
        shutil.copytree(REPOSITORY / wing, other / "ftcc" / wing, ignore=shutil.ignore_patterns("__pycache__"))
    with (other / "ftcc" / "link" / "graph.py").open("a") as file:
        file.write("# another version\n")
    plan = plan_study(scenario_in(tmp_path), samples=3)
    with worker(scheduler, "stranger", PYTHONPATH=str(other)):
        wait_for_workers(scheduler, 1)
        with (
            pytest.warns(RuntimeWarning, match=r"worker stranger at tcp://.* is not used: other sources"),
            pytest.raises(Exception, match="none of its workers can fly this study"),
        ):
            fly_study(plan, open_folder(plan, tmp_path / "refused"), cluster=scheduler)
        with worker(scheduler, "right"):
            wait_for_workers(scheduler, 2)
            with pytest.warns(RuntimeWarning, match="worker stranger"):
                assert fly_study(plan, open_folder(plan, tmp_path / "flown"), cluster=scheduler)


class Joining:
    """A client of a scheduler that one more worker has joined whenever it is asked."""

    def __init__(self) -> None:
        self.asked = 0

    def scheduler_info(self, n_workers: int) -> dict[str, Any]:
        self.asked += 1
        return {"workers": {f"tcp://127.0.0.1:{port}": {"nthreads": 2} for port in range(self.asked)}}

    def run(self, function: Callable[[], Any], workers: list[str], on_error: str) -> dict[str, Any]:
        return dict.fromkeys(workers, function())


def test_a_worker_that_joins_while_others_are_counted_is_counted_next_time() -> None:
    cluster = Cluster.__new__(Cluster)
    cluster._client, cluster._known = Joining(), {}
    assert [cluster.workers for _ in range(3)] == [2, 4, 6]
