"""Flights that several tests look at, flown once."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import tomli_w

from ftcc.groundside.claims import Result, evaluate
from ftcc.groundside.mission import Mission, resolve
from ftcc.groundside.run import Run
from ftcc.groundside.scenario import load, read, shipped
from ftcc.groundside.simulate import fly, simulate


def mission_of(case: str, **options: Any) -> Mission:
    """The mission of a case of the containment scenario, such as "flight+P+off"."""
    form, *variants = case.split("+")
    return resolve(load("containment", form=form, variants=variants, **options))


@pytest.fixture(scope="session")
def results_of() -> Callable[[str], dict[str, Result]]:
    """The claims of a case of the containment scenario after its flight, by name."""

    @functools.cache
    def flown(case: str) -> dict[str, Result]:
        mission = mission_of(case)
        flight = fly(mission)
        assert flight.lost == {}
        return {result.claim.name: result for result in evaluate(flight, mission.claims, case, mission.graph)}

    return flown


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
