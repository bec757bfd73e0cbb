"""Studies: what they refuse, what they fly, what they leave behind, and how they end."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil
import pyarrow.parquet as pq
import pytest

from ftcc.groundside.errors import UserError
from ftcc.groundside.scenario.loading import load
from ftcc.groundside.scenario.mission import resolve
from ftcc.groundside.simulation.cases import claims_in_flight
from ftcc.groundside.studies import Study, StudyPlan, engine, fly_study, open_folder, plan_study
from ftcc.groundside.studies.campaign import Progress
from ftcc.groundside.studies.versions import versions
from tests.support.guests import EXAMPLE, forget_schemes, install

SECONDS = 2.0
TOO_STEEP = 1e-4
"""A boundary layer, m, that is unstable in the steps of the flight form."""


def short(document: dict[str, Any]) -> None:
    """Two claims that two seconds of flight can decide, one about a number and one with a bound."""
    document["duration"] = SECONDS
    number = {
        "name": "altitude", "metric": "mean", "signal": "z", "window": [0.0, SECONDS], "unit": "m",
        "source": "test", "uavs": [1, 2], "expected": {"flight": [1005.0, 995.0]}, "tolerance": "3",
    }  # fmt: skip
    bound = {
        "name": "hull", "metric": "max_abs", "signal": "hull_distance", "window": [0.0, SECONDS], "unit": "m",
        "source": "test", "expected": {"flight": 0.0}, "tolerance": "< 0.5",
    }  # fmt: skip
    late = bound | {"name": "later", "window": [50.0, 60.0]}
    document["claims"] = [number, bound, late]


@pytest.fixture(scope="module")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Path:
    import tomli_w

    from ftcc.groundside.scenario.loading import read, shipped

    document = read(shipped()["demo"])
    short(document)
    path = tmp_path_factory.mktemp("scenario") / "short.toml"
    path.write_text(tomli_w.dumps(document))
    return path


@pytest.fixture(scope="module")
def flown(scenario: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Path]:
    """A study of loss, and of a gain of which one value is refused; its table as read back, and its folder."""
    plan = plan_study(scenario, ["channel.loss=0,.3", f"gains.phi=0.1,{TOO_STEEP}"], seeds=2, seed=5)
    folder = tmp_path_factory.mktemp("study")
    study = flown_in(folder, plan, jobs=2)
    names = {path.name for path in study.draw()}
    assert names == {f"{name}.{kind}" for name in ("study", "shares") for kind in ("png", "svg", "pdf")}
    return pq.read_table(folder / "study.parquet"), folder


def flown_in(folder: Path, plan: StudyPlan, jobs: int = 1) -> Study:
    """A whole study, flown into a folder."""
    assert fly_study(plan, open_folder(plan, folder), jobs=jobs)
    return Study(folder)


@pytest.mark.parametrize(
    ("vary", "because"),
    [
        (["nonsense"], "--vary nonsense: must be key.path=value"),
        (["channel.loss="], "--vary channel.loss=: must be key.path=value"),
        (["channel.loss=0,,0.3"], "a value is missing between two commas"),
        (["channel.loss=0.1,.1"], "a value is listed twice"),
        (["channel.loss=0", "channel.loss=0.3"], "--vary channel.loss: given twice"),
        (["seed=1,2"], "use --seeds"),
        (["channel.los=0,0.3"], "channel.los = 0: there is no such field here; allowed are loss"),
        (["channel.loss=0,1.5"], "channel.loss = 1.5: must be less than or equal to 1"),
        (["channel.loss=little"], "channel.loss = 'little'"),
        (["gains.k99=1,2"], "scheme containment has no gain 'k99'"),
        (["faults.7.at=1,2"], "faults.7.at has 1 entries"),
    ],
)
def test_a_study_that_cannot_fly_is_refused_before_it_begins(vary: list[str], because: str) -> None:
    with pytest.raises(UserError, match=re.escape(because)):
        plan_study("demo", vary)


def test_all_combinations_fly_with_the_same_seeds(flown: tuple[Any, Path]) -> None:
    rows = flown[0].select(["flight", "channel.loss", "gains.phi", "seed"]).to_pylist()
    assert [tuple(row.values()) for row in rows] == [
        (n, loss, phi, seed)
        for n, (seed, loss, phi) in enumerate(
            (seed, loss, phi) for seed in (5, 6) for loss in (0.0, 0.3) for phi in (0.1, TOO_STEEP)
        )
    ]


def test_values_are_those_of_the_flight_alone(flown: tuple[Any, Path], scenario: Path) -> None:
    row = next(row for row in flown[0].to_pylist() if row["channel.loss"] == 0.3 and row["seed"] == 6)
    settings = ["channel.loss=0.3", "gains.phi=0.1"]
    flight, (altitude, hull, _) = claims_in_flight(load(scenario, settings=settings, seed=6))
    assert [row["altitude, UAV 1"], row["altitude, UAV 2"]] == altitude.value
    assert row["hull"] == hull.value
    assert (row["verdict"], row["largest error"]) == (flight.verdict.word, flight.verdict.tracking[0].largest)
    assert row["later"] is None
    assert row["later holds"] is None


def test_a_seed_is_that_of_gusts_too() -> None:
    plan = plan_study("fire_monitoring", seeds=2, duration=SECONDS)
    _, second, _ = plan.drawn(plan.trial(1))
    alone = resolve(load("fire_monitoring", seed=2, duration=SECONDS))
    assert second is not None
    assert (second.vehicles, second.timing) == (alone.vehicles, alone.timing)
    assert {spec.gust.seed for spec in alone.vehicles} == {2}


def test_a_combination_that_is_refused_is_a_row_with_its_reason(flown: tuple[Any, Path]) -> None:
    for row in flown[0].to_pylist():
        if row["gains.phi"] == TOO_STEEP:
            assert "unstable in Euler steps" in row["error"]
            assert row["refused"]
            assert row["hull"] is None
            assert (row["verdict"], row["largest error"]) == (None, None)
        else:
            assert row["error"] is None
            assert row["lost"] == []


def test_only_bounds_are_judged_where_the_settings_are_not_those_of_the_case(flown: tuple[Any, Path]) -> None:
    rows = [row for row in flown[0].to_pylist() if row["error"] is None]
    assert {(row["channel.loss"], row["altitude holds"]) for row in rows} == {(0.0, True), (0.3, None)}
    assert {(row["channel.loss"], row["hull holds"]) for row in rows} == {(0.0, False), (0.3, False)}


def test_a_lost_aircraft_is_reported_and_fails_its_claims(scenario: Path, tmp_path: Path) -> None:
    settings = ["start.uav.1.gamma=0.5", "plant.guards.flight_path_angle=0.501"]
    (row,) = flown_in(tmp_path, plan_study(scenario, settings=settings, duration=SECONDS)).table.to_pylist()
    assert row["lost"] == [1]
    assert row["error"].startswith("UAV 1 lost at ")
    assert (row["altitude, UAV 1"], row["altitude holds"]) == (None, False)


def test_the_table_says_units_tolerances_and_what_was_flown(flown: tuple[Any, Path]) -> None:
    schema = flown[0].schema
    assert schema.field("altitude, UAV 1").metadata == {
        b"unit": b"m", b"meaning": b"mean of z over 0 to 2 s", b"expected": b"1005", b"tolerance": b"3",
        b"source": b"test",
    }  # fmt: skip
    assert schema.metadata[b"ftcc.study"] == b"3"
    assert schema.metadata[b"ftcc.case"] == b"flight"
    assert (flown[1] / "study.png").stat().st_size > 10_000


DEADLY = """
def step(s, own, heard, reference, model, gains, dt):
    if gains.k_c == 2.0:
        import os
        os._exit(7)
    if gains.k_c == 3.0:
        raise RuntimeError("k_c is 3")
    return s, Output(own.thrust, own.elevator, 0.0, 0.0)
"""


def test_a_process_that_dies_and_an_exception_are_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(EXAMPLE, tmp_path, {"deadly": (EXAMPLE / "altitude_consensus.py").read_text() + DEADLY})
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    # Plain Python there, and nothing to prepare here: nothing need be compiled.
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    monkeypatch.setattr(engine, "fly_in_memory", lambda mission: None)
    forget_schemes()
    versions.cache_clear()
    try:
        plan = plan_study(EXAMPLE / "consensus.toml", ["gains.k_c=1,2,3,4"], settings=["scheme=deadly"], duration=0.1)
        errors = flown_in(tmp_path / "study", plan, jobs=2).table.column("error").to_pylist()
    finally:
        monkeypatch.undo()
        forget_schemes()
        versions.cache_clear()
    assert errors[:2] == [None, "its process died"]
    assert re.search(r"deadly\.py:\d+: in step: RuntimeError: k_c is 3 \(UAV 1, t = 0 s\)$", errors[2])
    assert errors[3] is None


def test_ctrl_c_leaves_a_table_of_what_was_flown(scenario: Path, tmp_path: Path) -> None:
    folder = tmp_path / "study"
    with (tmp_path / "output.txt").open("w") as output:
        study = subprocess.Popen(
            [sys.executable, "-m", "ftcc.groundside.cli", "study", str(scenario), "--seeds", "100000", "--jobs", "2",
             "--record", "--out", str(folder)],
            stdout=output, stderr=subprocess.STDOUT, start_new_session=True, env={**os.environ, "COLUMNS": "200"},
        )  # fmt: skip
    wait_until(lambda: (folder / "runs" / "0003" / "signals.parquet").exists(), study)
    workers = psutil.Process(study.pid).children(recursive=True)
    os.killpg(study.pid, signal.SIGINT)
    assert study.wait(60) == 1
    text = (tmp_path / "output.txt").read_text()
    assert "Traceback" not in text, text
    assert re.search(r"\d+ of 100000 flights of 2 s, interrupted", text), text
    flown = pq.read_table(folder / "study.parquet").num_rows
    assert 1 <= flown < 100000
    assert (folder / "study.png").exists()
    _, alive = psutil.wait_procs(workers, timeout=30)
    assert not alive


def wait_until(condition: Callable[[], bool], process: subprocess.Popen[bytes], seconds: float = 120.0) -> None:
    until = time.monotonic() + seconds
    while not condition():
        assert process.poll() is None, "ended before its time"
        assert time.monotonic() < until
        time.sleep(0.02)


def test_one_job_needs_no_other_process_and_gives_the_same(
    flown: tuple[Any, Path], scenario: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(engine, "multiprocessing", None)
    plan = plan_study(scenario, ["channel.loss=0,.3", f"gains.phi=0.1,{TOO_STEEP}"], seeds=2, seed=5)
    flown_in(tmp_path, plan)
    assert (tmp_path / "study.parquet").read_bytes() == (flown[1] / "study.parquet").read_bytes()


@pytest.mark.parametrize("error", [OSError(30, "Read-only file system"), OSError(28, "full"), ImportError("none")])
def test_without_semaphores_all_fly_in_this_process_with_a_warning(
    scenario: Path, monkeypatch: pytest.MonkeyPatch, error: Exception, tmp_path: Path
) -> None:
    class Context:
        def Event(self) -> None:  # noqa: N802 (the library's name)
            raise error

    monkeypatch.setattr(engine.multiprocessing, "get_context", lambda _: Context())
    with pytest.warns(RuntimeWarning, match=rf"{getattr(error, 'strerror', None) or error}.*run in this one"):
        study = flown_in(tmp_path, plan_study(scenario, seeds=2), jobs=2)
    assert study.table.column("error").to_pylist() == [None, None]


def test_ctrl_c_in_this_process_reports_nothing_of_the_flight_that_it_cuts_short(
    scenario: Path, tmp_path: Path
) -> None:
    plan = plan_study(scenario, seeds=1000)

    def report(now: Progress) -> None:
        if now.flown == 2:
            threading.Timer(0.01, os.kill, (os.getpid(), signal.SIGINT)).start()

    assert not fly_study(plan, open_folder(plan, tmp_path), jobs=1, report=report)
    table = Study(tmp_path).table
    assert 2 <= len(table) < 1000
    assert set(table.column("altitude holds").to_pylist()) == {True}  # a flight that was cut short decides nothing
