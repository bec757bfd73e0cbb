"""Defences of a scenario: the `DefenceSpec` of every follower, and whether law and graph can live with them."""

from __future__ import annotations

from ftcc.airside.defence.gains import DefenceGains, defence_gains
from ftcc.airside.law_checks import ignores_trust
from ftcc.airside.law_errors import package_of
from ftcc.airside.scheme import Scheme
from ftcc.airside.spec import DefenceSpec
from ftcc.groundside.scenario.checks import Findings
from ftcc.groundside.schema import Plan
from ftcc.link.graph import Assumption, Graph
from ftcc.link.robustness import Standing, edges_that_raise, robustness_of, strong_robustness

__all__ = ["defence_of", "robustness_text", "tolerated"]

_UNDIRECTED = (
    Assumption.UNDIRECTED_LEADERS_REACH_ALL,
    Assumption.ONE_LEADER_UNDIRECTED,
    Assumption.CONNECTED_UNDIRECTED,
)
_MOST_EDGES = 12
"""Edges that a warning proposes."""


def defence_of(plan: Plan, scheme: Scheme, graph: Graph, findings: Findings) -> DefenceSpec:
    """Return what every follower has of defences; refuse settings and ids that there are not."""
    fields = plan.defence
    if fields is None:
        return DefenceSpec()
    try:
        gains = defence_gains(fields.given)
    except ValueError as error:
        findings.refuse(f"defence: {error}")
        return DefenceSpec()
    trusted: set[int] = set()
    for n, one in enumerate(fields.trusted):
        if one == "leaders":
            trusted.update(graph.leaders)
        elif one in graph.uavs:
            trusted.add(int(one))
        else:
            findings.refuse(f"defence.trusted.{n}: there is no UAV {one}; UAVs are {_listed(graph.uavs)}")
    if (why := ignores_trust(package_of(scheme.module))) is not None:
        findings.warn(f"defence: nothing is defended: {why}")
    spec = DefenceSpec(True, tuple(gains), tuple(sorted(trusted)), graph.leaders)
    _check_robustness(scheme, graph, spec, gains, findings)
    return spec


def tolerated(scheme: Scheme, graph: Graph, trusted: tuple[int, ...] = ()) -> Standing:
    """Return how robust the graph is in the sense that the scheme needs.

    Leaders that share something are what followers must agree with, or stay between: then strong robustness with
    respect to them, `link.robustness.strong_robustness`; otherwise r-robustness of all who hear others.
    """
    if _is_led(scheme, graph):
        return strong_robustness(graph, trusted)
    return robustness_of(graph)


def _is_led(scheme: Scheme, graph: Graph) -> bool:
    return bool(graph.leaders and scheme.shared.get("leader"))


def robustness_text(scheme: Scheme, graph: Graph, spec: DefenceSpec) -> str:
    """Return what `ftcc check` says of the graph: how robust it is, and how many liars that stands."""
    found = tolerated(scheme, graph, spec.trusted)
    trusted = ", its leaders trusted" if _is_led(scheme, graph) and set(graph.leaders) <= set(spec.trusted) else ""
    strong = _is_led(scheme, graph)
    kind = f"strongly {found}-robust towards its leaders{trusted}" if strong else f"{found}-robust"
    if found.least == len(graph.uavs):
        return "every follower hears a trusted UAV: with [defence] it stands any number of lying neighbours"
    return f"the graph is {kind}: {_stands(found, strong)}"


def _stands(found: Standing, strong: bool) -> str:
    F = max((found.least - 1) // 2, 0)
    source = "Usevitch and Panagou, 2020" if strong else "LeBlanc et al., 2013, theorem 2"
    how_many = f"F = {F} lying neighbours of each follower" if F else "no lying neighbour"
    return f"with [defence] it stands {how_many} (needs 2 F + 1; {source})"


def _check_robustness(scheme: Scheme, graph: Graph, spec: DefenceSpec, gains: DefenceGains, findings: Findings) -> None:
    """Warn where the defences count on more honest neighbours than the graph gives."""
    for name, F in (("F", int(gains.F)), ("hull", int(gains.hull))):
        if F == 0:
            continue
        found = tolerated(scheme, graph, spec.trusted)
        if found.most < 2 * F + 1 or (found.least < 2 * F + 1 and found.least == found.most):
            edges = _proposal(scheme, graph, spec, 2 * F + 1)
            findings.warn(f"defence.{name} = {F}: {robustness_text(scheme, graph, spec)}{edges}")
        elif found.least < 2 * F + 1:
            findings.warn(f"defence.{name} = {F}: {robustness_text(scheme, graph, spec)}; more is not known of it")


def _proposal(scheme: Scheme, graph: Graph, spec: DefenceSpec, wanted: int) -> str:
    """Return edges that would make the graph robust enough, or what stands against it."""
    led, both_ways = _is_led(scheme, graph), scheme.graph in _UNDIRECTED
    vouching = set(spec.trusted) & set(graph.leaders)
    if led and not vouching and len(graph.leaders) < wanted:
        return f"; that needs {wanted} leaders, or a trusted one (defence.trusted)"
    if not led and wanted > (len(graph.uavs) + 1) // 2:
        return f"; that needs {2 * wanted - 1} UAVs, all of which hear each other"
    edges = edges_that_raise(graph, wanted, led, spec.trusted, both_ways, _MOST_EDGES)
    if edges is None:
        return f"; it would need more than {_MOST_EDGES} further edges"
    words = (f"{sender}{'-' if both_ways and sender in graph.followers else '->'}{uav}" for sender, uav in edges)
    return f"; these further edges would do: {', '.join(words)}"


def _listed(uavs: tuple[int, ...]) -> str:
    return ", ".join(map(str, uavs))
