"""The commands ``ftcc attack``, to a running swarm, and ``ftcc attacks``, which lists what there is."""

from __future__ import annotations

from typing import Annotated

import typer

from ftcc.groundside.cli.common import fail, terminal
from ftcc.groundside.cli.ground import At, Key, Swarm, Uav, _say, _station
from ftcc.link.text import as_seconds

__all__ = ["attack", "attacks"]


def attack(
    uav: Uav,
    kind: Annotated[str, typer.Argument(help="Kind of lie, see `ftcc attacks`; none: the truth again.")],
    to: Annotated[int | None, typer.Option(help="Who alone hears the lie; default: everybody.")] = None,
    signals: Annotated[
        str | None, typer.Option(metavar="A,B", help="Shared values that are false; default: all that are no rates.")
    ] = None,
    size: Annotated[float | None, typer.Option(help="Size, in the unit of the signal; collude: the target.")] = None,
    rate: Annotated[
        float | None, typer.Option(help="Rate of a drift or of a target, unit per s; default of a drift: size / 10 s.")
    ] = None,
    period: Annotated[float | None, typer.Option(help="Period, or window that is replayed, s.")] = None,
    delay: Annotated[float | None, typer.Option(help="How far back a replay looks, s.")] = None,
    onset: Annotated[float | None, typer.Option(help="Time in which collude comes to its target, s.")] = None,
    victim: Annotated[int | None, typer.Option("--as", help="sybil: in whose name the UAV speaks.")] = None,
    inconsistent: Annotated[bool, typer.Option("--inconsistent", help="Rates stay true.")] = False,
    at: At = None,
    until: Annotated[float | None, typer.Option(help="Simulated time at which it ends, s; default: never.")] = None,
    duration: Annotated[float | None, typer.Option("--for", help="How long it lasts, s, instead of --until.")] = None,
    swarm: Swarm = None,
    key: Key = None,
) -> None:
    """Have a UAV lie to its neighbours, or tell the truth again.

    It flies its law as before: only what it tells is false.
    """
    if until is not None and duration is not None:
        fail("--until and --for: give one of them")
    if duration is not None and not duration > 0.0:
        fail(f"--for {duration:g}: must be greater than 0")
    given = {"size": size, "rate": rate, "period": period, "delay": delay, "onset": onset}
    with _station(swarm, key) as station:
        if duration is not None:
            # On the grid of whole milliseconds, which is MAVLink's.
            until = round((at if at is not None else station.state(uav).t) + duration, 3)
        when = station.attack(
            uav,
            kind,
            to=to,
            signals=[name.strip() for name in (signals or "").split(",") if name.strip()],
            victim=victim,
            consistent=not inconsistent,
            at=at,
            until=until,
            **{name: value for name, value in given.items() if value is not None},
        )
    whom = "" if to is None else f" to UAV {to}"
    ends = "" if until is None else f" to {as_seconds(round(until * 1e6))} s"
    _say(f"UAV {uav}{whom}: {kind} from t = {as_seconds(round(when * 1e6))} s{ends}")


def attacks() -> None:
    """List the kinds of lies that UAVs may tell their neighbours, and the parameters that say how much."""
    from rich.table import Table

    from ftcc.link.attacks import ATTACK_SIZES, KINDS

    kinds = Table("ATK_KIND", "kind", "is told", "needs", "may have", header_style="bold", box=None, pad_edge=False)
    for name, kind in KINDS.items():
        kinds.add_row(str(kind.code), name, f"{kind.formula}: {kind.does}", *map(", ".join, (kind.needs, kind.takes)))
    sizes = Table("parameter", "default", "range", "unit", "means", header_style="bold", box=None, pad_edge=False)
    for one in ATTACK_SIZES:
        sizes.add_row(one.name, f"{one.default:g}", f"{one.low:g} .. {one.high:.10g}", one.unit, one.meaning)
    out = terminal()
    out.print(kinds)
    out.print()
    out.print(sizes)
    out.print(
        "\nx is the true value, c the size, r the rate, s the time since the beginning. A lie begins with"
        " MAV_CMD_INJECT_FAILURE, unit SYSTEM_MAVLINK_SIGNAL, type WRONG: instance 0 is what the UAV tells everybody,"
        " n what UAV n tells it. It begins at FTCC_AT.",
        highlight=False,
    )
