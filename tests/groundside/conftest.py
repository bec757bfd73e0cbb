"""Flights that several tests look at, flown once."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import tomli_w

from ftcc.groundside.claims.claims import Result
from ftcc.groundside.results import Run
from ftcc.groundside.scenario.loading import load, read, shipped
from ftcc.groundside.scenario.mission import Mission, resolve
from ftcc.groundside.simulation import simulate
from ftcc.groundside.simulation.cases import claims_in_flight, load_case


def mission_of(case: str, scenario: str = "containment", **options: Any) -> Mission:
    """The mission of a case of a scenario, such as "flight+P+off"."""
    return resolve(load_case(scenario, case, **options))


@pytest.fixture(scope="session")
def results_of() -> Callable[..., dict[str, Result]]:
    """The claims of a case of a scenario (default: containment) after its flight, by name."""

    @functools.cache
    def flown(case: str, scenario: str = "containment") -> dict[str, Result]:
        flight, results = claims_in_flight(load_case(scenario, case))
        assert flight.lost == {}
        return {result.claim.name: result for result in results}

    return flown


def failing(results: dict[str, Result]) -> dict[str, str]:
    """What the claims that do not hold say."""
    return {
        name: f"{result.value} instead of {result.expected} ({result.tolerance})"
        for name, result in results.items()
        if not result.ok
    }


@pytest.fixture(scope="session")
def demo_run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """The demo, flown and recorded."""
    return simulate(resolve(load("demo")), tmp_path_factory.mktemp("runs") / "demo")


@pytest.fixture
def edited(tmp_path: Path) -> Iterator[Callable[..., Path]]:
    """Write a changed demo scenario: the function that is given changes the document in place."""

    def write(change: Callable[[dict[str, Any]], None], name: str = "edited.toml") -> Path:
        document = read(shipped()["demo"])
        change(document)
        path = tmp_path / name
        path.write_text(tomli_w.dumps(document))
        return path

    return write
