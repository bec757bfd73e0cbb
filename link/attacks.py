"""Attacks on what UAVs tell their neighbours: the one table of the kinds of lies, for scenarios, MAVLink and laws.

An attacked UAV flies its law as before: it only tells its neighbours something else than is true. Below, x is the true
value of a signal, c its ``size``, r its ``rate``, and s the time since the beginning of the attack.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from ftcc.link.failures import Size

__all__ = ["ATTACK_SIZES", "DRIFT_TIME", "KINDS", "LONGEST", "Kind", "attack_text", "kind_of", "with_rate"]


class Kind(NamedTuple):
    """A kind of lie."""

    code: int
    """The parameter ATK_KIND."""
    formula: str
    """What is told."""
    does: str
    """For people."""
    needs: tuple[str, ...] = ()
    """Fields that it cannot do without."""
    takes: tuple[str, ...] = ()
    """Fields that it may have."""


KINDS: dict[str, Kind] = {
    "offset": Kind(1, "x + c", "a constant error", ("size",)),
    "drift": Kind(
        2, "x + r s, at most c away", "an error that grows slowly enough to be believed", ("rate",), ("size",)
    ),
    "freeze": Kind(3, "x of the beginning", "the values of the beginning, for ever"),
    "replay": Kind(
        4,
        "x of delay earlier",
        "its own past; with period, a window of the past, again and again",
        ("delay",),
        ("period",),
    ),
    "noise": Kind(5, "x + c w", "white noise w of standard deviation 1, a draw per record and signal", ("size",)),
    "oscillate": Kind(6, "x + c sin(2 pi s / period)", "an oscillating error", ("size", "period")),
    "opposite": Kind(
        7, "2 x of the beginning - x; of an error -x", "the mirror image: the neighbours are led the other way"
    ),
    "collude": Kind(
        8,
        "(1 - w) x + w (c + r s), w = s / onset up to 1",
        "a target that several UAVs agree on",
        ("size",),
        ("rate", "onset"),
    ),
    "sybil": Kind(9, "x of the speaker + c", "the speaker's values in another UAV's name", ("as",), ("size",)),
}
"""By name."""

LONGEST = 16384
"""Records that a replay can look back."""

DRIFT_TIME = 10.0
"""Time in which a drift whose rate is not given comes to its size, s: slow enough to be believed."""


def with_rate(kind: str, sizes: Mapping[str, float]) -> dict[str, float]:
    """The sizes of a lie; of a drift that has a ``size`` alone with the rate that takes it there in `DRIFT_TIME`."""
    slowly = {"rate": sizes["size"] / DRIFT_TIME} if kind == "drift" and "size" in sizes else {}
    return {**slowly, **sizes}


_ANY = 1e6

ATTACK_SIZES = (
    Size(
        "ATK_KIND",
        0.0,
        0.0,
        float(len(KINDS)),
        "-",
        "kind of lie, see `ftcc attacks`; 0: the truth again",
        integer=True,
    ),
    Size("ATK_SIZE", 0.0, -_ANY, _ANY, "unit of the signal", "size of the lie; collude: the target"),
    Size("ATK_RATE", 0.0, -_ANY, _ANY, "unit/s", "rate of a drift, or of the target of collude"),
    Size("ATK_PERIOD", 0.0, 0.0, 1e4, "s", "period of an oscillation, length of a window that is replayed; 0: none"),
    Size("ATK_DELAY", 0.0, 0.0, 1e4, "s", "how far back a replay looks"),
    Size("ATK_ONSET", 0.0, 0.0, 1e4, "s", "time in which collude comes to its target"),
    Size("ATK_UNTIL", 0.0, 0.0, float(2**31 - 1), "ms", "simulated time at which it ends; 0: never", integer=True),
    Size(
        "ATK_SIGNALS",
        0.0,
        0.0,
        float(2**24 - 1),
        "-",
        "shared signals: 1 the first, 2, 4, ... added up; 0: no rates",
    ),
    Size("ATK_CONSIST", 1.0, 0.0, 1.0, "-", "1: a told rate fits the told value; 0: it stays true", integer=True),
    Size("ATK_AS", 0.0, 0.0, 200.0, "-", "sybil: the id of the UAV in whose name is spoken", integer=True),
)
"""Parameters of an autopilot that say what the next lie is; FTCC_AT says when it begins."""


def kind_of(code: float) -> str:
    """Name of a kind by its code; empty where there is none."""
    return next((name for name, kind in KINDS.items() if kind.code == code), "")


def attack_text(kind: str, signals: Iterable[str], values: Mapping[str, float | Mapping[str, float]]) -> str:
    """What is told, for logs: such as "offset of zhat: size 2"; a value may be given by signal."""
    of = f" of {', '.join(signals)}" if signals else ""

    def shown(value: float | Mapping[str, float]) -> str:
        return f"{value:g}" if isinstance(value, float) else " and ".join(f"{v:g} of {s}" for s, v in value.items())

    given = ", ".join(f"{name} {shown(value)}" for name, value in values.items())
    return f"{kind}{of}{': ' if given else ''}{given}"
