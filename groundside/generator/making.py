"""From a request to a scenario that is checked and flown before anybody gets it."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from ftcc.airside.scheme import Scheme
from ftcc.groundside.claims import Result
from ftcc.groundside.generator.graphs import RequestError, graph_of
from ftcc.groundside.generator.request import Request
from ftcc.groundside.generator.swarm import DrawnFault, drawn_faults
from ftcc.groundside.generator.writing import SETTLED, text_of
from ftcc.groundside.scenario import Scenario, ScenarioError, load, resolve, trims_under_faults
from ftcc.groundside.simulation import claims_in_flight
from ftcc.link.graph import Graph

__all__ = ["Made", "make_scenario"]

_SEVERITIES = (1.0, 0.7, 0.5, 0.3, 0.15)
"""Of the faults, until each leaves a level trim."""
_LEAST_MARGIN = 0.25
"""Of the command that level flight needs from the end of its travel, over half the travel."""


class Made(NamedTuple):
    """A scenario, and how it flew."""

    text: str
    results: list[Result]
    warnings: tuple[str, ...]


def make_scenario(request: Request, command: str) -> Made:
    """Return the scenario that a request asks for; its claims hold in the flight that it has made.

    ``command`` stands in its first line.

    Raises
    ------
    RequestError
        If there can be no such swarm (naming the assumption that it breaks), or if its flight does not meet the claims.
    """
    scheme = request.law()
    leaders = request.leader_count(scheme)
    ids = tuple(range(1, request.followers + leaders + 1))
    followers, leading = ids[: request.followers], ids[request.followers :]
    graph = graph_of(request.graph, followers, leading, request.directed, request.seed, scheme.graph)
    faults = _faults(request, command, scheme, graph)
    flight, results = claims_in_flight(_scenario(text_of(request, command, scheme, graph, faults, {})))
    if flight.lost:
        uav, (t, why) = next(iter(flight.lost.items()))
        raise RequestError(f"flown, UAV {uav} was lost at {t:g} s ({why}); nothing is written")
    measured = {
        result.claim.name: math.ceil(10.0 * result.value) / 10.0
        for result in results
        if result.claim.name.endswith(SETTLED) and isinstance(result.value, float)
    }
    text = text_of(request, command, scheme, graph, faults, measured)
    mission = resolve(_scenario(text))
    results = replace(flight, mission=mission).claims()  # the same flight, held to what it has shown
    broken = [result for result in results if not result.ok]
    if broken:
        said = "; ".join(f"{r.claim.name}: {r.value} {r.claim.unit}, {r.tolerance}" for r in broken)
        raise RequestError(f"flown, it does not meet what any swarm should: {said}; nothing is written")
    return Made(text, results, mission.warnings)


def _faults(request: Request, command: str, scheme: Scheme, graph: Graph) -> Sequence[DrawnFault]:
    """Faults that leave level flight with travel to spare."""
    _scenario(text_of(request, command, scheme, graph, (), {}))  # what is refused without faults is not theirs
    if not request.faults:
        return ()
    for severity in _SEVERITIES:
        faults = drawn_faults(request, graph, scheme, severity)
        try:
            scenario = _scenario(text_of(request, command, scheme, graph, faults, {}))
        except RequestError:
            continue
        demands = trims_under_faults(scenario)
        if all(
            demand.margin(faults[n].effectiveness, faults[n].bias) >= _LEAST_MARGIN
            for n, those in demands.items()
            for demand in those
        ):
            return faults
    raise RequestError(f"--faults {request.faults}: even small ones leave no level trim with this aircraft")


def _scenario(text: str) -> Scenario:
    """Check a scenario as a whole, as if it lay in a file."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "swarm.toml"
        file.write_text(text, encoding="utf-8")
        try:
            scenario = load(file)
            resolve(scenario)
        except ScenarioError as error:
            raise RequestError("; ".join(error.problems)) from None
    return scenario
