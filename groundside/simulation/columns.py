"""Which columns a flight in memory keeps: all, or only those that its claims and its verdict need."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

from ftcc.groundside.claims import recorded_names
from ftcc.groundside.errors import UserError
from ftcc.groundside.scenario import Mission
from ftcc.groundside.verdict import columns_judged
from ftcc.link.actuators import ACTUATORS, SLOT
from ftcc.sim.plant import TRUTH
from ftcc.sim.plants import conditions_of, find

__all__ = ["PARTS", "NotRecordedError", "Place", "columns_needed", "places_kept", "places_of"]

PARTS = ("truth", "command", "acting", "conditions", "signals")
"""Parts of a recording that have columns, see ``flight_arrays.Recording``."""

_CLEARANCE = "clearance"
"""A column that is computed from these:"""
_FOR_CLEARANCE = ("x", "z")


class NotRecordedError(UserError):
    """A column is asked for that the flight did not record."""


class Place(NamedTuple):
    """Where a column stands in a whole recording."""

    part: str
    number: int


def places_of(mission: Mission) -> dict[str, Place]:
    """Return where each recorded column of a mission stands, in the order of a table; time is no such column."""
    actuators = find(mission.plant).ACTUATORS
    places = {name: Place("truth", n) for n, name in enumerate(TRUTH)}
    places |= {f"{name}_command": Place("command", SLOT[name]) for name in actuators}
    places |= {name: Place("acting", SLOT[name]) for name in actuators}
    places |= {name: Place("conditions", n) for n, (name, _) in enumerate(conditions_of(mission.plant))}
    return places | {quantity.name: Place("signals", n) for n, quantity in enumerate(mission.signals)}


def places_kept(mission: Mission, columns: Collection[str] | None) -> dict[str, list[int]]:
    """Return the indices that each part keeps, ascending; all with None.

    The first column of the truth is always kept: it shows until when a UAV flew.

    Raises
    ------
    UserError
        For a column that the mission does not have.
    """
    if columns is None:
        widths = (len(TRUTH), len(ACTUATORS), len(ACTUATORS), len(conditions_of(mission.plant)))
        return {p: list(range(n)) for p, n in zip(PARTS, (*widths, len(mission.signals)), strict=True)}
    places = places_of(mission)
    wanted = set(columns) - {"t", "uav"}
    if mission.obstacles and _CLEARANCE in wanted:
        wanted = wanted - {_CLEARANCE} | set(_FOR_CLEARANCE)
    if unknown := sorted(wanted - set(places)):
        raise UserError(f"columns: there is no column {', '.join(unknown)}; there are {', '.join(places)}")
    kept = {places[name] for name in wanted} | {Place("truth", 0)}
    return {part: sorted(place.number for place in kept if place.part == part) for part in PARTS}


def columns_needed(mission: Mission) -> frozenset[str]:
    """Return the columns that the claims of a mission's case and its verdict are computed from."""
    claimed = (recorded_names(claim.signal) for claim in mission.claims)
    return frozenset[str]().union(columns_judged(mission), *claimed)
