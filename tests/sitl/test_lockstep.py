"""A flight with processes equals the single-process simulation, bit for bit."""

from __future__ import annotations

import multiprocessing
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from ftcc.groundside.feed import feed_path, watched
from tests.sitl.conftest import Flight, same_flight

DURATION = "30"


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Run folder of `ftcc simulate containment` with the given variants and seed."""
    from ftcc.groundside.mission import resolve
    from ftcc.groundside.scenario import load
    from ftcc.groundside.simulate import simulate

    def run(variants: tuple[str, ...] = (), seed: int = 1) -> Path:
        folder = tmp_path_factory.mktemp("simulated") / "run"
        scenario = load("containment", form="flight", variants=variants, seed=seed, duration=float(DURATION))
        simulate(resolve(scenario), folder)
        return folder

    return run


def burn() -> None:
    while True:
        sum(range(1000))


@pytest.fixture
def busy_machine() -> Iterator[None]:
    """Two processes that take what they can get of both cores."""
    workers = [multiprocessing.get_context("spawn").Process(target=burn, daemon=True) for _ in range(2)]
    for worker in workers:
        worker.start()
    yield
    for worker in workers:
        worker.kill()
        worker.join()


def test_sixteen_processes_equal_the_simulation(fly: Callable[..., Flight], simulated: Callable[..., Path]) -> None:
    flight = fly("containment", "--speed", "max", "--duration", DURATION, "--seed", "1")
    assert flight.wait() == 0, flight.output
    assert same_flight(flight.folder, simulated())


def test_with_loss_on_a_loaded_machine_too(
    fly: Callable[..., Flight], simulated: Callable[..., Path], busy_machine: None
) -> None:
    flight = fly("containment", "--variant", "loss30", "--speed", "max", "--duration", DURATION, "--seed", "1")
    assert flight.wait(240) == 0, flight.output
    assert same_flight(flight.folder, simulated(("loss30",)))


def test_who_watches_changes_nothing(
    fly: Callable[..., Flight],
    simulated: Callable[..., Path],
    ftcc: Callable[..., Any],
    environment: dict[str, str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One reads for a while and leaves, one never reads."""
    monkeypatch.setenv("FTCC_RUNTIME_DIR", environment["FTCC_RUNTIME_DIR"])
    flight = fly("containment", "--speed", "max", "--duration", DURATION, "--seed", "1", "--hold", "--pack", "auto")
    flight.wait_until(lambda: feed_path(flight.folder.name).exists() and "held" in flight.output)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as idle:
        idle.connect(str(feed_path(flight.folder.name)))
        assert ftcc("resume").returncode == 0
        seen = [snapshot.t for snapshot, _ in zip(watched(flight.folder.name), range(5), strict=False)]
        assert flight.wait() == 0, flight.output
    assert seen == sorted(seen)
    assert len(seen) == 5
    assert same_flight(flight.folder, simulated())


@pytest.mark.parametrize(
    ("pack", "variant"), [("3", "loss30"), ("auto", "loss30"), ("auto", "sixdof")], ids=["3", "auto", "sixdof"]
)
def test_packed_vehicles_equal_the_simulation(
    fly: Callable[..., Flight], simulated: Callable[..., Path], pack: str, variant: str
) -> None:
    """Also those in six degrees of freedom, whose autopilots command all four actuators."""
    flight = fly(
        "containment", "--variant", variant, "--speed", "max", "--duration", DURATION, "--seed", "1", "--pack", pack
    )
    assert flight.wait() == 0, flight.output
    assert same_flight(flight.folder, simulated((variant,)))


def test_another_seed_is_another_flight_only_where_chance_plays(simulated: Callable[..., Path]) -> None:
    assert same_flight(simulated((), 1), simulated((), 2))
    assert not same_flight(simulated(("loss30",), 1), simulated(("loss30",), 2))
