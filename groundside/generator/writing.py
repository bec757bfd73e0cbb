"""The text of a generated scenario: readable, with the aircraft and the rates of the shipped scenario of its scheme."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from ftcc.airside.scheme import Scheme
from ftcc.groundside.generator.request import Request
from ftcc.groundside.generator.swarm import DrawnFault, fault_lines, fire_tables, flying_tables, turning_tables
from ftcc.groundside.scenario import shipped
from ftcc.link.graph import Assumption, Graph

__all__ = ["SETTLED", "text_of"]

_KEPT = r"plant|plant\..*|rates|wind|form\.flight|form\.flight\..*"
"""Tables that are taken from the shipped scenario as they stand there."""
_WIDTH = 110
_SMALL = 0.25
"""Share of the error that a scheme allows, within which it has settled."""
SETTLED = "settled"
"""Ends the names of claims whose expected value is measured on the first flight."""


def text_of(
    request: Request,
    command: str,
    scheme: Scheme,
    graph: Graph,
    faults: Sequence[DrawnFault],
    measured: Mapping[str, float],
) -> str:
    """Return a scenario file.

    ``command`` is what it was made by; ``measured`` the times to settle of the first flight, s, by claim.
    """
    example = shipped()[request.example(scheme)].read_text(encoding="utf-8")
    tables = {"longitudinal": _flying, "attitude": _turning, "position": _round_a_fire}[scheme.plant]
    kept = _tables(example, _KEPT)
    if scheme.plant == "longitudinal":
        # All begin in level flight.
        kept = re.sub(r"(?m)^initial_actuators = .*$", 'initial_actuators = "trim"', kept)
    return (
        "\n\n".join(
            part
            for part in (
                _head(request, command, scheme, graph, example),
                _events(faults),
                _graph(graph),
                tables(request, graph, example),
                f"[channel]                   # the radio\nloss = {request.loss:g}    # share of records lost"
                if request.loss
                else "",
                "# Aircraft, limits, lags and rates: those of the shipped scenario of the scheme.\n\n" + kept,
                _gains(scheme),
                _claims(request, scheme, measured),
            )
            if part
        ).rstrip()
        + "\n"
    )


def _head(request: Request, command: str, scheme: Scheme, graph: Graph, example: str) -> str:
    led = f" behind {len(graph.leaders)} leader{'s' * (len(graph.leaders) > 1)}" if graph.leaders else ""
    title = f"{len(graph.followers)} UAVs{led}, graph {request.graph}"
    airframe = _value(example, "airframe")
    rate = re.search(r"(?m)^record_rate = .*$", example)
    return "\n".join(
        [
            f"# Made by `{command}`. SI units, angles in rad.",
            f"# {scheme.title}.",
            "",
            f'title = "{title}"',
            f'scheme = "{scheme.name}"',
            f"airframe = {airframe}",
            f"duration = {request.duration:.1f}             # s",
            f"seed = {request.seed}                    # of lost records",
            *([rate.group()] if rate else []),
        ]
    )


def _events(faults: Sequence[DrawnFault]) -> str:
    if not faults:
        return ""
    return "\n".join(["faults = [                  # level flight keeps travel to spare", *fault_lines(faults), "]"])


def _graph(graph: Graph) -> str:
    cells = []
    for (receiver, sender), weight in graph.weights.items():
        back = graph.weights.get((sender, receiver))
        if back is None:
            cells.append(f"{{ from = {sender}, to = {receiver}, weight = {weight:g} }},")
        elif receiver > sender:
            cells.append(f"{{ between = [{sender}, {receiver}], weight = {weight:g} }},")
    lines = [""]
    for cell in cells:
        if len(lines[-1]) + len(cell) > _WIDTH:
            lines.append("")
        lines[-1] += f" {cell}" if lines[-1] else f"    {cell}"
    leaders = f"leaders = {_listed(graph.leaders)}\n" if graph.leaders else ""
    return (
        f"[uavs]\nfollowers = {_listed(graph.followers)}\n{leaders}\n"
        "[graph]                     # who hears whom; in sum the weights of a UAV's neighbours stay below 1\n"
        "edges = [\n" + "\n".join(lines) + "\n]"
    )


def _listed(ids: Sequence[int]) -> str:
    rows = [", ".join(map(str, ids[n : n + 20])) for n in range(0, len(ids), 20)]
    return f"[{rows[0]}]" if len(rows) == 1 else "[\n    " + ",\n    ".join(rows) + ",\n]"


def _flying(request: Request, graph: Graph, example: str) -> str:
    return flying_tables(request, graph, forward="forward = true" in example)


def _turning(request: Request, graph: Graph, example: str) -> str:
    return turning_tables(request, graph)


def _round_a_fire(request: Request, graph: Graph, example: str) -> str:
    fire = _tables(example, "fire")
    return f"{fire}\n{fire_tables(request, graph, fire)}"


def _gains(scheme: Scheme) -> str:
    if "in_flight" not in scheme.gains_type._fields:
        return ""
    return (
        "[gains]                     # all others are those of the law's form\n"
        "in_flight = 1.0             # estimates start where the aircraft is"
    )


def _claims(request: Request, scheme: Scheme, measured: Mapping[str, float]) -> str:
    """Claims that any swarm should meet: nobody is lost, all settle, and stay inside the hull."""
    end = request.duration
    whole, last = [0.0, end], [end - 10.0, end]
    claims = [
        _claim("nobody is lost", "t", "s", "any swarm", end, f"> {end - 0.1:g}", metric="last_time", window=whole)
    ]
    for error in scheme.tracking:
        if not isinstance(error.bound, float):
            continue
        name = f"{error.meaning}: {SETTLED}"
        time = measured.get(name)
        by = end if time is None else min(1.25 * time + 2.0, end)
        claims += [
            _claim(
                f"{error.meaning}: at the end", error.name, error.unit, "what the scheme allows", 0.0,
                f"< {error.bound:g}", metric="max_abs", window=last,
            ),
            _claim(
                name, error.name, "s", "the first flight, and a quarter more", time or 0.0, f"< {by:.1f}",
                metric="time_until_below", window=whole, threshold=_SMALL * error.bound,
            ),
        ]  # fmt: skip
    if scheme.graph is Assumption.UNDIRECTED_LEADERS_REACH_ALL:
        claims.append(
            _claim(
                "outside the leaders' altitudes",
                "hull_distance",
                "m",
                "containment",
                0.0,
                "< 0.5",
                metric="max_abs",
                window=last,
            )
        )
    return "# What any swarm of this scheme should show.\n\n" + "\n\n".join(claims)


def _claim(
    name: str, signal: str, unit: str, source: str, expected: float, tolerance: str, **how: str | float | list[float]
) -> str:
    """The table of a claim; ``how`` are metric, window and threshold."""
    said = {"name": name, "signal": signal, **how, "unit": unit, "source": source, "tolerance": tolerance}
    lines = [f"{key} = {_literal(value)}" for key, value in said.items()]
    return "\n".join(["[[claims]]", *lines, f"expected = {{ flight = {expected:.1f} }}"])


def _literal(value: str | float | list[float]) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    return f"[{', '.join(f'{one:.1f}' for one in value)}]" if isinstance(value, list) else f"{value:g}"


def _tables(text: str, names: str) -> str:
    """The tables of a TOML file whose headers match, as they stand there, without what follows them."""
    found = []
    for table in re.split(r"(?m)^(?=\[)", text)[1:]:
        header = re.match(r"\[+([^\]]+)\]", table)
        if header and re.fullmatch(names, header.group(1)):
            found.append(re.sub(r"(?ms)^# ---.*", "", table).strip())
    return "\n\n".join(found)


def _value(text: str, key: str) -> str:
    found = re.search(rf"(?m)^{key} = (\S+)", text)
    assert found is not None
    return found.group(1)
