"""Report what diagnosis on board found: a table of faults, false alarms, and each estimate with its band."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ftcc.groundside.report.page import Cell, Head, Section
from ftcc.groundside.results import Run
from ftcc.groundside.verdict import AFTER, SIGMAS, Alarm, FaultFound, false_alarms, faults_found
from ftcc.link.actuators import unit_of

if TYPE_CHECKING:
    from rich.console import Console

    from ftcc.groundside.canvas import Look
    from ftcc.groundside.report.plates import Plates

__all__ = ["diagnosis_as_json", "diagnosis_sections", "show_diagnosis"]

_BEFORE, _BEHIND = 5.0, 30.0
"""What a figure shows before the onset of a fault, and behind it, s."""
_POINTS = 1000
"""Largest number of points of a curve."""
_STYLES = {"holds": "green", "fails": "bold red", "warning": "yellow", "open": "dim"}
"""Of the marks of cells, on a terminal."""

_NONE = "No fault of a diagnosed actuator acted."
_NO_ALARM = "No false alarm was raised."


_ESTIMATES = (
    f"Estimates of effectiveness and bias, {AFTER:g} s after isolation, have bands of {SIGMAS:g} standard deviations; "
    'their errors are marked "outside" where the band does not cover the truth.'
)


def _heads() -> list[Head]:
    return [
        Head("UAV"),
        Head("actuator"),
        Head("injected"),
        Head("onset, s", True),
        Head("detection, s", True),
        Head("isolation, s", True),
        Head("kind found"),
        Head("effectiveness", True),
        Head("error", True),
        Head("bias", True),
        Head("error", True),
    ]


def _row(fault: FaultFound) -> list[Cell]:
    unit = unit_of(fault.actuator)
    return [
        Cell(str(fault.uav)),
        Cell(fault.actuator.replace("_", " ")),
        Cell(_injected(fault)),
        Cell(f"{fault.onset:.2f}"),
        _delay(fault.detection_delay),
        _delay(fault.isolation_delay),
        _kind(fault),
        *_estimate(fault.effectiveness, fault.effectiveness_sd, fault.effectiveness_error, "-"),
        *_estimate(fault.bias, fault.bias_sd, fault.bias_error, unit),
    ]


def _injected(fault: FaultFound) -> str:
    """Describe what was injected; a stuck actuator acts as one with effectiveness 0 that is biased."""
    unit = unit_of(fault.actuator).removesuffix("-")
    if fault.true_kind == "slow":
        return f"slow: at most {fault.slew:g} {unit}/s"
    bias = f" {fault.true_bias:+.3g} {unit}".rstrip() if fault.true_bias else ""
    return f"{fault.true_kind}: {100.0 * fault.true_effectiveness:.3g} %{bias}"


def _delay(delay: float) -> Cell:
    return Cell("not", "fails") if math.isnan(delay) else Cell(f"{delay:.2f}")


def _kind(fault: FaultFound) -> Cell:
    """Name the kind found at isolation, and the one believed later if it differs."""
    if math.isnan(fault.isolated):
        return Cell("-", "open")
    changed = not math.isnan(fault.compared) and fault.kind_compared != fault.kind
    later = fault.kind_compared if fault.determined else "undetermined"
    text = f"{fault.kind}, later {later}" if changed else fault.kind
    if fault.kind == fault.true_kind:
        return Cell(text, "warning" if changed else "holds")
    return Cell(text, "warning" if changed and later == fault.true_kind else "fails")


def _estimate(value: float, sd: float, error: float, unit: str) -> tuple[Cell, Cell]:
    """Return an estimate with its band, and its error, marked by whether the band covers the truth."""
    if math.isnan(value):
        return Cell("-", "open"), Cell("-", "open")
    after = "" if unit == "-" else f" {unit}"
    covered = abs(error) <= SIGMAS * sd
    estimate = Cell(f"{value:.3g} +- {SIGMAS * sd:.2g}{after}")
    return estimate, Cell(f"{error:+.2g}" + ("" if covered else ", outside"), "holds" if covered else "fails")


_ALARM_HEADS = (Head("UAV"), Head("actuator"), Head("from, s", True), Head("to, s", True), Head("state"), Head("kind"))
_AMID = Head("faulty then")


def _alarm_row(alarm: Alarm) -> list[Cell]:
    return [
        Cell(str(alarm.uav)),
        Cell(alarm.actuator.replace("_", " ")),
        Cell(f"{alarm.begin:.2f}"),
        Cell(f"{alarm.until:.2f}"),
        Cell(alarm.state, "fails"),
        Cell(alarm.kind),
        Cell(", ".join(alarm.amid) or "nothing"),
    ]


def _found_in(run: Run) -> tuple[tuple[FaultFound, ...], tuple[Alarm, ...]]:
    events = run.events
    return faults_found(run, events), false_alarms(run, events)


def diagnosis_sections(run: Run, plates: Plates) -> list[Section]:
    """Return the table of faults with a figure per UAV, and the false alarms."""
    faults, alarms = _found_in(run)
    before = [f"Delays of detection and isolation count from the onset. {_ESTIMATES}"]
    svg = "".join(_draw(run, uav, [f for f in faults if f.uav == uav], plates) for uav in _uavs(faults))
    found = Section("faults", "Diagnosis", before if faults else [_NONE], svg, _heads(), [_row(f) for f in faults])
    if not alarms:
        return [Section(**vars(found) | {"after": [_NO_ALARM]})]
    heads = [*_ALARM_HEADS, _AMID]
    before = ["Alarms for actuators that had no fault when they began."]
    return [found, Section("alarms", "False alarms", before, heads=heads, rows=[_alarm_row(a) for a in alarms])]


def show_diagnosis(console: Console, run: Run) -> None:
    """Print the table of faults and the false alarms."""
    faults, alarms = _found_in(run)
    if faults:
        console.print(_table(_heads(), [_row(fault) for fault in faults]))
        console.print(f"[dim]{_ESTIMATES}[/]", highlight=False, soft_wrap=not console.is_terminal)
    else:
        console.print(f"diagnosis: {_NONE[0].lower()}{_NONE[1:].removesuffix('.')}", highlight=False)
    if alarms:
        console.print("[bold]false alarms[/]")
        console.print(_table([*_ALARM_HEADS, _AMID], [_alarm_row(alarm) for alarm in alarms]))
    else:
        console.print(f"diagnosis: {_NO_ALARM[0].lower()}{_NO_ALARM[1:].removesuffix('.')}", highlight=False)


def diagnosis_as_json(run: Run) -> dict[str, Any]:
    """Return faults and false alarms for JSON; null where there is no number."""
    faults, alarms = _found_in(run)
    return {
        "faults": [{name: _number(value) for name, value in vars(fault).items()} for fault in faults],
        "false_alarms": [vars(alarm) for alarm in alarms],
    }


def _number(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _uavs(faults: Sequence[FaultFound]) -> list[int]:
    return list(dict.fromkeys(fault.uav for fault in faults))


def _table(heads: Sequence[Head], rows: Sequence[Sequence[Cell]]) -> Any:
    from rich.markup import escape
    from rich.table import Table

    table = Table(header_style="bold", pad_edge=False)
    for head in heads:
        table.add_column(head.text, justify="right" if head.number else "left", overflow="fold")
    for row in rows:
        cells = [(escape(cell.text), _STYLES.get(cell.mark)) for cell in row]
        table.add_row(*(f"[{style}]{text}[/]" if style else text for text, style in cells))
    return table


def _draw(run: Run, uav: int, faults: Sequence[FaultFound], plates: Plates) -> str:
    """Draw the estimates of a UAV around each of its faults, with bands, beside the truth; return the SVG."""

    def draw(look: Look) -> Any:
        return _figure(run, uav, faults, look)

    drawn = plates.add(f"diagnosis_{uav}", f"Estimates of UAV {uav} beside the truth", "", draw)
    return "" if drawn is None else drawn.svg


def _figure(run: Run, uav: int, faults: Sequence[FaultFound], look: Look) -> Any:
    from ftcc.groundside.canvas import INK, Line2D, plt
    from ftcc.groundside.palette import GRAY, colors, hexadecimal
    from ftcc.groundside.report.drawing import add_legend, folded

    tint, gray = hexadecimal(colors(run.mission.uavs)[uav]), hexadecimal(GRAY)
    t = run.column("t", uav)
    with plt.rc_context(look.style):
        columns = min(2, look.columns)
        rows_of_axes = 2 * len(faults) // columns
        size = (look.width, 0.5 + (1.7 if columns == 2 else look.row) * rows_of_axes)
        figure, axes = plt.subplots(rows_of_axes, columns, figsize=size, layout="constrained", squeeze=False)
        for pair, fault in zip(axes.reshape(-1, 2), faults, strict=True):
            rows = np.flatnonzero((t >= fault.onset - _BEFORE) & (t <= min(fault.until, fault.onset + _BEHIND)))
            rows = rows[:: max(1, len(rows) // _POINTS)]
            for one, quantity in zip(pair, ("effectiveness", "bias"), strict=True):
                estimate, sd = (run.column(f"{quantity}_{n}_{fault.actuator}", uav)[rows] for n in ("hat", "sd"))
                truth = run.column(f"{fault.actuator}_{quantity}", uav)[rows]
                low, high = estimate - SIGMAS * sd, estimate + SIGMAS * sd
                one.fill_between(t[rows], low, high, color=tint, alpha=0.2, linewidth=0.0)
                one.plot(t[rows], estimate, color=tint)
                one.plot(t[rows], truth, ":", color=INK, linewidth=0.9)
                for moment, style in ((fault.onset, "-"), (fault.detected, "--"), (fault.isolated, "-.")):
                    if not math.isnan(moment):
                        one.axvline(moment, linestyle=style, color=gray, linewidth=0.8, zorder=1)
                unit = unit_of(fault.actuator) if quantity == "bias" else "-"
                label = f"{quantity} of {fault.actuator.replace('_', ' ')}" + ("" if unit == "-" else f", {unit}")
                one.set(xlabel="t, s", ylabel=folded(label, look))
                one.margins(x=0.01)
        legend = [
            Line2D([], [], color=tint, label=f"UAV {uav}: estimate, band of {SIGMAS:g} sigma"),
            Line2D([], [], color=INK, linestyle=":", label="true value"),
            Line2D([], [], color=gray, linestyle="-", label="onset"),
            Line2D([], [], color=gray, linestyle="--", label="detection"),
            Line2D([], [], color=gray, linestyle="-.", label="isolation"),
        ]
        add_legend(figure, legend, look, handle=2.2)
    return figure
