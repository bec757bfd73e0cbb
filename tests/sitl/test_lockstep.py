"""A flight with processes equals the single-process simulation, bit for bit."""

from __future__ import annotations

import re
import socket
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from ftcc.groundside.dashboard.feed import feed_path, watch_swarm
from tests.bench.swarms import swarm_file
from tests.sitl.conftest import Flight, events, same_flight

DURATION = "30"


def changes_of_belief(folder: Path) -> list[tuple[object, object, object, str]]:
    """Time, UAV, severity and text of the events in which a UAV tells what it believes of an actuator."""
    words = re.compile("something is wrong|faulty|fault has changed|healthy again")
    listed = [(event["t"], event["uav"], event["severity"], str(event["text"])) for event in events(folder)]
    return [event for event in listed if words.search(event[3])]


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Run folder of `ftcc simulate containment` with the given variants and seed."""
    from ftcc.groundside.scenario.loading import load
    from ftcc.groundside.scenario.mission import resolve
    from ftcc.groundside.simulation import simulate

    def run(variants: tuple[str, ...] = (), seed: int = 1) -> Path:
        folder = tmp_path_factory.mktemp("simulated") / "run"
        scenario = load("containment", form="flight", variants=variants, seed=seed, duration=float(DURATION))
        simulate(resolve(scenario), folder)
        return folder

    return run


def test_sixteen_processes_equal_the_simulation(fly: Callable[..., Flight], simulated: Callable[..., Path]) -> None:
    flight = fly("containment", "--speed", "max", "--duration", DURATION, "--seed", "1")
    assert flight.wait() == 0, flight.output
    assert same_flight(flight.folder, simulated())


def test_who_distrusts_whom_is_the_same_in_processes(fly: Callable[..., Flight], tmp_path: Path) -> None:
    """Every defence at once, and a liar from 2 s on."""
    import pyarrow.parquet as pq

    from ftcc.groundside import simulate

    settings = [
        "defence={F=1, jump=1.0, past=1.0, crowd=30.0, oldest=1.0, hull=1}",
        'attacks=[{at=2.0, kind="offset", uav=2, size=40.0}]',
    ]
    options = [word for setting in settings for word in ("--set", setting)]
    flight = fly("containment", "--speed", "max", "--duration", "6", "--seed", "1", "--pack", "auto", *options)
    assert flight.wait() == 0, flight.output
    alone = tmp_path / "alone"
    simulate("containment", alone, form="flight", settings=settings, seed=1, duration=6.0)
    assert same_flight(flight.folder, alone)
    assert min(pq.read_table(alone / "links.parquet").column("trust").to_pylist()) < 0.2
    told = [
        {(event["t"], event["uav"], event["text"]) for event in events(folder) if "distrusts" in str(event["text"])}
        for folder in (flight.folder, alone)
    ]
    assert told[0] == told[1] != set()


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
    flight = fly("containment", "--speed", "10", "--duration", DURATION, "--seed", "1", "--hold", "--pack", "auto")
    name = flight.folder.name
    flight.wait_until(lambda: feed_path(name).exists() and "held" in flight.output)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as idle:
        idle.connect(str(feed_path(name)))
        with ThreadPoolExecutor() as pool:
            # It begins before the flight does: afterwards a slow computer may have flown most of it.
            reading = pool.submit(lambda: [one.t for one, _ in zip(watch_swarm(name), range(5), strict=False)])
            assert ftcc("resume").returncode == 0
            seen = reading.result(60.0)
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


@pytest.mark.parametrize(("uavs", "arguments"), [(4, ("--speed", "200")), (60, ("--speed", "100", "--pack", "auto"))])
def test_a_computer_that_is_too_slow_slows_time_down_and_loses_nobody(
    fly: Callable[..., Flight], busy_machine: None, tmp_path: Path, uavs: int, arguments: tuple[str, ...]
) -> None:
    """Asked for more than it can do, beside other programs: the flight is that of the simulation, only slower."""
    from ftcc.groundside.scenario.loading import load
    from ftcc.groundside.scenario.mission import resolve
    from ftcc.groundside.simulation import simulate

    swarm = swarm_file(tmp_path, uavs, duration=20.0)
    flight = fly(str(swarm), *arguments)
    assert flight.wait(240) == 0, flight.output
    simulate(resolve(load(str(swarm))), tmp_path / "simulated")
    assert same_flight(flight.folder, tmp_path / "simulated")
    (over,) = [event for event in events(flight.folder) if "factor" in event]
    assert (over["late"], over["asked"]) == (0, float(arguments[1]))
    assert 0.0 < over["factor"] < over["asked"]  # type: ignore[operator]


def test_plain_python_flies_the_same_flight_with_processes(
    fly: Callable[..., Flight], tmp_path: Path, environment: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same functions from datagram to datagram, not compiled."""
    from ftcc.groundside.scenario.loading import load
    from ftcc.groundside.scenario.mission import resolve
    from ftcc.groundside.simulation import simulate

    scenario = ("containment", "--variant", "loss30", "--duration", "1", "--speed", "max", "--pack", "4")
    environment["NUMBA_DISABLE_JIT"] = "1"
    flight = fly(*scenario)
    assert flight.wait() == 0, flight.output
    simulate(resolve(load("containment", form="flight", variants=("loss30",), duration=1.0)), tmp_path / "simulated")
    assert same_flight(flight.folder, tmp_path / "simulated")


def test_a_swarm_in_which_one_hears_nobody_and_one_is_heard_by_nobody_flies(
    fly: Callable[..., Flight], tmp_path: Path
) -> None:
    """A leader waits for the acknowledgement of a follower that has nobody to tell anything."""
    flight = fly(str(swarm_file(tmp_path, 2, duration=20.0)), "--speed", "max")
    assert flight.wait() == 0, flight.output


def test_a_swarm_that_makes_room_equals_the_simulation(fly: Callable[..., Flight], tmp_path: Path) -> None:
    """UAV 1 leaves: health travels over edges that only leaders use, through a lossy channel, between processes."""
    from ftcc.groundside.scenario.loading import load
    from ftcc.groundside.scenario.mission import resolve
    from ftcc.groundside.simulation import simulate

    settings = [
        "diagnosis.on=true",
        "diagnosis.cooperate=true",
        "diagnosis.gains.drift_elevator=0.03",
        "diagnosis.gains.limit_elevator=0.006",
        "disturbances=[]",
        "faults=[{at=16.0,uav=1,actuator='elevator',effectiveness=0.4,bias=0.15,without_trim=true}]",
    ]
    mission = resolve(load("containment", variants=("loss30",), settings=settings, duration=30.0))
    simulate(mission, tmp_path / "simulated")
    said = [event["text"] for event in events(tmp_path / "simulated")]
    assert "leaves the swarm: it cannot keep up" in said
    given = [part for setting in settings for part in ("--set", setting)]
    flight = fly("containment", "--variant", "loss30", "--duration", "30", "--speed", "max", *given)
    assert flight.wait(240) == 0, flight.output
    assert same_flight(flight.folder, tmp_path / "simulated")
    ours, theirs = (changes_of_belief(folder) for folder in (flight.folder, tmp_path / "simulated"))
    assert ours == theirs
    assert [uav for _, uav, _, text in ours if "something is wrong" in text] == [1]
    assert "elevator faulty" in ours[1][3]
