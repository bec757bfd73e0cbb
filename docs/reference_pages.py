"""The pages of the site's reference, made from the code when the site is built: nothing on them is typed by hand."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import typer
from markdown_tables import cell, code, table
from reference_fields import scenario_fields, sheet_fields
from reference_python import python_api

from ftcc.airside import schemes
from ftcc.airside.defence.gains import DEFENCE_RANGES, DefenceGains
from ftcc.airside.diagnosis.gains import DIAGNOSIS_RANGES, DiagnosisGains
from ftcc.airside.gcs import BELIEF_FIELDS, COMMANDS, LINK_FIELDS, MESSAGES
from ftcc.airside.gcs.streams import STREAMS
from ftcc.airside.ranges import Range
from ftcc.airside.scheme import quantities
from ftcc.groundside import load, resolve
from ftcc.groundside.claims.metrics import METRICS
from ftcc.groundside.cli.app import app
from ftcc.groundside.cli.examples import EXAMPLES
from ftcc.groundside.simulation.flight import recorded_columns
from ftcc.link.actuators import by_slot
from ftcc.link.attacks import ATTACK_SIZES
from ftcc.link.attacks import KINDS as LIES
from ftcc.link.failures import FAILURES, KINDS, SIZES, UNITS
from ftcc.link.mavlink import dialect
from ftcc.link.recording import LINK_COLUMNS
from ftcc.sim import plants

__all__ = ["PAGES", "all_commands"]


def all_commands() -> dict[str, Any]:
    """Every command of the command line, by what is typed for it."""

    def visit(path: str, command: Any) -> Iterator[tuple[str, Any]]:
        yield path, command
        for name, below in getattr(command, "commands", {}).items():
            yield from visit(f"{path} {name}", below)

    return dict(visit("ftcc", typer.main.get_command(app)))


def command_line() -> str:
    """Every command with its arguments, options and example."""
    sections = [
        "# Every command\n\nWhat `ftcc COMMAND --help` says. [Command line](../docs/command-line.md) explains exit"
        " codes, folders and completion.\n"
    ]
    for path, command in all_commands().items():
        context = command.context_class(command, info_name=path)
        records = (parameter.get_help_record(context) for parameter in command.params if parameter.name != "help")
        rows = [(code(name), cell(meaning)) for name, meaning in filter(None, records)]
        sections.append(f"## {path}\n\n{command.help}\n")
        if rows:
            sections.append(table(("argument or option", "meaning"), rows))
        if path in EXAMPLES:
            sections.append(f"    {EXAMPLES[path]}\n")
    return "\n".join(sections)


def mavlink() -> str:
    """Commands, messages, failures and streams of a UAV."""
    commands = (
        (str(number), code(dialect.enums["MAV_CMD"][number].name), cell(command.does))
        for number, command in sorted(COMMANDS.items())
    )
    messages = ((code(name), cell(message.does)) for name, message in sorted(MESSAGES.items()))
    streams = (
        (
            code(dialect.mavlink_map[stream.message].msgname),
            code(f"SR_{stream.name}"),
            f"{stream.rate:g}",
            "followers" if stream.followers_only else "those that diagnose" if stream.diagnosed_only else "all",
        )
        for stream in STREAMS
    )
    failures = (
        (
            f"{meaning.unit.code} {code(meaning.unit.name)}",
            cell(meaning.unit.instances),
            f"{KINDS[meaning.kind]} {meaning.kind.upper()}",
            cell(meaning.text),
            ", ".join(map(code, meaning.sizes)),
        )
        for meaning in FAILURES
    )
    sizes = (
        (code(one.name), code(one.keyword), f"{one.default:g}", f"{one.low:g} to {one.high:g}", one.unit, one.meaning)
        for one in SIZES
    )
    lies = (
        (str(kind.code), code(name), cell(kind.formula), cell(kind.does), *map(", ".join, (kind.needs, kind.takes)))
        for name, kind in LIES.items()
    )
    lie_sizes = (
        (code(one.name), f"{one.default:g}", f"{one.low:g} to {one.high:.10g}", one.unit, cell(one.meaning))
        for one in ATTACK_SIZES
    )
    return "\n".join(
        (
            "# MAVLink messages and commands",
            "",
            "What a UAV accepts from the ground and sends to it. [Ground stations](../docs/ground-stations.md) says",
            "how to connect, and what QGroundControl asks for. `ftcc commands` and `ftcc failures` print the same:",
            "",
            "    ftcc commands",
            "    ftcc failures demo",
            "",
            "## Commands",
            "",
            table(("MAV_CMD", "command", "what the UAV does"), commands),
            "Any other command is answered with UNSUPPORTED.",
            "",
            "## Messages that it takes",
            "",
            table(("message", "answer"), messages),
            "Any other message is ignored.",
            "",
            "## Messages that it sends",
            "",
            "HEARTBEAT once per second of wall time, and at these rates, which the parameters and SET_MESSAGE_INTERVAL",
            "change (Hz of simulated time; 0: only when asked):",
            "",
            table(("message", "parameter", "rate, Hz", "of which UAVs"), streams),
            f'`DEBUG_FLOAT_ARRAY` "links" has per in-edge: {", ".join(LINK_FIELDS)}. "beliefs" has per slot of an',
            f'actuator: {", ".join(BELIEF_FIELDS)}. "signals" has the scheme\'s signals, in the order of its recorded',
            "[columns](columns.md).",
            "",
            "## Failures",
            "",
            f"What MAV_CMD_INJECT_FAILURE can ask for, in {len(UNITS)} units. It acts at the simulated time of the",
            "parameter FTCC_AT (ms, 0: at once). The sizes are parameters too.",
            "",
            table(("unit", "instances", "type", "means", "size from"), failures),
            table(("parameter", "in Python and scenarios", "default", "range", "unit", "meaning"), sizes),
            "## Lies",
            "",
            "What a UAV tells its neighbours instead of the truth, see [attacks](../docs/attacks.md): the type WRONG",
            "of the unit SYSTEM_MAVLINK_SIGNAL, with these parameters. x is the true value, c the size, r the rate, s",
            "the time since the beginning.",
            "",
            table(("ATK_KIND", "kind", "is told", "meaning", "needs", "may have"), lies),
            table(("parameter", "default", "range", "unit", "meaning"), lie_sizes),
        )
    )


def metrics() -> str:
    """The metrics of claims."""
    across = {"max": "the largest", "min": "the smallest", "farthest": "the farthest from the expected one"}
    rows = (
        (code(name), cell(metric.meaning), "needed" if metric.threshold else "", across[metric.across])
        for name, metric in METRICS.items()
    )
    return "\n".join(
        (
            "# Metrics of claims",
            "",
            "A claim's `metric` makes one number of a `signal` within a `window`. Of several UAVs one number counts.",
            "",
            "```toml",
            "[[claims]]",
            'name = "altitude tracking of UAV 1 at its fault"',
            'metric = "max_abs"',
            'signal = "z - z_r"',
            "uavs = [1]",
            "window = [80.0, 82.0]",
            'unit = "m"',
            'source = "this example"',
            "expected = { flight = 0.453 }",
            'tolerance = "15 %"',
            "```",
            "",
            table(("metric", "meaning", "threshold", "of several UAVs"), rows),
            "[Claims](../groundside/scenarios/README.md#claims) explains the other fields.",
        )
    )


def _gain_rows(known: Mapping[str, Any], ranges: Mapping[str, Range], flown: Mapping[str, float]) -> Iterator[Any]:
    for name, note in known.items():
        published = note.follows or ("" if note.published is None else f"{note.published:g}")
        value = f"{flown[name]:g}" if name in flown else ""
        allowed = str(ranges[name]) if name in ranges else "any finite number"
        yield code(name), cell(note.unit), cell(note.meaning), published, value, cell(allowed)


def gains() -> str:
    """The gains of every scheme of this repository, and the settings of diagnosis and of defences."""
    sections = [
        "# Gains of the schemes\n\nThe monograph's value, the one that the form `flight` replaces it by, and the range"
        ' beyond which a value is refused. "(not in paper)" marks what a form adds. A gain is set in a scenario, for'
        " one flight, or in flight by its parameter:\n\n"
        "    ftcc simulate containment --set gains.k11=5.0\n"
    ]
    headings = ("gain", "unit", "meaning", "monograph", "flight form", "range")
    for name in _own_schemes():
        scheme = schemes.find(name)
        rows = _gain_rows(quantities(scheme.gains_type), scheme.ranges, scheme.forms.get("flight", {}))
        sections.append(f"## {name}\n\n{scheme.title}.\n\n{table(headings, rows)}")
        switches = (
            (code(switch), ", ".join(code(f"{gain} = {value:g}") for gain, value in values.items()))
            for switch, values in scheme.switches.items()
        )
        if scheme.switches:
            sections.append(table(("switch", "what `false` sets"), switches))
    others = (
        ("Diagnosis", "[diagnosis](../docs/diagnosis.md), under `[diagnosis.gains]`", DiagnosisGains, DIAGNOSIS_RANGES),
        ("Defence", "[defences](../docs/defences.md), under `[defence]`", DefenceGains, DEFENCE_RANGES),
    )
    for title, where, record, allowed_names in others:
        ranges = {name: allowed for allowed, names in allowed_names.items() for name in names.split()}
        rows = ((*row[:4], row[5]) for row in _gain_rows(quantities(record), ranges, {}))
        sections.append(
            f"## {title}\n\nSettings of {where}.\n\n" + table(("setting", "unit", "meaning", "default", "range"), rows)
        )
    return "\n".join(sections)


def _own_schemes() -> list[str]:
    """Schemes of this repository, not those of packages that happen to be installed."""
    return [name for name in schemes.names() if schemes.find(name).module.__name__.startswith(schemes.__name__)]


def columns() -> str:
    """What a run of each scheme records."""
    sections = [
        "# Recorded columns\n\nThe columns of `signals.parquet`, a row per recorded tick and UAV, and of a flight in"
        " memory. Angles in rad; altitude z points up.\n\n"
        "```python\n"
        "from ftcc.groundside import simulate\n\n"
        'flight = simulate("containment", settings={"duration": 1.0})\n'
        'errors = flight.column("S1", uav=1)\n'
        "```\n"
    ]
    rows = {name: recorded_columns(resolve(load(name))) for name in _own_schemes()}
    shared = set.intersection(*({(c.name, c.unit) for c in columns} for columns in rows.values()))
    headings = ("column", "unit", "meaning")

    def listed(columns: Any, wanted: Callable[[Any], bool]) -> str:
        seen = {column.name: column for column in columns if wanted(column)}
        return table(headings, ((code(one.name), cell(one.unit), cell(one.meaning)) for one in seen.values()))

    first = next(iter(rows.values()))
    sections.append(f"## All schemes\n\n{listed(first, lambda c: (c.name, c.unit) in shared)}")
    for name, own in rows.items():
        sections.append(f"## {name}\n\n{listed(own, lambda c: (c.name, c.unit) not in shared)}")
    sections.append(
        "## Links\n\nThe columns of `links.parquet`, a row per edge and report.\n\n"
        + table(headings, ((code(one.name), cell(one.unit), cell(one.meaning)) for one in LINK_COLUMNS))
    )
    known = {column.name: column for name in rows for column in resolve(load(name)).lie_columns}
    sections.append(
        "## Lies\n\nThe columns of `lies.parquet`, a row per false record, see [attacks](../docs/attacks.md); of each"
        " scheme those of the values that it shares.\n\n"
        + table(headings, ((code(one.name), cell(one.unit), cell(one.meaning)) for one in known.values()))
    )
    return "\n".join(sections)


def plant_models() -> str:
    """The plants: states, inputs, disturbances."""
    rows = []
    for name in plants.names():
        plant = plants.find(name)
        title = (plant.__doc__ or "").strip().splitlines()[0]
        states = ", ".join(map(code, plant.State._fields))
        disturbances = ", ".join(f"{code(one)} ({unit})" for one, unit in plant.DISTURBANCES)
        rows.append((code(name), cell(title), states, ", ".join(map(code, by_slot(plant.ACTUATORS))), disturbances))
    return "\n".join(
        (
            "# Plants",
            "",
            "The true aircraft that a scheme flies, its own or the one that `plant.model` names.",
            "[How far to trust them](../docs/models.md).",
            "",
            "    ftcc simulate containment --variant sixdof --duration 10",
            "",
            table(("plant", "is", "states", "actuators", "disturbances"), rows),
        )
    )


PAGES: Mapping[str, Callable[[], str]] = {
    "reference/commands.md": command_line,
    "reference/scenario.md": scenario_fields,
    "reference/airframe.md": sheet_fields,
    "reference/gains.md": gains,
    "reference/columns.md": columns,
    "reference/metrics.md": metrics,
    "reference/mavlink.md": mavlink,
    "reference/plants.md": plant_models,
    "reference/python.md": python_api,
}
"""By the place on the site."""
