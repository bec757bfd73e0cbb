"""Searches: what is mildest, that it is found on any engine and after any stop, and what they leave behind."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
import tomli_w

from ftcc.groundside.claims import evaluate
from ftcc.groundside.errors import UserError
from ftcc.groundside.scenario import load, read, resolve, shipped
from ftcc.groundside.simulation import fly_in_memory
from ftcc.groundside.statistics import distribution_of
from ftcc.groundside.studies.distance import distance, place_of
from ftcc.groundside.studies.engine import Engine
from ftcc.groundside.studies.flying import Outcome
from ftcc.groundside.studies.quantities import quantity_of
from ftcc.groundside.studies.search import NOBODY_LOST, SearchPlan, plan_search
from ftcc.groundside.studies.search_record import open_search_folder, save_search
from ftcc.groundside.studies.search_sampler import GENERATION
from ftcc.groundside.studies.searching import Found, fly_search

HULL = "distance outside the leaders' hull"
BIAS = "faults.0.bias=uniform(low=0, high=0.7)"
LOSS = "channel.loss=uniform(low=0, high=1)"
KIND = 'faults.0.actuator=choice(["elevator", "thrust"])'

Answer = Callable[[int, dict[str, Any]], Outcome]


class Fake(Engine):
    """Answers flights from a function of their values, a few at a time, the last one first."""

    in_flight = 3

    def __init__(self, answer: Answer, stop_after: int | None = None) -> None:
        self.flown: list[int] = []
        self._answer = answer
        self._stop_after = stop_after

    def submit(self, plan: bytes, numbers: Sequence[int]) -> Future[list[Outcome]]:
        if self._stop_after is not None and len(self.flown) >= self._stop_after:
            raise KeyboardInterrupt
        study, done = pickle.loads(plan), Future[list[Outcome]]()
        keys = [one.key for one in study.draws.quantities]
        done.set_result(
            [self._answer(n, dict(zip(keys, study.draws.values(n), strict=True))) for n in reversed(numbers)]
        )
        self.flown += numbers
        return done


def judged(search: SearchPlan, number: int, hull: float, **fields: Any) -> Outcome:
    """An outcome in which the claim about the hull (< 0.01) has a value, and the others have none."""
    values = tuple(hull if claim.name == HULL else None for claim in search.study.claims)
    holds = tuple(hull < 0.01 if claim.name == HULL else None for claim in search.study.claims)
    return Outcome(number, values=values, holds=holds, verdict="as it should be", **fields)


@pytest.fixture(scope="module")
def disc() -> SearchPlan:
    """Own values: bias 0.35 and loss 0, at 0.5 and 0 of their distributions."""
    return plan_search("demo", [BIAS, LOSS], claim=HULL, budget=100, settings=["faults.0.without_trim=true"])


def beyond(search: SearchPlan, radius: float) -> Answer:
    """A claim that fails from a distance on, with a margin that falls evenly."""

    def answer(number: int, values: dict[str, Any]) -> Outcome:
        return judged(
            search, number, 0.01 * math.hypot(values["faults.0.bias"] / 0.7 - 0.5, values["channel.loss"]) / radius
        )

    return answer


def flown(search: SearchPlan, folder: Path, engine: Engine | None = None, **options: Any) -> Found:
    found = fly_search(search, open_search_folder(search, folder), engine=engine, **options)
    assert found is not None
    return found


def test_distance_is_in_units_of_the_distributions() -> None:
    quantities = [quantity_of(text) for text in (BIAS, LOSS, KIND)]
    own = (0.35, 0.0, "elevator")
    assert distance(quantities, own, own) == 0.0
    assert distance(quantities, (0.35, 0.3, "thrust"), own) == pytest.approx(0.3)
    assert distance(quantities, (0.35 + 0.7 * 0.4, 0.3, "elevator"), own) == pytest.approx(0.5)
    assert distance(quantities, (0.0, 1.0, "elevator"), own) == pytest.approx(math.hypot(0.5, 1.0))


@pytest.mark.parametrize(("value", "place"), [(1, 0.125), (3, 0.625), (0.5, 0.0), (2.5, 0.5), (9, 1.0)])
def test_a_number_beside_those_of_a_choice_has_a_place(value: float, place: float) -> None:
    assert place_of(distribution_of("choice([1, 2, 3, 4])", "here"), value) == place


def test_own_values_come_from_file_gains_and_defaults() -> None:
    over = [BIAS, LOSS, "gains.k11=uniform(low=0, high=9)", "faults.0.uav=integers(low=1, high=7)"]
    search = plan_search("demo", over, settings=["gains.k11=2.5"])
    assert search.draws.own == (0.35, 0.0, 2.5, 1)
    assert all(search.stated)
    far = plan_search("demo", ["start.theta=uniform(low=0, high=0.1)"])
    assert (far.draws.own, far.stated) == ((0.05,), (False,))


@pytest.mark.parametrize("method", ["cmaes", "tpe"])
def test_the_boundary_is_met_within_a_percent(disc: SearchPlan, method: str, tmp_path: Path) -> None:
    search = replace(disc, method=method)
    found = flown(search, tmp_path / "out", Fake(beyond(search, 0.4)))
    assert found.worst is not None
    assert 0.4 <= found.worst.distance <= 0.4 * 1.011
    assert found.bracket == pytest.approx(0.0, abs=0.01 * 0.4)
    assert len(found.flights) <= 100 + 36
    assert [one.number for one in found.flights] == list(range(len(found.flights)))


def test_margin_falls_before_distance(disc: SearchPlan) -> None:
    near, far = (0.35, 0.1), (0.7, 0.9)
    holds = [disc.judge("search", (0.5, 0.5), far, judged(disc, 1, hull)) for hull in (0.0, 0.0099)]
    fails = [disc.judge("search", (0.5, 0.5), row, judged(disc, 1, 0.02)) for row in (far, near)]
    refused = disc.judge("search", (0.5, 0.5), near, Outcome(1, refused=True, error="no trim"))
    ordered = [refused, *holds, *fails]
    assert [one.objective for one in ordered] == sorted((one.objective for one in ordered), reverse=True)
    assert [one.fails for one in ordered] == [None, False, False, True, True]
    assert holds[0].objective == pytest.approx(1.0 + math.sqrt(2.0) + 1.0)
    assert fails[1].objective == pytest.approx(0.1)


def test_a_lost_aircraft_fails_whatever_the_claim(disc: SearchPlan) -> None:
    lost = judged(disc, 1, 0.0, lost=(3,), end_margin=0.5)
    for goal in (HULL, NOBODY_LOST):
        assert replace(disc, goal=goal).judge("search", (0.5, 0.5), (0.35, 0.1), lost).fails is True


def test_nobody_lost_is_guided_by_the_error_at_the_end(disc: SearchPlan) -> None:
    search = replace(disc, goal=NOBODY_LOST)
    margins = [
        search.judge("search", (0.5, 0.5), (0.35, 0.1), judged(search, 1, 0.0, end_margin=end)).margin
        for end in (1.0, 0.0, -8.0)
    ]
    assert margins == [1.0, 0.5, 0.1]


def test_draws_that_cannot_fly_are_no_failures(disc: SearchPlan, tmp_path: Path) -> None:
    def answer(number: int, values: dict[str, Any]) -> Outcome:
        if values["channel.loss"] > 0.2:
            return Outcome(number, refused=True, error="no trim")
        return judged(disc, number, 0.0)

    found = flown(replace(disc, budget=40), tmp_path / "out", Fake(answer))
    assert not found.failing
    refused = sum(one.outcome.refused for one in found.flights)
    assert 0 < refused < 40
    text = " ".join(found.sentences())
    assert f"{refused} that cannot fly" in text
    assert "no bound" in text
    assert "can miss" in text
    assert len(found.flights) == 40


def test_a_claim_that_fails_at_once_ends_the_search(disc: SearchPlan, tmp_path: Path) -> None:
    found = flown(disc, tmp_path / "out", Fake(lambda number, _: judged(disc, number, 1.0)))
    assert (len(found.flights), found.worst) == (1, found.flights[0])
    assert "nothing milder" in found.sentences()[0]


def test_refinement_ends_at_whole_numbers(tmp_path: Path) -> None:
    search = plan_search("demo", ["faults.0.at=integers(low=40, high=60)", LOSS], claim=HULL, budget=60)
    found = flown(
        search, tmp_path / "out", Fake(lambda n, values: judged(search, n, 0.02 * (values["faults.0.at"] >= 47)))
    )
    assert found.worst is not None
    assert found.worst.values[0] == 47


def test_words_may_differ_at_no_cost(tmp_path: Path) -> None:
    search = plan_search("demo", [BIAS, KIND], claim=HULL, budget=60, settings=["faults.0.without_trim=true"])

    def answer(number: int, values: dict[str, Any]) -> Outcome:
        fails = values["faults.0.actuator"] == "thrust" and values["faults.0.bias"] > 0.42
        return judged(search, number, 0.02 * fails)

    found = flown(search, tmp_path / "out", Fake(answer))
    assert found.worst is not None
    assert found.worst.values[1] == "thrust"
    assert found.worst.distance == pytest.approx(0.1, rel=0.011)


@pytest.mark.parametrize("method", ["cmaes", "tpe"])
@pytest.mark.parametrize("killed_after", [1, 20, 103])
def test_a_search_that_was_stopped_ends_with_the_same_table(
    disc: SearchPlan, method: str, killed_after: int, tmp_path: Path
) -> None:
    search = replace(disc, method=method)
    flown(search, tmp_path / "whole", Fake(beyond(search, 0.4)))
    folder = open_search_folder(search, tmp_path / "parts")
    assert fly_search(search, folder, engine=Fake(beyond(search, 0.4), killed_after)) is None
    assert not (folder / "search.parquet").exists()
    rest = Fake(beyond(search, 0.4))
    assert fly_search(search, open_search_folder(search, folder, resume=True), engine=rest) is not None
    for name in ("search.parquet", "worst.toml"):
        assert (folder / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    assert min(rest.flown) >= killed_after - GENERATION
    assert len(rest.flown) < pq.read_metadata(folder / "search.parquet").num_rows


@pytest.mark.parametrize(
    ("options", "because"),
    [
        ({"over": []}, "--over: is missing"),
        ({"over": [BIAS, BIAS]}, "given twice"),
        ({"over": ["channel.los=uniform(low=0, high=1)"]}, "there is no such field here"),
        ({"over": ["channel.loss=uniform(low=0, high=2)"]}, "must be less than or equal to 1"),
        ({"over": ["channel.loss=unifrom(low=0, high=1)"]}, "there is no distribution 'unifrom'"),
        ({"over": ["seed=integers(low=0, high=9)"]}, "a seed has no distance"),
        ({"claim": "hull"}, "there is no claim 'hull' in this case"),
        ({"claim": HULL, "duration": 60.0}, "the flights end at 60 s"),
        ({"budget": 0}, "--budget 0: must be at least 1"),
        ({"method": "nelder"}, "--method nelder: must be cmaes or tpe"),
        ({"method": "cmaes", "over": [BIAS]}, "needs two quantities or more"),
    ],
)
def test_a_search_that_cannot_begin_is_refused(options: dict[str, Any], because: str) -> None:
    with pytest.raises(UserError, match=because):
        plan_search("demo", **{"over": [BIAS, LOSS], **options})


def test_a_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "optuna", None)
    with pytest.raises(UserError, match=r"pip install .*search"):
        plan_search("demo", [BIAS, LOSS])


def test_the_folder_of_another_search_is_refused(disc: SearchPlan, tmp_path: Path) -> None:
    folder = open_search_folder(disc, tmp_path / "out")
    save_search(disc, folder)
    with pytest.raises(UserError, match="holds another search: budget differ"):
        open_search_folder(replace(disc, budget=7), folder, resume=True)
    with pytest.raises(UserError, match="holds no search"):
        open_search_folder(disc, tmp_path / "elsewhere", resume=True)
    with pytest.raises(UserError, match=r"already holds search\.toml"):
        open_search_folder(disc, folder)


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The demo with its fault after two of four seconds, and a claim about it."""
    document = read(shipped()["demo"])
    document["duration"] = 4.0
    document["faults"][0] |= {"at": 2.0, "effectiveness": 1.0, "bias": 0.0}
    document["claims"] = [
        {
            "name": "tracking", "metric": "max_abs", "signal": "z - z_r", "uavs": [1], "window": [2.0, 4.0],
            "unit": "m", "source": "test", "expected": {"flight": 0.0}, "tolerance": "< 0.5",
        }
    ]  # fmt: skip
    path = tmp_path_factory.mktemp("scenario") / "short.toml"
    path.write_text(tomli_w.dumps(document))
    return path


def test_a_search_of_real_flights_ends_with_the_flight_that_breaks_the_claim(short: Path, tmp_path: Path) -> None:
    over = ["faults.0.bias=uniform(low=0, high=0.5)", "faults.0.effectiveness=uniform(low=0.5, high=1)"]
    search = plan_search(short, over, claim="tracking", budget=24)
    found = flown(search, tmp_path / "one", jobs=1)
    flown(search, tmp_path / "two", jobs=2)
    for name in ("search.parquet", "worst.toml"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    assert found.failing
    mission = resolve(load(tmp_path / "one" / "worst.toml"))
    (result,) = evaluate(fly_in_memory(mission), mission.claims, mission.case, mission.graph)
    worst = found.failing[0]
    assert result.ok is False
    assert result.value == worst.outcome.values[0]
    table = pq.read_table(tmp_path / "one" / "search.parquet")
    assert len(set(table.column_names)) == table.num_columns
    row = table.to_pylist()[worst.number]
    assert (row["tracking"], row["faults.0.bias"], row["distance"]) == (result.value, worst.values[0], worst.distance)
