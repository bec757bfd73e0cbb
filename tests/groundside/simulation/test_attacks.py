"""Attacks of a scenario in flight: who hears the lie, what is recorded of it, and what is refused."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ftcc.groundside import Run
from ftcc.groundside.scenario.catalogue import ScenarioError
from ftcc.groundside.scenario.loading import load
from ftcc.groundside.scenario.mission import Mission, resolve
from ftcc.groundside.simulation import simulate
from ftcc.groundside.simulation.flight import Flight

FORMS = ("flight", "monograph")
EDGE = "{at=0.5, kind='offset', edge=[1, 6], size=4.0}"
OWN = "{at=0.5, until=1.5, kind='offset', uav=1, size=4.0}"
SYBIL = "{at=0.5, kind='sybil', uav=4, as=5}"


def mission(*attacks: str, form: str = "flight", settings: Sequence[str] = (), **more: Any) -> Mission:
    listed = [f"attacks=[{', '.join(attacks)}]", *settings]
    return resolve(load("containment", form=form, settings=listed, duration=2.0, **more))


def flown(*attacks: str, form: str = "flight", settings: Sequence[str] = ()) -> Flight:
    return simulate(mission(*attacks, form=form, settings=settings))


def rows(flight: Flight, uav: int) -> dict[str, NDArray[np.float64]]:
    table = flight.lie_table()
    return {name: column[table["uav"] == uav] for name, column in table.items()}


def at(flight: Flight, name: str, uav: int, times: NDArray[np.float64]) -> NDArray[np.float64]:
    return flight.column(name, uav)[np.searchsorted(flight.t, times - 1e-9)]


@pytest.fixture(scope="module")
def healthy() -> dict[str, Flight]:
    return {form: flown(form=form) for form in FORMS}


@pytest.mark.parametrize("form", FORMS)
def test_who_lies_flies_on_and_is_believed(form: str, healthy: dict[str, Flight]) -> None:
    flight = flown(OWN, form=form)
    told = rows(flight, 1)
    assert (told["t"][0], told["t"][-1]) == pytest.approx((0.5, 1.45 if form == "flight" else 1.49))
    assert np.array_equal(told["true_zhat"], at(flight, "zhat", 1, told["t"]))
    assert np.array_equal(told["told_zhat"], told["true_zhat"] + 4.0)
    assert np.array_equal(told["told_v"], told["true_v"])
    # UAV 2 hears UAV 1, and believes it; UAV 1 itself is led astray only by what others make of it.
    before = healthy[form].t < 0.5
    for uav in (1, 2, 6):
        differs = flight.column("zhat", uav) - healthy[form].column("zhat", uav)
        assert not differs[before].any()
        assert differs.max() > 0.0
    first = np.argmax(flight.column("zhat", 2) != healthy[form].column("zhat", 2))
    astray = [flight.column("zhat", uav)[first] - healthy[form].column("zhat", uav)[first] for uav in (1, 2)]
    assert abs(astray[0]) < 0.2 * astray[1]


@pytest.mark.parametrize("form", FORMS)
def test_a_lie_on_an_edge_is_heard_there_alone(form: str, healthy: dict[str, Flight]) -> None:
    flight = flown(EDGE, form=form)
    told = rows(flight, 1)
    assert set(told["receiver"]) == {6}
    assert np.array_equal(told["true_zhat"], at(flight, "zhat", 1, told["t"]))
    assert np.array_equal(told["told_zhat"], told["true_zhat"] + 4.0)
    differs = {uav: flight.column("zhat", uav) - healthy[form].column("zhat", uav) for uav in (2, 6)}
    first = np.argmax(differs[6] != 0.0)
    assert flight.t[first] == pytest.approx(0.56 if form == "flight" else 0.51)
    assert abs(differs[2][first]) < 0.01 * differs[6][first]


@pytest.mark.parametrize("form", FORMS)
def test_a_sybil_is_heard_in_the_name_of_its_victim(form: str) -> None:
    """UAV 3 hears UAVs 4 and 5; nobody else hears both."""
    flight = flown(SYBIL, "{at=0.2, kind='offset', uav=4, size=2.0}", form=form)
    told = rows(flight, 5)
    assert set(told["receiver"]) == {3}
    assert np.array_equal(told["true_zhat"], at(flight, "zhat", 5, told["t"]))
    assert np.array_equal(told["told_zhat"], at(flight, "zhat", 4, told["t"]) + 2.0)


def test_in_an_authenticated_network_nobody_speaks_in_anothers_name(healthy: dict[str, Flight]) -> None:
    settings = ["network.authenticated=true"]
    planned = mission(SYBIL, settings=settings)
    (warning,) = planned.warnings
    assert "does nothing: the network is authenticated" in warning
    assert not planned.events
    flight = simulate(planned)
    assert np.array_equal(flight.column("zhat", 3), healthy["flight"].column("zhat", 3))
    # Who signs what it tells can lie all the same.
    assert len(flown(OWN, settings=settings).lies)


def test_those_who_collude_tell_the_same() -> None:
    flight = flown("{at=0.5, kind='collude', uavs=[1, 4], size=1100.0, rate=2.0}")
    one, other = rows(flight, 1), rows(flight, 4)
    assert np.array_equal(one["told_zhat"], other["told_zhat"])
    assert one["told_zhat"] == pytest.approx(1100.0 + 2.0 * (one["t"] - 0.5))
    assert not np.array_equal(one["true_zhat"], other["true_zhat"])


def test_a_leader_lies_about_what_leaders_share() -> None:
    flight = flown("{at=0.5, kind='drift', uav=7, rate={z=2.0}, signals=['z']}")
    told = rows(flight, 7)
    assert told["told_z"] == pytest.approx(told["true_z"] + 2.0 * (told["t"] - 0.5))
    assert np.array_equal(told["told_V"], told["true_V"])
    assert np.isnan(told["told_zhat"]).all()


def test_lies_within_an_exchange_that_is_settled_by_iteration() -> None:
    """The nearest-neighbour rule with ideal exchange: what is told belongs to the values that are settled on."""
    settings = ["attacks=[{at=0.2, kind='offset', uav=2, size={z=3.0}, signals=['z']}]"]
    planned = resolve(load("nearest_neighbour", form="monograph", settings=settings, duration=0.4))
    flight = simulate(planned)
    told = rows(flight, 2)
    assert len(told["t"]) == np.count_nonzero(flight.t > 0.2 - 1e-9)
    assert np.array_equal(told["told_z"], told["true_z"] + 3.0)
    assert np.array_equal(told["told_V_dot"], told["true_V_dot"])
    assert told["true_z"] == pytest.approx(at(flight, "z", 2, told["t"]), abs=1e-9)


def test_a_run_has_what_the_flight_in_memory_has(tmp_path: Path) -> None:
    planned = mission(OWN, EDGE, SYBIL, "{at=0.1, kind='noise', uav=7, size=0.5}")
    flight, run = simulate(planned), simulate(planned, tmp_path / "run")
    assert isinstance(run, Run)
    told, ours = run.lies, flight.lie_table()
    assert list(told) == list(ours)
    assert all(np.array_equal(told[name], ours[name], equal_nan=True) for name in told)
    texts = [event["text"] for event in run.events if event["uav"] == 1]
    assert texts[:3] == ["lies to UAV 6: offset: size 4", "lies: offset: size 4", "tells the truth again"]
    assert not simulate(mission(), tmp_path / "healthy").lies["t"].size
    assert not (tmp_path / "healthy" / "lies.parquet").exists()


REFUSED = {
    "{at=0, kind='offset', uav=1}": 'kind = "offset" needs size',
    "{at=0, kind='freeze', uav=1, size=1.0}": 'kind = "freeze" takes no size',
    "{at=0, kind='freeze', uav=1, edge=[1, 2]}": "needs one of uav = n, uavs = [..] and edge = [sender, receiver]",
    "{at=2, until=1, kind='freeze', uav=1}": "until = 1 must be later than at = 2",
    "{at=0, kind='offset', uav=1, size=inf}": "finite",
    "{at=0, kind='oscillate', uav=1, size=1.0, period=0.0}": "greater than 0",
    "{at=0, kind='offset', uav=9, size=1.0}": "there is no UAV 9; UAVs are 1, 2, 3, 4, 5, 6, 7, 8",
    "{at=0, kind='freeze', edge=[1, 3]}": "there is no such edge in the graph; UAV 3 hears 2, 4, 5",
    "{at=0, kind='freeze', uav=1, signals=['z']}": "UAV 1, a follower: it shares no z; it shares zhat, v",
    "{at=0, kind='freeze', uav=7, signals=['zhat']}": "a leader: it shares no zhat; it shares z, z_dot, V, V_dot",
    "{at=0, kind='offset', uav=1, size={z=1.0}}": "tells no lie about z; it does about zhat",
    "{at=0, kind='replay', uav=1, delay=1000.0}": "must be 0.05 to 819.15 s, 1 to 16383 exchange periods",
    "{at=0, kind='replay', uav=1, delay=1.0, period=2.0}": "the window must be over at = 0: at most the delay",
    "{at=0, kind='collude', uavs=[1], size=1.0}": "with at least two UAVs",
    "{at=0, kind='collude', uavs=[1, 1], size=1.0}": "a UAV is listed twice",
    "{at=0, kind='sybil', uav=1, as=1}": "must be another UAV than who speaks",
    "{at=0, kind='sybil', uav=1, as=2}": "no UAV hears both UAV 1 and UAV 2",
    "{at=0, kind='sybil', uav=7, as=1}": "a follower shares other values than UAV 7, a leader",
    "{at=0, kind='lie', uav=1}": "kind",
}


@pytest.mark.parametrize(("attack", "why"), REFUSED.items())
def test_an_attack_that_cannot_be_is_refused(attack: str, why: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        mission(attack)
    assert why in str(refused.value)
    assert "attacks" in str(refused.value)
