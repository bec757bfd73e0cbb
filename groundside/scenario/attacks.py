"""The attacks of a scenario, by the autopilot in which each acts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from ftcc.airside.attacks.attack import FOR_EVER, Attack, touched, values_by_signal
from ftcc.airside.scheme import Scheme
from ftcc.groundside.scenario.checks import Findings
from ftcc.groundside.schema import AttackFields, Plan
from ftcc.link.attacks import LONGEST, attack_text
from ftcc.link.graph import Graph
from ftcc.link.timing import Timing

__all__ = ["attack_texts", "attacks_of"]


def attacks_of(
    plan: Plan, scheme: Scheme, graph: Graph, timing: Timing, findings: Findings
) -> dict[int, tuple[Attack, ...]]:
    """Return the attacks that act in each UAV's autopilot, in the order of the file; refuse those that cannot act.

    A lie to everybody acts where it is told, one to a single receiver and one in another's name where they are heard.
    """
    found: dict[int, list[Attack]] = {}
    for n, fields in enumerate(plan.attacks):
        where = f"attacks.{n}"
        before = len(findings.refused)
        _check_uavs(fields, where, graph, findings)
        if len(findings.refused) == before:
            _check_signals(fields, where, scheme, graph, findings)
            _check_delay(fields, where, timing, findings)
        if len(findings.refused) > before:
            continue
        for uav, attack in _by_uav(n, fields, scheme, graph):
            found.setdefault(uav, []).append(attack)
        if fields.kind == "sybil":
            _check_name(fields, where, plan, graph, findings)
    return {uav: tuple(own) for uav, own in found.items()}


def _role(uav: int, graph: Graph) -> str:
    return "leader" if uav in graph.leaders else "follower"


def _check_uavs(fields: AttackFields, where: str, graph: Graph, findings: Findings) -> None:
    there_are = f"UAVs are {', '.join(map(str, graph.uavs))}"
    named = [*fields.liars, *(fields.edge or ())[1:], *([fields.victim] if fields.victim is not None else [])]
    for uav in named:
        if uav not in graph.uavs:
            findings.refuse(f"{where}: there is no UAV {uav}; {there_are}")
    if fields.edge is not None and (fields.edge[1], fields.edge[0]) not in graph.weights:
        heard = ", ".join(map(str, graph.senders(fields.edge[1]))) if fields.edge[1] in graph.uavs else ""
        findings.refuse(
            f"{where}.edge = {list(fields.edge)}: there is no such edge in the graph; "
            f"UAV {fields.edge[1]} hears {heard or 'nobody'}"
        )


def _check_signals(fields: AttackFields, where: str, scheme: Scheme, graph: Graph, findings: Findings) -> None:
    """Refuse signals that a liar does not share, and sizes of signals that it does not falsify."""
    for uav in fields.liars:
        shared = scheme.shared.get(_role(uav, graph), ())
        if not shared:
            findings.refuse(f"{where}: UAV {uav}: a leader of scheme {scheme.name} shares nothing that could be false")
            continue
        try:
            columns = touched(shared, fields.signals)
        except LookupError as error:
            findings.refuse(f"{where}.signals: UAV {uav}, a {_role(uav, graph)}: {error.args[0]}")
            continue
        chosen = [one.name for n, one in enumerate(shared) if columns.source[n] == n]
        for name in ("size", "rate"):
            given = getattr(fields, name)
            if isinstance(given, Mapping) and (unknown := [one for one in given if one not in chosen]):
                findings.refuse(
                    f"{where}.{name}: UAV {uav} tells no lie about {', '.join(unknown)}; it does about "
                    f"{', '.join(chosen)}"
                )
        victim = fields.victim
        if victim is not None and scheme.shared.get(_role(victim, graph), ()) != shared:
            findings.refuse(
                f"{where}.as = {victim}: a {_role(victim, graph)} shares other values than UAV {uav}, a "
                f"{_role(uav, graph)}: nobody would take one for the other"
            )


def _check_delay(fields: AttackFields, where: str, timing: Timing, findings: Findings) -> None:
    """Refuse a replay that looks back less than a record, or farther than records are kept."""
    exchange = timing.exchange_us / 1e6
    if fields.delay is not None and not exchange <= fields.delay <= (LONGEST - 1) * exchange:
        findings.refuse(
            f"{where}.delay = {fields.delay:g}: must be {exchange:g} to {(LONGEST - 1) * exchange:g} s, "
            f"1 to {LONGEST - 1} exchange periods"
        )
    if fields.kind == "replay" and fields.period is not None and fields.period < exchange:
        findings.refuse(f"{where}.period = {fields.period:g}: must be at least an exchange period, {exchange:g} s")


def _listeners(fields: AttackFields, graph: Graph) -> list[int]:
    """Who hears both ends of a sybil: the speaker and the victim."""
    (speaker,) = fields.liars
    both = [uav for uav in graph.uavs if {(uav, speaker), (uav, fields.victim)} <= graph.weights.keys()]
    return [uav for uav in both if fields.edge is None or uav == fields.edge[1]]


def _check_name(fields: AttackFields, where: str, plan: Plan, graph: Graph, findings: Findings) -> None:
    if not _listeners(fields, graph):
        who = f"UAV {fields.edge[1]} does not hear" if fields.edge else "no UAV hears"
        findings.refuse(f"{where}.as = {fields.victim}: {who} both UAV {fields.liars[0]} and UAV {fields.victim}")
    elif plan.network.authenticated:
        findings.warn(
            f"{where}: does nothing: the network is authenticated, nobody can speak in the name of UAV {fields.victim}"
        )


def _by_uav(n: int, fields: AttackFields, scheme: Scheme, graph: Graph) -> Iterator[tuple[int, Attack]]:
    """Yield an attack for each autopilot in which it acts."""
    for liar in fields.liars:
        shared = scheme.shared.get(_role(liar, graph), ())
        common = {
            "kind": fields.kind,
            "at_us": round(fields.at * 1e6),
            "until_us": FOR_EVER if fields.until is None else round(fields.until * 1e6),
            "role": _role(liar, graph),
            "signals": tuple(fields.signals),
            "consistent": fields.consistent,
            "size": values_by_signal(fields.size, shared, fields.signals),
            "rate": values_by_signal(fields.rate, shared, fields.signals),
            "period": fields.period or 0.0,
            "delay": fields.delay or 0.0,
            "onset": fields.onset or 0.0,
            "number": n,
        }
        if fields.victim is not None:
            for uav in _listeners(fields, graph):
                yield uav, Attack(**common, sender=fields.victim, speaker=liar)  # type: ignore[arg-type]
        elif fields.edge is not None:
            yield fields.edge[1], Attack(**common, sender=liar)  # type: ignore[arg-type]
        else:
            yield liar, Attack(**common)  # type: ignore[arg-type]


def attack_texts(plan: Plan) -> list[tuple[float, int | None, str]]:
    """Return begin and end of each attack as (time s, UAV, text)."""
    texts: list[tuple[float, int | None, str]] = []
    for fields in plan.attacks:
        if fields.victim is not None and plan.network.authenticated:
            continue
        to = f" to UAV {fields.edge[1]}" if fields.edge is not None else ""
        what = attack_text(fields.kind, fields.signals, {name: v for name, v in fields.given.items() if name != "as"})
        begin, end = f"lies{to}: {what}", f"tells{to} the truth again"
        if fields.victim is not None:
            begin, end = f"speaks{to} in the name of UAV {fields.victim}", f"speaks{to} in its own name again"
        for uav in fields.liars:
            texts.append((fields.at, uav, begin))
            if fields.until is not None:
                texts.append((fields.until, uav, end))
    return texts
