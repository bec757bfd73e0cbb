"""A scenario from one line: valid by construction, flown before it is handed over, refused with the reason."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from ftcc.airside import schemes
from ftcc.groundside.cli.app import app
from ftcc.groundside.generator import KINDS, Request, RequestError, make_scenario
from ftcc.groundside.generator.graphs import graph_of, pairs_of
from ftcc.groundside.scenario import load, resolve
from ftcc.groundside.simulation import claims_in_flight
from ftcc.link.graph import Assumption

SCHEMES = [name for name in schemes.names() if (schemes.find(name).module.__name__).startswith("ftcc.")]
GRAPHS = (*KINDS, "nearest:3", "random:.6")
LARGE = "FTCC_SWARMS" in os.environ
"""All graphs in three sizes, which takes ten minutes."""


def swarms() -> list[Request]:
    if LARGE:
        return [
            Request(scheme, size, graph=graph, faults=2)
            for scheme in SCHEMES
            for graph in KINDS
            for size in (4, 20, 100)
        ]
    return [
        Request(scheme, 5, graph=graph, faults=2, seed=n, loss=0.1)
        for n, (scheme, graph) in enumerate(zip(SCHEMES, GRAPHS, strict=True))
    ]


def degrees(request_: Request) -> list[int]:
    """Of the followers' graph."""
    pairs = pairs_of(request_.graph, request_.followers, request_.seed)
    return [sum(n in pair for pair in pairs) for n in range(request_.followers)]


@pytest.mark.parametrize("request_", swarms(), ids=lambda r: f"{r.scheme}-{r.graph}-{r.followers}")
def test_every_scheme_flies_on_its_graph_and_meets_its_claims(request_: Request, tmp_path: Path) -> None:
    if request_.scheme == "attitude_synchronization" and max(degrees(request_)) > 16:
        with pytest.raises(RequestError, match="at most 16 can be filtered"):
            make_scenario(request_, "ftcc new mine.toml")
        return
    made = make_scenario(request_, "ftcc new mine.toml")
    file = tmp_path / "mine.toml"
    file.write_text(made.text)
    scenario = load(file)
    mission = resolve(scenario)
    assert len(mission.graph.followers) == request_.followers
    assert sum(len(vehicle.faults) for vehicle in mission.vehicles) == 2
    flight, results = claims_in_flight(scenario)
    assert not flight.lost
    assert len(results) >= 3
    assert all(result.ok for result in results)


@pytest.mark.parametrize("kind", [*KINDS, "nearest:4", "random:.2"])
@pytest.mark.parametrize("count", [1, 2, 6, 20])
def test_graphs_reach_every_follower_with_weights_below_one(kind: str, count: int) -> None:
    if kind == "nearest:4" and count <= 4:
        pytest.skip("so many neighbours there are not")
    followers, leaders = tuple(range(1, count + 1)), (count + 1,)
    graph = graph_of(kind, followers, leaders, False, 3, Assumption.ONE_LEADER_UNDIRECTED)
    among = graph.adjacency[:count, :count]
    assert np.array_equal(among, among.T)
    assert among.sum(axis=1).max() < 1.0
    assert graph.receivers(leaders[0])


def test_two_hundred_aircraft_are_one_line(tmp_path: Path) -> None:
    made = make_scenario(
        Request(followers=190, leaders=10, graph="grid", faults=20, duration=40), "ftcc new large.toml"
    )
    (tmp_path / "large.toml").write_text(made.text)
    mission = resolve(load(tmp_path / "large.toml"))
    assert len(mission.uavs) == 200
    assert all(mission.graph.receivers(leader) for leader in mission.graph.leaders)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("--scheme prescribed_performance --leaders 2", "the scheme assumes that there is one leader"),
        ("--directed", "the followers' edges are undirected (a_ij = a_ji)"),
        ("--scheme fire_monitoring --directed", "the edges are undirected (a_ij = a_ji) and connect all UAVs"),
        ("--graph random:.01 --followers 12", "100 draws with 12 UAVs, none of them connected"),
        ("--graph nearest:6", "nearest:K with K from 1 to 5"),
        ("--graph web", "--graph web: must be ring, chain, star"),
        ("--scheme attitude_synchronization --leaders 1", "scheme attitude_synchronization has no leaders"),
        ("--scheme attitude_synchronization --graph star --followers 20", "hears 19 neighbours; at most 16"),
        ("--scheme fire_monitoring --spacing 800 --followers 20", "come within"),
        ("--scheme nonsense", "there is no such scheme; there are attitude_synchronization"),
        ("--followers 199 --leaders 2", "must be from 1 to 200"),
        ("--faults 7", "one for each follower"),
        ("--loss nan", "must be from 0 to 0.9"),
        ("--duration 5", "--duration 5: must be from 40"),
    ],
)
def test_what_cannot_be_is_refused_by_name_and_writes_nothing(options: str, said: str, tmp_path: Path) -> None:
    answer = CliRunner().invoke(app, ["new", str(tmp_path / "mine.toml"), *options.split()])
    assert isinstance(answer.exception, RequestError)
    assert said in str(answer.exception)
    assert not list(tmp_path.iterdir())


def test_the_command_writes_a_file_once(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    answer = CliRunner().invoke(app, ["new", str(file), "--followers", "3", "--graph", "chain"])
    assert answer.exit_code == 0, answer.output
    assert "all 6 claims hold" in answer.output
    text = file.read_text()
    assert CliRunner().invoke(app, ["new", str(file)]).exit_code == 2
    assert file.read_text() == text
    assert CliRunner().invoke(app, ["new", str(tmp_path / "mine.claims.toml")]).exit_code == 2
    assert CliRunner().invoke(app, ["new", str(tmp_path / "nowhere" / "mine.toml")]).exit_code == 2
