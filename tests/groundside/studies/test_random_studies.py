"""Random quantities: which flight is drawn, alone or among many, by whatever engine, from wherever it goes on."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
import tomli_w

from ftcc.groundside.claims import evaluate
from ftcc.groundside.cli import main
from ftcc.groundside.errors import UserError
from ftcc.groundside.scenario import read, shipped
from ftcc.groundside.simulation import fly_in_memory
from ftcc.groundside.statistics import until_of
from ftcc.groundside.studies import (
    HEADLINE,
    Study,
    StudyPlan,
    fly_study,
    larger,
    load_plan,
    mission_of_row,
    open_folder,
    plan_study,
)
from ftcc.groundside.studies.campaign import Progress
from ftcc.groundside.studies.versions import versions
from ftcc.groundside.studies.worker import OtherVersionError, fly_batch

SECONDS = 2.0
STUDY: dict[str, Any] = {
    "question": "Does it stay close?",
    "samples": 12,
    "against": ["fast"],
    "random": {
        "channel": {"loss": {"distribution": "uniform", "low": 0.0, "high": 0.6}},
        "faults": {"0": {"uav": {"distribution": "choice", "values": [1, 2, 3]}}},
        "start.uav.1.z": {"distribution": "norm", "loc": 1005.0, "scale": 1.0},
    },
    "claims": [{"name": "close", "metric": "max_abs", "signal": "z - z_r", "window": [0.0, SECONDS], "bound": "< 5.5"}],
}


def scenario_in(folder: Path, **changes: Any) -> Path:
    document = read(shipped()["demo"])
    document |= {"duration": SECONDS, "claims": [], "study": STUDY | changes}
    document["faults"] = [fault | {"at": 1.0, "bias": 0.2} for fault in document["faults"][:1]]
    document["variant"] = {"fast": {"title": "a faster shaper", "gains": {"shaper": 3.0}}}
    path = folder / "short.toml"
    path.write_text(tomli_w.dumps(document))
    return path


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Study:
    """The whole study, by one process."""
    folder = tmp_path_factory.mktemp("flown")
    plan = plan_study(scenario_in(folder))
    assert fly_study(plan, open_folder(plan, folder / "study"), jobs=1)
    return Study(folder / "study")


def test_every_draw_flies_in_each_case_with_the_same_values_and_seed(flown: Study) -> None:
    rows = flown.table.to_pylist()
    assert [row["flight"] for row in rows] == list(range(24))
    for plain, fast in zip(rows[::2], rows[1::2], strict=True):
        assert (plain["case"], fast["case"]) == ("flight", "flight+fast")
        for key in ("draw", "seed", "channel.loss", "faults.0.uav", "start.uav.1.z"):
            assert plain[key] == fast[key]
    assert len({row["channel.loss"] for row in rows}) == 12
    assert {row["faults.0.uav"] for row in rows} == {1, 2, 3}
    assert {row["verdict"] for row in rows} - {None} <= {"as it should be", "with remarks", "failed"}


def test_a_row_flown_alone_gives_the_same_number(flown: Study) -> None:
    row = flown.table.to_pylist()[7]
    mission = mission_of_row(load_plan(flown.folder), 7)
    assert (mission.case, mission.timing.seed) == ("flight+fast", row["seed"])
    (result,) = evaluate(fly_in_memory(mission), mission.claims, mission.case, mission.graph)
    assert result.value == row["close"]
    assert result.ok == row["close holds"]


@pytest.mark.parametrize("design", ["sobol", "random"])
def test_a_flight_is_the_same_alone_or_among_many(tmp_path: Path, design: str) -> None:
    few = plan_study(scenario_in(tmp_path), samples=3, design=design)
    many = plan_study(scenario_in(tmp_path), samples=100_000, design=design)
    assert [few.drawn(few.trial(n))[0] for n in range(6)] == [many.drawn(many.trial(n))[0] for n in range(6)]
    assert many.drawn(many.trial(199_999))[1] is not None


def test_a_latin_hypercube_depends_on_its_size_and_cannot_grow(tmp_path: Path) -> None:
    plan = plan_study(scenario_in(tmp_path), samples=8, design="lhs")
    losses = sorted(plan.draws.values(n)[0] / 0.6 for n in range(8))
    assert [int(8 * loss) for loss in losses] == list(range(8))
    with pytest.raises(UserError, match="cannot change it"):
        larger(plan, 16)


def table_bytes(folder: Path) -> bytes:
    return (folder / "study.parquet").read_bytes()


def test_a_study_that_was_stopped_goes_on_to_the_same_table(flown: Study, tmp_path: Path) -> None:
    plan = flown.plan
    stopped = tmp_path / "stopped"

    def stop(now: Progress) -> None:
        if now.flown == 5:
            raise KeyboardInterrupt

    assert not fly_study(plan, open_folder(plan, stopped), jobs=1, report=stop)
    assert pq.read_table(stopped / "study.parquet").num_rows == 5
    seen: list[int] = []
    assert fly_study(plan, open_folder(plan, stopped, resume=True), jobs=2, report=lambda now: seen.append(now.flown))
    assert seen[0] == 5
    assert table_bytes(stopped) == table_bytes(flown.folder)


def test_a_study_grows_to_the_table_of_the_larger_one(flown: Study, tmp_path: Path) -> None:
    small = larger(flown.plan, 4)
    fly_study(small, open_folder(small, tmp_path), jobs=1)
    again = larger(load_plan(tmp_path), 12)
    fly_study(again, open_folder(again, tmp_path, resume=True), jobs=1)
    assert table_bytes(tmp_path) == table_bytes(flown.folder)


@pytest.mark.slow
def test_a_process_that_is_killed_costs_no_row(flown: Study, tmp_path: Path) -> None:
    """A worker of the local pool dies by SIGKILL in the middle; its batches fly again."""
    killed: list[int] = []

    def kill(now: Progress) -> None:
        workers = [one.pid for one in multiprocessing.active_children() if one.pid and one.name.startswith("Spawn")]
        if now.flown >= 4 and not killed and workers:
            killed.append(max(workers))
            os.kill(killed[0], signal.SIGKILL)

    assert fly_study(flown.plan, open_folder(flown.plan, tmp_path), jobs=2, report=kill)
    assert killed
    assert table_bytes(tmp_path) == table_bytes(flown.folder)


@pytest.mark.slow
def test_a_cluster_gives_the_same_table(flown: Study, tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    assert fly_study(flown.plan, open_folder(flown.plan, tmp_path), cluster="local:2")
    assert table_bytes(tmp_path) == table_bytes(flown.folder)


@pytest.mark.slow
def test_a_study_killed_at_any_moment_goes_on(flown: Study, tmp_path: Path) -> None:
    path, folder = scenario_in(tmp_path), tmp_path / "study"
    command = [sys.executable, "-m", "ftcc.groundside.cli", "study"]
    begun = subprocess.Popen([*command, str(path), "--samples", "400", "--jobs", "1", "--out", str(folder)],
                             stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # fmt: skip
    until = time.monotonic() + 300.0
    while not any((folder / "flights").glob("*.parquet")):
        assert begun.poll() is None
        assert time.monotonic() < until
        time.sleep(0.05)
    begun.kill()
    begun.wait()
    assert not (folder / "study.parquet").exists()
    there = len(Study(folder).table)
    assert there > 0
    # Not fewer than there are: what has landed stays.
    asked = str(max(12, -(-there // 2)))
    again = subprocess.run([*command, str(folder), "--resume", "--samples", asked, "--jobs", "1"],
                           capture_output=True, text=True, timeout=300)  # fmt: skip
    assert "Traceback" not in again.stderr, again.stderr
    table = pq.read_table(folder / "study.parquet")
    assert table.slice(0, 24).equals(flown.table)


def test_until_stops_at_a_look_whatever_the_order(tmp_path: Path) -> None:
    plan = plan_study(scenario_in(tmp_path), samples=130)
    rule = until_of('P("close") < 0.95 at 95 %')
    tables = []
    for jobs in (1, 2):
        folder = tmp_path / f"jobs{jobs}"
        fly_study(plan, open_folder(plan, folder), jobs=jobs, until=rule)
        tables.append(table_bytes(folder))
    draws = pq.read_table(tmp_path / "jobs1" / "study.parquet").num_rows // 2
    assert draws in (64, 80, 100, 125, 130)
    assert tables[0] == tables[1]


def test_answers_of_a_table_are_those_counted_by_hand(flown: Study) -> None:
    rows, answers = flown.table.to_pylist(), flown.answers
    good = [row["close holds"] and not row["lost"] for row in rows[::2] if not row["refused"]]
    found = answers.share(HEADLINE, 0)
    assert (found.count, found.of) == (sum(good), len(good))
    pairs = answers.paired(HEADLINE, 1)
    assert pairs.both + pairs.only_first + pairs.only_second + pairs.neither == len(good)
    assert re.match(rf"flight holds in .* of {len(good)} flights", answers.sentences()[0])


def test_sensitivities_name_what_matters(tmp_path: Path) -> None:
    """The initial altitude of UAV 1 decides its greatest altitude of two seconds; whose elevator fails does not."""
    claims = [STUDY["claims"][0] | {"uavs": [1], "signal": "z - 1000", "bound": "< 9"}]
    changes = {"claims": claims, "against": [], "random": {**STUDY["random"]}}
    plan = plan_study(scenario_in(tmp_path, **changes), samples=32, sensitivity=True)
    assert plan.count == 32 * 6
    assert fly_study(plan, open_folder(plan, tmp_path / "study"), jobs=1)
    found = {one.name: one for one in Study(tmp_path / "study").answers.sensitivities()}
    indices = found["close"].indices
    assert list(indices) == ["channel.loss", "faults.0.uav", "start.uav.1.z", "seed"]
    assert indices["start.uav.1.z"].total > 0.7
    assert indices["faults.0.uav"].total < 0.1


def test_a_study_of_its_own_file_names_its_scenario(tmp_path: Path) -> None:
    scenario_in(tmp_path)
    file = tmp_path / "mine.toml"
    file.write_text('[study]\nof = "short.toml"\nsamples = 5\nrandom = { channel.loss = { distribution = "uniform", '
                    'low = 0, high = 0.1 } }\nchanges = { duration = 1.0 }\n')  # fmt: skip
    plan = plan_study(file)
    assert (plan.count, plan.mission.timing.duration, plan.name) == (5, 1.0, "short")


def test_what_cannot_fly_is_a_row_or_drawn_again(tmp_path: Path) -> None:
    fault = {"faults": {"0": {"bias": {"distribution": "uniform", "low": 0.0, "high": 1.4}}}}
    refused = plan_study(scenario_in(tmp_path, random=fault, samples=32, against=[]))
    again = plan_study(scenario_in(tmp_path, random=fault, samples=32, against=[]), redraw=True)
    rows = [refused.drawn(refused.trial(n)) for n in range(32)]
    cannot = [n for n, (_, mission, _) in enumerate(rows) if mission is None]
    assert 0 < len(cannot) < 32
    assert "no level trim" in rows[cannot[0]][2]
    for n in range(32):
        values, mission, _ = again.drawn(again.trial(n))
        assert mission is not None
        assert (values == rows[n][0]) == (n not in cannot)


@pytest.mark.parametrize(
    ("options", "because"),
    [
        ({"random": ["channel.loss=uniformly(low=0, high=1)"]}, "uniformly"),
        ({"random": ["channel.los=uniform(low=0, high=1)"]}, "channel.los"),
        ({"random": ["channel.loss=uniform(low=0, high=2)"]}, "channel.loss = 1.99"),
        ({"random": ["faults.9.bias=uniform(low=0, high=1)"]}, "faults.9.bias has 1 entries"),
        ({"random": ["seed=integers(low=0, high=9)"]}, "every combination flies with every seed"),
        ({"random": ["nonsense"]}, "must be key.path=distribution"),
        ({"samples": 0}, "--samples 0: must be at least 1"),
        ({"samples": 3, "seeds": 3}, "give one"),
        ({"sensitivity": True, "seeds": 3}, "needs random quantities"),
        ({"against": ["nobody"]}, "there is no such variant"),
        ({"against": ["fast", "fast"]}, "is there already"),
    ],
)
def test_a_study_that_cannot_be_drawn_is_refused(tmp_path: Path, options: dict[str, Any], because: str) -> None:
    with pytest.raises(UserError, match=re.escape(because)):
        plan_study(scenario_in(tmp_path), **options)


def test_bad_input_ends_with_one_line_and_code_2(
    flown: Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    other = scenario_in(tmp_path)
    wrong = tmp_path / "wrong"
    wrong.mkdir()
    text = (flown.folder / "study.toml").read_text()
    (wrong / "study.toml").write_text(re.sub(r'(?m)^sources = ".*"$', 'sources = "0000"', text))
    cases = [
        (("study", flown.folder), "is a study already"),
        (("study", flown.folder, "--resume", "--vary", "channel.loss=0"), "--vary cannot change it"),
        (("study", tmp_path, "--resume"), "holds no study"),
        (("study", other, "--samples", "9", "--seed", "7", "--out", flown.folder, "--resume"), "holds another study"),
        (("study", wrong, "--resume"), "another version of the program (other sources)"),
        (("study", other, "--cluster", "127.0.0.1:1"), "no Dask scheduler answers there"),
        (("study", other, "--cluster", "local:none"), "must be local:N"),
        (("study", other, "--until", "soon"), "until 'soon'"),
        (("study", other, "--until", 'P("far") < 0.1 at 95 %'), "there is no claim 'far'"),
        (("simulate", flown.folder), "is a study, and no scenario"),
        (("simulate", flown.folder, "--row", "24"), "flights 0 to 23"),
    ]
    for words, because in cases:
        new = words[0] == "study" and "--out" not in words and "--resume" not in words
        command = [*words, *(["--out", tmp_path / "new"] if new else [])]
        monkeypatch.setattr(sys, "argv", ["ftcc", *map(str, command)])
        with pytest.raises(SystemExit) as ended:
            main()
        said = capsys.readouterr().err
        assert ended.value.code == 2, (words, said)
        assert because in said.replace("\n", " "), (words, said)
        assert "Traceback" not in said
        assert not (tmp_path / "new").exists(), words


def test_the_worker_of_another_version_is_refused_by_name(flown: Study) -> None:
    with pytest.raises(OtherVersionError, match=r"numpy 0.1 instead of|other sources"):
        fly_batch(pickle.dumps(flown.plan), [0], versions() | {"sources": "0"})


def test_a_plan_read_back_is_the_same(flown: Study) -> None:
    plan: StudyPlan = load_plan(flown.folder)
    assert plan == flown.plan
    assert [plan.drawn(plan.trial(n))[0] for n in range(4)] == [
        tuple(row[one.key] for one in plan.draws.quantities) for row in flown.table.to_pylist()[:4]
    ]
